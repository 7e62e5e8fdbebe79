"""The game: the rules composed. One reset, one step, neither batched nor auto-reset."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, PRNGKeyArray, UInt32

from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide, one_each
from apollonius.game.dynamics import Unicycle
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.outcome import decide, is_captured
from apollonius.game.reward import Reward
from apollonius.game.scenario import Scenario
from apollonius.game.starts import Starts
from apollonius.game.types import ROLES, Action, GameState, Outcome, Real, RobotState, Role, Scalar, Timestep
from apollonius.game.validation import check_game

_BLOCK = 1024
"""Starts of a match that are drawn at a time."""


class Game(eqx.Module):
    """A pursuit-evasion game between two robots among obstacles.

    All its numbers are leaves of a pytree: one compilation serves every speed, radius and time step, and a sweep over
    them is a `vmap`. Only the numbers of obstacles and of their corners and cells, and the named profiles, are static.

    Attributes:
        pursuer, evader: the robots' limits; equal in the paper.
        arena: walls and obstacles.
        capture_distance: the robots' centres come closer than this [m]: captured (D_catch of Table I).
        dt: how long controls are held [s].
        max_steps: time limit [steps].
        reward: what each side is paid.
        starts: where games begin.
        scenario: the arenas of which each game has one (`in_arenas`); None where all are played in `arena`.

    Raises:
        InvalidInput: at construction, for values no game can be played with; names value, bound and remedy.
    """

    pursuer: Unicycle = Unicycle()
    evader: Unicycle = Unicycle()
    arena: Arena = Arena()
    capture_distance: Real = 0.3
    dt: Real = 0.1
    max_steps: int | Array = 1000
    reward: Reward = Reward()
    starts: Starts = Starts()
    scenario: Scenario | None = None

    def __check_init__(self) -> None:
        check_game(self)

    @property
    def bodies(self) -> BySide[tuple[Unicycle, ...]]:
        """The limits of every robot of either side."""
        return BySide((self.pursuer,), (self.evader,))

    def body(self, role: Role) -> Unicycle:
        """The limits of one side's robot, in a game of two robots."""
        return one_each(self.bodies)[role]

    def reset(self, key: PRNGKeyArray) -> GameState:
        """An initial state from the game's distribution of arenas and starts. The key is consumed."""
        if self.scenario is None:
            return self.starts.sample(key, self.arena, self.pursuer, self.evader)
        place_key, start_key = jax.random.split(key)
        return self.reset_at(self.scenario.sample(place_key), start_key)

    def reset_at(self, place: Int[Array, ""], key: PRNGKeyArray) -> GameState:
        """An initial state at one place of the scenario, which there must be. The key is consumed."""
        assert self.scenario is not None, "who knows of places knows that there are some"
        game = self.scenario.game(self, place)
        return replace(self.starts.sample(key, game.arena, game.pursuer, game.evader), place=place)

    def at(self, state: GameState) -> "Game":
        """The game in one arena and of two known robots that is played in this state."""
        return self if self.scenario is None else self.scenario.game(self, state.place)

    def require_one_arena(self, who: str) -> None:
        """Refuse a game in one of several arenas.

        Args:
            who: what has to know the arena beforehand, for the message.

        Raises:
            InvalidInput: with how many there are.
        """
        if self.scenario is not None:
            require(False, "arenas", self.scenario.size, f"one, which {who} has to know beforehand")

    def step(self, state: GameState, pursuer_action: Action, evader_action: Action) -> Timestep:
        """Both robots hold their actions for `dt`; then the rules judge the step."""
        game = self.at(state)
        pursuer, evader = game.pursuer.controls(pursuer_action), game.evader.controls(evader_action)
        return self.step_controls(state, BySide((pursuer,), (evader,)))

    def step_controls(self, state: GameState, controls: BySide[tuple[tuple[Scalar, Scalar], ...]]) -> Timestep:
        """All robots hold their controls (u1 [m/s^2], u2 [rad/s], within their limits) for `dt`."""
        game = self.at(state)

        def moved(role: Role) -> tuple[RobotState, ...]:
            robots = zip(game.bodies[role], state.robots[role], controls[role], strict=True)
            return tuple(body.move(robot, *held, self.dt) for body, robot, held in robots)

        after = replace(state, robots=ROLES.map(moved), steps=state.steps + 1)
        outcome = outcome_after(game, state, after)
        out_of_time = outcome == Outcome.NO_RESULT
        truncated = out_of_time & (not self.reward.time_limit_wins)
        return Timestep(
            state=after,
            outcome=outcome,
            reward=self.reward(outcome, distance(state), distance(after)),
            terminated=(outcome != Outcome.ONGOING) & ~truncated,
            truncated=truncated,
        )


def distance(state: GameState) -> Scalar:
    """Distance [m] between the robots' centres."""
    return jnp.hypot(state.evader.x - state.pursuer.x, state.evader.y - state.pursuer.y)


def reset_batch(game: Game, key: PRNGKeyArray, games: int) -> GameState:
    """Initial states of several games, leaves of shape `[games]`. The key is consumed."""
    return jax.vmap(game.reset)(jax.random.split(key, games))


def sample_starts(game: Game, key: PRNGKeyArray, games: int) -> GameState:
    """The starts of `reset_batch`, drawn block by block: one compilation serves every number of games.

    In several arenas games take turns, as `Scenario.place_of` says.

    Returns:
        Initial states, leaves `[games]`.
    """
    blocks = [jax.device_get(_draw_block(game, key, np.uint32(first))) for first in range(0, games, _BLOCK)]
    return jax.device_put(jax.tree.map(lambda *leaves: np.concatenate(leaves)[:games], *blocks))


@jax.jit
def _draw_block(game: Game, key: PRNGKeyArray, first: UInt32[Array, ""]) -> GameState:
    # The i-th key that `split` makes is that of `fold_in` with i.
    index = first + jnp.arange(_BLOCK, dtype=jnp.uint32)

    def draw(one: UInt32[Array, ""]) -> GameState:
        start_key = jax.random.fold_in(key, one)
        if game.scenario is None:
            return game.reset(start_key)
        return game.reset_at(game.scenario.place_of(one.astype(jnp.int32)), start_key)

    return jax.vmap(draw)(index)


@fusion_barrier
def outcome_after(game: Game, before: GameState, after: GameState) -> Int[Array, ""]:
    """How a game in one arena stands after a step, from the states at its two ends."""
    arena = game.arena
    return decide(
        captured=is_captured(before, after, game.capture_distance),
        pursuer_hit=arena.hits_obstacle(before.pursuer, after.pursuer, game.pursuer.radius),
        pursuer_out=arena.is_out_of_range(after.pursuer, game.pursuer.radius),
        evader_hit=arena.hits_obstacle(before.evader, after.evader, game.evader.radius),
        evader_out=arena.is_out_of_range(after.evader, game.evader.radius),
        out_of_time=after.steps >= game.max_steps,
        territory_reached=arena.reaches_territory(before.evader, after.evader) if arena.territory else None,
    )
