"""Games between robots with bodies, which the game's own referee judges, beside the same games by the rules."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int, PRNGKeyArray

from apollonius.agents.pool import Pool
from apollonius.evaluate.match import Match, MatchResult, begin, count
from apollonius.evaluate.statistics import paired_difference_interval
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import stack_actions
from apollonius.game.game import Game
from apollonius.game.judge import judge
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS
from apollonius.game.types import GameState, Outcome
from apollonius.io.limits import SIMULATED_GAMES
from apollonius.play import rollout
from apollonius.play.playout import Report, Results
from apollonius.play.random_bits import random_bits_of
from apollonius.play.replay import Replay, as_rows, as_state
from apollonius.play.rollout import Games, SideState, step_games
from apollonius.simulate.drive import Drive, References
from apollonius.simulate.physics import Physics


@dataclass(frozen=True)
class Simulated:
    """Simulated games with all their steps.

    Attributes:
        results: how the games ended.
        index: which game each step belongs to; the steps of a game are in order.
        states: before each step, x [m], y [m], v [m/s], heading [rad] of pursuer, then evader.
        actions: of both sides in each step, as in a `Replay`.
        after: the states that each step led to.
    """

    results: Results
    index: Int[np.ndarray, " steps"]
    states: Float32[np.ndarray, "steps 8"]
    actions: Int[np.ndarray, "steps 2"] | Float32[np.ndarray, "steps 2 2"]
    after: Float32[np.ndarray, "steps 8"]

    def course(
        self, game: int
    ) -> tuple[Float32[np.ndarray, "rows 8"], Int[np.ndarray, "steps 2"] | Float32[np.ndarray, "steps 2 2"]]:
        own = self.index == game
        return np.concatenate([self.states[own], self.after[own][-1:]]), self.actions[own]


def simulate(
    game: Game, players: BySide[Pool], starts: GameState, key: PRNGKeyArray, drive: Drive,
    report: Report = lambda done, total: None,
) -> Simulated:  # fmt: skip
    """Play each of the given starts to its end with bodies; the players draw the same random bits as in `play_out`.

    Players see the bodies' exact states, once in every step of the game. A step is judged as in the game, from where
    the bodies' axles are at its two ends and with the radii of the game's robots, so that what differs from the game
    is how the robots move and nothing else.

    Args:
        starts: initial states, leaves `[games]`.
        key: consumed.
        report: called after every step with the number of games that have ended.

    Raises:
        InvalidInput: as `Physics`.
    """
    game.require_two("a simulation")
    physics = Physics(game, drive)
    limits = np.array([[body.v_min, body.v_max] for body in (game.pursuer, game.evader)], float)
    rows = as_rows(starts)
    bodies, references = physics.place(rows), References(rows[:, [2, 6]].astype(float))
    count = len(rows)
    sides = rollout.begin(game, starts, players, random_bits_of(key, jnp.arange(count), jnp.full(count, -1))).sides
    outcome, length = np.full(count, int(Outcome.ONGOING), np.int32), np.zeros(count, np.int32)
    log: list[tuple[np.ndarray, ...]] = []
    alive = np.arange(count)
    while alive.size:
        actions, controls, sides = _choose(game, players, sides, rows, length, key)
        asked = references.follow(drive, np.asarray(controls, float), limits, physics.steps, physics.step)
        bodies[alive] = physics.advance(bodies[alive], asked[alive])
        before, rows = rows, rows.copy()
        rows[alive] = physics.measure(bodies[alive])
        length[alive] += 1
        outcome[alive] = np.asarray(_judge(game, before, rows, length))[alive]
        taken = (before, np.asarray(actions), rows)
        log.append((alive, *(part[alive] for part in taken)))
        alive = alive[outcome[alive] == Outcome.ONGOING]
        report(count - alive.size, count)
    index, states, actions, after = (np.concatenate(parts) for parts in zip(*log, strict=True))
    return Simulated(Results(jnp.asarray(outcome), jnp.asarray(length)), index, states, actions, after)


def simulate_match(match: Match, drive: Drive, report: Report = lambda done, total: None) -> Simulated:
    """Simulate a match from its starts, as `simulate`; raises InvalidInput for more games than fit into memory."""
    SIMULATED_GAMES.require("games", match.games)
    return simulate(match.rules, match.pools, *begin(match), drive, report)


def record_course(simulated: Simulated, match: Match, index: int) -> Replay:
    """Return one of the games as a replay, to be looked at. Played again, by the rules, it goes another way."""
    outcome = Outcome(int(simulated.results.outcome[index]))
    names, games = match.players.map(lambda player: player.name), len(simulated.results.outcome)
    return Replay(match.game, names.pursuer, names.evader, match.seed, games, index, *simulated.course(index), outcome)


@jax.jit
def _choose(
    game: Game,
    players: BySide[Pool],
    sides: BySide[SideState],
    rows: Float32[Array, "games 8"],
    length: Int[Array, " games"],
    key: PRNGKeyArray,
) -> tuple[Int[Array, "games 2"] | Float[Array, "games 2 2"], Float[Array, "games 2 2"], BySide[SideState]]:
    """Return the actions of both sides, their controls (u1 [m/s^2], u2 [rad/s]), and the sides after choosing them."""
    state, bits = jax.vmap(as_state)(rows, length), random_bits_of(key, jnp.arange(rows.shape[0]), length)
    games, moves = step_games(game, players, Games(state, sides), bits)
    actions = moves.sides.map(lambda side: side.action)
    controls = [jax.vmap(body.controls)(act) for body, act in zip((game.pursuer, game.evader), actions, strict=True)]
    stacked = jnp.stack([jnp.stack(pair, axis=-1) for pair in controls], axis=1)
    return jax.vmap(stack_actions)(*actions), stacked, games.sides


@jax.jit
def _judge(
    game: Game, before: Float32[Array, "games 8"], after: Float32[Array, "games 8"], length: Int[Array, " games"]
) -> Int[Array, " games"]:
    state = jax.vmap(as_state)
    return jax.vmap(judge, in_axes=(None, 0, 0))(game, state(before, length - 1), state(after, length))[0]


EVENTS: dict[str, tuple[Outcome, ...]] = {
    "pursuer wins": PURSUER_WINS,
    "captured": (Outcome.CAPTURED,),
    "pursuer fails": (*PURSUER_FAILS, Outcome.BOTH_FAILED),
    "evader fails": (Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE, Outcome.BOTH_FAILED),
    "no result": (Outcome.NO_RESULT,),
}
"""What is counted in pairs: games that ended in one of these."""


@dataclass(frozen=True)
class Difference:
    """How often something happened, in [0, 1], by the rules and with bodies; and how much more often with bodies."""

    rules: float
    bodies: float
    difference: float
    interval: tuple[float, float]
    """95 % interval of the difference, over pairs of games from the same start."""


@dataclass(frozen=True)
class Comparison:
    """The results of a match by the rules and of the same match with bodies, and the differences of `EVENTS`."""

    rules: MatchResult
    bodies: MatchResult
    differences: dict[str, Difference]


def compare(match: Match, rules: Results, simulated: Simulated) -> Comparison:
    """Return the results of a match by the rules and with bodies, and their differences over the same starts."""
    differences: dict[str, Difference] = {}
    for event, outcomes in EVENTS.items():
        by_rules, with_bodies = (np.isin(np.asarray(one.outcome), outcomes) for one in (rules, simulated.results))
        often, more = float(by_rules.mean()), float(with_bodies.mean())
        interval = paired_difference_interval(with_bodies, by_rules)
        differences[event] = Difference(often, more, more - often, interval)
    return Comparison(count(match, rules), count(match, simulated.results), differences)
