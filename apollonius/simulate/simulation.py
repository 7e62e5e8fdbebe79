"""Games between robots with bodies, which the game's own referee judges, beside the same games by
the rules.
"""

from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int, PRNGKeyArray

from apollonius.agents.pool import Pool
from apollonius.evaluate.match import Match, MatchResult, count_results, draw_starts
from apollonius.evaluate.statistics import paired_difference_interval
from apollonius.game import drive as game_drive
from apollonius.game.drive import drive_of, respond
from apollonius.game.dynamics import stack_actions
from apollonius.game.game import Game
from apollonius.game.judge import judge
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS
from apollonius.game.types import (
    ROLES,
    Action,
    BySide,
    GameState,
    MoverStates,
    Outcome,
    Role,
    tree_where,
)
from apollonius.io.limits import SIMULATED_GAMES
from apollonius.play import rollout
from apollonius.play.playout import Report, Results, no_report
from apollonius.play.random_bits import random_bits_of
from apollonius.play.replay import Replay, as_rows, as_state
from apollonius.play.rollout import Games, SideState, step_games
from apollonius.simulate.drive import References, RobotHardware
from apollonius.simulate.physics import Physics


@dataclass(frozen=True)
class SimulatedGames:
    """Simulated games with all their steps, those of a game in order; each belongs to the game of
    its index.

    States before a step, and after it, are x [m], y [m], v [m/s], heading [rad] of pursuers, then
    evaders; actions are as in a `Replay`. `movers` are those of each game at its start, leaves
    `[games]`; None in games without any.
    """

    results: Results
    index: Int[np.ndarray, " steps"]
    states: Float32[np.ndarray, "steps columns"]
    actions: Int[np.ndarray, "steps robots"] | Float32[np.ndarray, "steps robots 2"]
    after: Float32[np.ndarray, "steps columns"]
    movers: MoverStates | None

    def course(self, game: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the states of a game, the last one too, and the actions in it."""
        own = self.index == game
        return np.concatenate([self.states[own], self.after[own][-1:]]), self.actions[own]


def simulate(
    game: Game,
    players: BySide[Pool],
    starts: GameState,
    key: PRNGKeyArray,
    drive: RobotHardware,
    report: Report = no_report,
) -> SimulatedGames:
    """Play each start to its end with bodies; the players use the same random bits as in
    `play_out`.

    Players observe the bodies' states through the sensors of the game, once in every step, and know
    their turn rates and the limits of their drives. The lag of the game's drives precedes the
    latency of the bodies' own; the smaller of two turn accelerations holds. A step is judged as in
    the game, by the positions of the bodies' axles at its two ends and the radii of the game's
    robots, so that only the motion differs from the game. A robot that is out of play brakes.
    Movers go by the rules, beside the bodies where they really are; like robots they push nobody.

    Args:
        game: The game.
        players: Both sides' players.
        starts: The starts, leaves `[games]`.
        key: Key of all random bits; it is consumed.
        drive: The robots' drive.
        report: Called with the finished games and all games.

    Raises:
        InvalidInput: As `Physics`.
    """
    physics = Physics(game, drive)
    limits = _body_limits(game, drive)
    rows = as_rows(starts)
    known_game = _with_drive(game, drive)
    bodies = physics.set_poses(rows)
    references = References(rows[:, 2::4].astype(float))
    count = len(rows)
    bits = random_bits_of(key, jnp.arange(count), jnp.full(count, -1))
    games = rollout.init_games(known_game, starts, players, bits)
    outcome = np.full(count, int(Outcome.ONGOING), np.int32)
    alive = np.arange(count)
    log: list[tuple[np.ndarray, ...]] = []
    while alive.size:
        games = _with_turn_rates(games, physics.turn_rates(bodies))
        actions, controls, sides = _select_actions(known_game, game.drives, players, games, key)
        braking = _braking_controls(references.v, limits, float(game.dt))
        is_out = ~np.stack([active for side in games.state.active for active in side], axis=1)
        body_controls = np.where(is_out[..., None], braking, np.asarray(controls, float))
        wheel_speeds = references.follow(
            drive, body_controls, limits.speeds, physics.steps, physics.step, limits.turning
        )
        bodies[alive] = physics.advance(bodies[alive], wheel_speeds[alive])
        before, rows = rows, rows.copy()
        rows[alive] = physics.measure(bodies[alive])
        games, outcomes_now = _judge_steps(game, games, sides, rows, outcome == Outcome.ONGOING)
        outcome[alive] = np.asarray(outcomes_now)[alive]
        log.append((alive, *(part[alive] for part in (before, np.asarray(actions), rows))))
        alive = alive[outcome[alive] == Outcome.ONGOING]
        report(count - alive.size, count)
    results = Results(
        jnp.asarray(outcome), games.state.steps, games.state.status, sightings=games.sightings
    )
    steps = (np.concatenate(parts) for parts in zip(*log, strict=True))
    return SimulatedGames(results, *steps, movers=starts.movers)


@dataclass(frozen=True)
class _BodyLimits:
    """Greatest accelerations [m/s^2], least and greatest speeds [m/s], and greatest turn
    accelerations [rad/s^2] of pursuers, then evaders.
    """

    accelerations: Float[np.ndarray, " robots"]
    speeds: Float[np.ndarray, "robots 2"]
    turning: Float[np.ndarray, " robots"]


def _body_limits(game: Game, drive: RobotHardware) -> _BodyLimits:
    bodies = [body for side in game.bodies for body in side]
    turning = [_turn_acceleration(game, drive, role) for role in Role for _ in game.bodies[role]]
    return _BodyLimits(
        accelerations=np.array([body.u1_max for body in bodies], float),
        speeds=np.array([[body.v_min, body.v_max] for body in bodies], float),
        turning=np.array(turning),
    )


def _braking_controls(
    speeds: Float[np.ndarray, "games robots"], limits: _BodyLimits, dt: float
) -> Float[np.ndarray, "games robots 2"]:
    """Return the controls by which robots of these speeds [m/s] come to rest as soon as they
    can.
    """
    braking = np.clip(-speeds / dt, -limits.accelerations, limits.accelerations)
    return np.stack([braking, np.zeros_like(braking)], axis=-1)


def _turn_acceleration(game: Game, drive: RobotHardware, role: Role) -> float:
    """Return the greatest turn acceleration of one side's robots [rad/s^2]."""
    time = drive_of(game.drives, role).turn_time
    slow = inf if time is None else float(game.bodies[role][0].u2_max) / max(float(time), 1e-6)
    return min(drive.turn_acceleration, slow)


def _with_drive(game: Game, drive: RobotHardware) -> Game:
    """Return the game as its players know it, whose robots have this drive too."""

    def slower(role: Role) -> game_drive.Drive:
        own = drive_of(game.drives, role)
        late = ceil((drive.latency + drive.lag) / float(game.dt) - 1e-6)
        time = float(game.bodies[role][0].u2_max) / _turn_acceleration(game, drive, role)
        return game_drive.Drive((own.lag or 0) + late, time)

    return replace(game, drives=game_drive.Drives(*ROLES.map(slower)))


def _with_turn_rates(games: Games, rates: Float[np.ndarray, "games robots"]) -> Games:
    """Return games in which robots know these turn rates [rad/s]."""
    rates_by_robot = iter(jnp.asarray(rates, jnp.float32).T)

    def side(state: SideState) -> SideState:
        return replace(
            state,
            drives=tuple(
                replace(drive_state, turn_rate=next(rates_by_robot)) for drive_state in state.drives
            ),
        )

    return replace(games, sides=games.sides.map(side))


def simulate_match(
    match: Match, drive: RobotHardware, report: Report = no_report
) -> SimulatedGames:
    """Simulate a match from its starts, as `simulate`; raises InvalidInput for more games than fit
    into memory.
    """
    SIMULATED_GAMES.require("games", match.games)
    return simulate(match.rules, match.pools, *draw_starts(match), drive, report)


def record_course(simulated: SimulatedGames, match: Match, index: int) -> Replay:
    """Return one of the games as a replay, to be looked at. Played again, by the rules, it goes
    another way.
    """
    outcome = Outcome(int(simulated.results.outcome[index]))
    names, games = match.players.map(lambda player: player.name), len(simulated.results.outcome)
    return Replay(
        match.game,
        names.pursuer,
        names.evader,
        match.seed,
        games,
        index,
        *simulated.course(index),
        outcome,
        movers=jax.tree.map(lambda leaf: leaf[index], simulated.movers),
    )


@jax.jit
def _select_actions(
    game: Game,
    drives: game_drive.Drives | None,
    players: BySide[Pool],
    games: Games,
    key: PRNGKeyArray,
) -> tuple[Array, Float[Array, "games robots 2"], BySide[SideState]]:
    """Return all robots' actions in a game, the controls u1 [m/s^2] and u2 [rad/s] that their
    bodies get, late by the lag of these drives, and the sides after.
    """
    steps = games.state.steps
    after, moves = step_games(
        game, players, games, random_bits_of(key, jnp.arange(len(steps)), steps)
    )
    late = ROLES.map(lambda role: replace(drive_of(drives, role), turn_time=None))

    def of_each(role: Role) -> tuple[Array, ...]:
        action, robots = moves.sides[role].action, len(game.bodies[role])
        return (action,) if robots == 1 else tuple(action[:, robot] for robot in range(robots))

    def controls_of(states: Any, actions: BySide[tuple[Action, ...]]) -> Float[Array, "robots 2"]:
        controls_by_side = ROLES.map(
            lambda role: respond(
                late[role], states[role], game.bodies[role], actions[role], game.dt
            )[0]
        )
        return jnp.stack([jnp.stack(controls) for side in controls_by_side for controls in side])

    actions = ROLES.map(of_each)
    controls = jax.vmap(controls_of)(games.sides.map(lambda side: side.drives), actions)
    return jax.vmap(stack_actions)(*actions.pursuer, *actions.evader), controls, after.sides


@jax.jit
def _judge_steps(
    game: Game,
    games: Games,
    sides: BySide[SideState],
    rows: Float32[Array, "games columns"],
    alive: Bool[Array, " games"],
) -> tuple[Games, Int[Array, " games"]]:
    """Return the games that are not over after a step that led to these rows, and how each
    ended.
    """

    def judge_game(
        state: GameState, row: Float32[Array, " columns"]
    ) -> tuple[GameState, Int[Array, ""]]:
        after = replace(
            state,
            robots=as_state(row, state.steps, len(game.bodies.pursuer)).robots,
            steps=state.steps + 1,
            movers=game.movers and game.movers.step(game.arena, state, game.bodies, game.dt),
        )
        outcome, status = judge(game, state, after)
        return replace(after, status=status), outcome

    states, outcome = jax.vmap(judge_game)(games.state, rows)
    return jax.vmap(tree_where)(alive, Games(states, sides), games), outcome


EVENTS: dict[str, tuple[Outcome, ...]] = {
    "pursuer wins": PURSUER_WINS,
    "captured": (Outcome.CAPTURED,),
    "pursuer fails": (*PURSUER_FAILS, Outcome.BOTH_FAILED),
    "evader fails": (Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE, Outcome.BOTH_FAILED),
    "no result": (Outcome.NO_RESULT,),
}
"""Outcomes that are counted in pairs of games, by the name of their group."""


@dataclass(frozen=True)
class Difference:
    """Frequency of an event, in [0, 1], by the rules and with bodies, and the difference between
    both.
    """

    rules: float
    bodies: float
    difference: float
    interval: tuple[float, float]
    """95 % interval of the difference, over pairs of games from the same start."""


@dataclass(frozen=True)
class Comparison:
    """The results of a match by the rules and of the same match with bodies, and the differences of
    `EVENTS`.
    """

    rules: MatchResult
    bodies: MatchResult
    differences: dict[str, Difference]


def compare_physics(match: Match, rules: Results, simulated: SimulatedGames) -> Comparison:
    """Return the results of a match by the rules and with bodies, and their differences over the
    same starts.
    """
    differences: dict[str, Difference] = {}
    for event, outcomes in EVENTS.items():
        by_rules = np.isin(np.asarray(rules.outcome), outcomes)
        with_bodies = np.isin(np.asarray(simulated.results.outcome), outcomes)
        rate_by_rules = float(by_rules.mean())
        rate_with_bodies = float(with_bodies.mean())
        differences[event] = Difference(
            rate_by_rules,
            rate_with_bodies,
            rate_with_bodies - rate_by_rules,
            paired_difference_interval(with_bodies, by_rules),
        )
    return Comparison(
        count_results(match, rules), count_results(match, simulated.results), differences
    )
