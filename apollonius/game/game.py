"""The game: the rules composed. One reset, one step, neither batched nor auto-reset."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, PRNGKeyArray, UInt32

from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide, one_each
from apollonius.game.dynamics import Unicycle
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.judge import fates, judge
from apollonius.game.reward import Reward
from apollonius.game.scenario import Scenario
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams, nearest
from apollonius.game.types import ROLES, Action, GameState, Outcome, Real, RobotState, Role, Scalar, Timestep
from apollonius.game.validation import check_game
from apollonius.io.errors import require

_BLOCK = 1024
"""Starts of a match that are drawn at a time."""


class Game(eqx.Module):
    """A pursuit-evasion game between two robots, or two teams of them, among obstacles.

    All its numbers are leaves of a pytree: one compilation serves every speed, radius and time step, and a sweep over
    them is a `vmap`. Only the numbers of robots, of obstacles and of their corners and cells, and the named profiles,
    are static.

    Attributes:
        pursuer, evader: the robots' limits, of a team those of its first robot; equal in the paper.
        arena: walls and obstacles.
        capture_distance: the robots' centres come closer than this [m]: captured (D_catch of Table I).
        dt: how long controls are held [s].
        max_steps: time limit [steps].
        reward: what each side is paid.
        starts: where games begin.
        scenario: the arenas of which each game has one (`in_arenas`); None where all are played in `arena`.
        teams: the other robots of either side; None in a game of two.

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
    teams: Teams | None = None

    def __check_init__(self) -> None:
        check_game(self)

    @property
    def bodies(self) -> BySide[tuple[Unicycle, ...]]:
        """The limits of every robot of either side."""
        others = self.teams or Teams()
        return BySide((self.pursuer, *others.pursuers), (self.evader, *others.evaders))

    @property
    def size(self) -> str:
        """How many robots either side has, as `3 v 1`."""
        return " v ".join(str(len(side)) for side in self.bodies)

    def body(self, role: Role) -> Unicycle:
        """The limits of one side's robot, in a game of two robots."""
        return one_each(self.bodies)[role]

    def reset(self, key: PRNGKeyArray) -> GameState:
        """An initial state from the game's distribution of arenas and starts. The key is consumed."""
        if self.scenario is None:
            return self.starts.sample(key, self.arena, self.bodies)
        place_key, start_key = jax.random.split(key)
        return self.reset_at(self.scenario.sample(place_key), start_key)

    def reset_at(self, place: Int[Array, ""], key: PRNGKeyArray) -> GameState:
        """An initial state at one place of the scenario, which there must be. The key is consumed."""
        assert self.scenario is not None, "who knows of places knows that there are some"
        game = self.scenario.game(self, place)
        return replace(self.starts.sample(key, game.arena, game.bodies), place=place)

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

    def require_two(self, who: str) -> None:
        """Refuse a game of teams.

        Args:
            who: what knows two robots only, for the message.

        Raises:
            InvalidInput: with how many there are.
        """
        require(self.teams is None, "robots", self.size, f"1 v 1: {who} knows games of two robots only")

    def duel(self, who: str) -> "Game":
        """The game of two that any pursuer of a team plays against any evader.

        Args:
            who: what knows two robots only, for the message.

        Raises:
            InvalidInput: where robots of one side differ in their limits.
        """
        alike = all(body == side[0] for side in self.bodies for body in side)
        require(alike, "robots", "of several kinds", f"alike on either side: {who} knows one pursuer and one evader")
        return replace(self, teams=None)

    def step(
        self, state: GameState, pursuer_action: Action | Sequence[Action], evader_action: Action | Sequence[Action]
    ) -> Timestep:
        """All robots hold their actions for `dt`; then the rules judge the step.

        Args:
            pursuer_action, evader_action: of a side of one robot its action, of a team a list or tuple of them.
        """
        bodies, asked = self.at(state).bodies, BySide(pursuer_action, evader_action)

        def controls(role: Role) -> tuple[tuple[Scalar, Scalar], ...]:
            actions = asked[role]
            several = (actions,) if isinstance(actions, jax.Array | np.ndarray) else actions
            return tuple(body.controls(action) for body, action in zip(bodies[role], several, strict=True))

        return self.step_controls(state, ROLES.map(controls))

    def step_controls(self, state: GameState, controls: BySide[tuple[tuple[Scalar, Scalar], ...]]) -> Timestep:
        """All robots hold their controls (u1 [m/s^2], u2 [rad/s], within their limits) for `dt`.

        One that is not active stands still.
        """
        game = self.at(state)

        def moved(role: Role) -> tuple[RobotState, ...]:
            robots = zip(game.bodies[role], state.robots[role], controls[role], strict=True)
            ends = tuple(body.move(robot, *held, self.dt) for body, robot, held in robots)
            if state.status is None:
                return ends
            ways = zip(state.active[role], ends, state.robots[role], strict=True)
            return tuple(_moved_or_still(active, end, start) for active, end, start in ways)

        after = replace(state, robots=ROLES.map(moved), steps=state.steps + 1)
        outcome, status = judge(game, state, after)
        after = replace(after, status=status)
        pay = _paid_apart if self.teams else _paid
        out_of_time = outcome == Outcome.NO_RESULT
        truncated = out_of_time & (not self.reward.time_limit_wins)
        return Timestep(
            state=after,
            outcome=outcome,
            rewards=pay(self.reward, outcome, state, after),
            terminated=(outcome != Outcome.ONGOING) & ~truncated,
            truncated=truncated,
        )


def _moved_or_still(active: Bool[Array, ""], end: RobotState, start: RobotState) -> RobotState:
    """Where a robot is after a step: at rest where it was, if it is not active."""
    halted = replace(start, v=jnp.zeros_like(start.v))
    return jax.tree.map(lambda there, here: jnp.where(active, there, here), end, halted)


def distance(state: GameState) -> Scalar:
    """Distance [m] between the centres of two robots, in a game of two."""
    return jnp.hypot(state.evader.x - state.pursuer.x, state.evader.y - state.pursuer.y)


def _leads(before: GameState, after: GameState) -> list[tuple[Scalar, Scalar]]:
    """Distances [m] of each evader from the nearest of the pursuers that are active before a step, before and after."""

    def lead(state: GameState, evader: RobotState) -> Scalar:
        pursuers = state.robots.pursuer
        pursuer = nearest(evader, pursuers, before.active.pursuer, pursuers)
        return jnp.hypot(evader.x - pursuer.x, evader.y - pursuer.y)

    return [
        (lead(before, start), lead(after, end))
        for start, end in zip(before.robots.evader, after.robots.evader, strict=True)
    ]


def _paid(reward: Reward, outcome: Int[Array, ""], before: GameState, after: GameState) -> BySide[tuple[Scalar, ...]]:
    return reward(outcome, fates(outcome, before.status, after.status), _leads(before, after))


_paid_apart = fusion_barrier(_paid)
"""In teams mates share what they are paid, which would be computed anew for each of them and each of its uses."""


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
