"""The game: the rules composed. One reset, one step, neither batched nor auto-reset."""

from dataclasses import replace
from typing import Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, PRNGKeyArray, UInt32

from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.game import validation
from apollonius.game.arena import Arena
from apollonius.game.chart import Chart
from apollonius.game.drive import Drives
from apollonius.game.dynamics import Unicycle, as_action
from apollonius.game.judge import judge, robot_events
from apollonius.game.movers import Movers
from apollonius.game.packed_arena import pack
from apollonius.game.reward import Reward, nearest_distances
from apollonius.game.scenario import Scenario
from apollonius.game.sensing import Sensing
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams
from apollonius.game.types import (
    ROLES,
    BySide,
    Controls,
    GameState,
    Outcome,
    Real,
    RobotState,
    Role,
    Scalar,
    SideAction,
    Timestep,
    tree_where,
    value_for_each,
)
from apollonius.game.uncertainty import Uncertainties, Uncertainty
from apollonius.io.errors import require

MAX_STEPS = 2**31 - 1
"""Largest time limit [steps]: steps are counted in 32 bits."""
_BLOCK = 1024
"""Starts of a match that are drawn at a time."""


@runtime_checkable
class _InArena(Protocol):
    """A state, or what is known of it, in one of the arenas of a scenario."""

    @property
    def variant(self) -> Int[Array, ""] | None: ...


class Game(eqx.Module):
    """A pursuit-evasion game between two robots, or two teams, among obstacles.

    All its numbers are leaves of a pytree: one compilation serves every speed, radius and time
    step, and a sweep over them is a `vmap`. Only the numbers of robots, of obstacles and of their
    corners and cells, and the named profiles, are static.

    Attributes:
        pursuer, evader: the robots' limits, of a team those of its first robot; equal in the paper.
            Robots of other kinds are in `apollonius.game.models`.
        arena: walls and obstacles.
        capture_distance: distance [m] of two centres below which the evader is captured (D_catch of
            Table I).
        dt: duration of a step, in which controls are held [s].
        max_steps: time limit [steps].
        scenario: the arenas from which each game draws one (`in_arenas`); None for games in
            `arena`.
        teams: the other robots of either side; None in a game of two.
        reward, starts: rewards of both sides, and the distribution of initial states.
        sensors, drives: of either side; None for robots that see everything and act at once.
        uncertainty: bounds of what robots of either side do not know of themselves, which shields
            allow for; None for robots that know themselves exactly.
        movers: things that move by themselves; None without any.
        chart: distances in its arena, or in all those of its scenario, which players for any arena
            read; derived (`apollonius.arenas.charting.with_chart`), never in a file. `in_arena`
            replaces the arena and drops its chart.

    Raises:
        InvalidInput: at construction, for values that no game can be played with.
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
    sensors: Sensing | None = None
    drives: Drives | None = None
    uncertainty: Uncertainties | None = None
    movers: Movers | None = None
    chart: Chart | None = None

    def __check_init__(self) -> None:
        self.check()

    def check(self) -> None:
        """Refuse a game that cannot be played. Numbers that are traced or swept stay unchecked."""
        validation.require_usual_numbers()
        if validation.is_swept(self):
            return
        validation.check_finite(self)
        require(np.float32(self.dt) > 0, "dt", self.dt, "more than 0 s; the paper game uses 0.1")
        bound = "more than 0 m; the paper uses 0.3"
        require(
            np.float32(self.capture_distance) > 0, "capture_distance", self.capture_distance, bound
        )
        steps = self.max_steps
        bound = f"a whole number, at least 1, at most {MAX_STEPS}; the paper game uses 1000"
        require(1 <= steps <= MAX_STEPS and steps == int(steps), "max_steps", steps, bound)
        self.reward.check()
        validation.check_bodies(self.bodies, float(self.dt), self.sensors, self.drives)
        validation.check_uncertainty(self.uncertainty, self.drives, self.bodies)
        self.arena.check()
        self.starts.check(self.capture_distance)
        validation.check_space_to_start(self.arena, self.bodies, self.starts)
        validation.check_movers(self.movers, self.arena)

    @property
    def bodies(self) -> BySide[tuple[Unicycle, ...]]:
        """The limits of every robot of either side."""
        mates = self.teams or Teams()
        return BySide((self.pursuer, *mates.pursuers), (self.evader, *mates.evaders))

    @property
    def size(self) -> str:
        """The numbers of robots, as `3 v 1`."""
        return " v ".join(str(len(side)) for side in self.bodies)

    def body(self, role: Role) -> Unicycle:
        """Return the limits of one side's robot, in a game of two."""
        return value_for_each(self.bodies)[role]

    def uncertainty_of(self, role: Role) -> Uncertainty | None:
        """Return the bounds of what a side's robots do not know of themselves: those of the game,
        and those of the noise of their sensors; None without either.
        """
        bounds = self.uncertainty and self.uncertainty[role]
        sensors = self.sensors and self.sensors[role]
        noise = sensors and sensors.own_noise
        if noise is None:
            return bounds
        return noise.bounds if bounds is None else bounds.plus(noise.bounds)

    def reset(self, key: PRNGKeyArray) -> GameState:
        """Draw an arena and an initial state. The key is consumed."""
        validation.require_key(key)
        if self.scenario is None:
            return self._sample_start(key)
        variant_key, start_key = jax.random.split(key)
        return self.reset_at(self.scenario.sample(variant_key), start_key)

    def reset_at(self, variant: Int[Array, ""], key: PRNGKeyArray) -> GameState:
        """Draw an initial state in one arena of the scenario. The key is consumed."""
        return replace(self.with_variant(variant)._sample_start(key), variant=variant)

    def _sample_start(self, key: PRNGKeyArray) -> GameState:
        """Draw an initial state in a game in one arena. The key is consumed."""
        if self.movers is None:
            return self.starts.sample(key, self.arena, self.bodies)
        robots_key, movers_key = jax.random.split(key)
        state = self.starts.sample(robots_key, self.arena, self.bodies)
        pairs = [zip(state.robots[role], self.bodies[role], strict=True) for role in ROLES]
        robots = [(robot, body.radius) for side in pairs for robot, body in side]
        room, dt = self.starts.clearance, self.dt
        return replace(state, movers=self.movers.sample(movers_key, self.arena, robots, room, dt))

    def at(self, state: _InArena) -> "Game":
        """Return the game that is played in a state: in its arena, between its robots."""
        return self if self.scenario is None else self.with_variant(state.variant)

    def with_variant(self, variant: Int[Array, ""] | None) -> "Game":
        """Return the game at one variant of its scenario."""
        scenario = self.scenario
        assert scenario is not None, "only a scenario has variants"
        assert variant is not None, "a state of a game in one of several arenas says in which"
        # A chart stays with all others: it is too large to copy.
        chart = self.chart and replace(self.chart, member=variant % scenario.count)
        single = replace(self, arena=scenario.arena(variant), scenario=None, chart=chart)
        if scenario.kinds is None:
            return single
        kind = jax.tree.map(lambda leaf: leaf[variant // scenario.count], scenario.kinds)
        teams = self.teams and replace(
            self.teams,
            pursuers=(kind.pursuer,) * len(self.teams.pursuers),
            evaders=(kind.evader,) * len(self.teams.evaders),
        )
        return replace(
            single,
            pursuer=kind.pursuer,
            evader=kind.evader,
            capture_distance=kind.capture_distance,
            teams=teams,
            sensors=kind.sensors or self.sensors,
            drives=kind.drives or self.drives,
        )

    def in_arena(self, arena: Arena) -> "Game":
        """Return the game in another arena, of which it has no chart."""
        return replace(self, arena=arena, scenario=None, chart=None)

    def packed(self) -> "Game":
        """Return the game with its arena's discs and polygons in arrays: one program plays it in
        many arenas. With movers it stays as it is: they look at all obstacles in every step, which
        is faster one by one.
        """
        return self if self.scenario or self.movers else replace(self, arena=pack(self.arena))

    def require_one_arena(self, caller: str) -> None:
        """Refuse a game in one of several arenas, for `caller` needs one; raises InvalidInput."""
        if self.scenario is not None:
            require(
                False, "arenas", self.scenario.size, f"one, which {caller} has to know beforehand"
            )

    def require_two(self, caller: str) -> None:
        """Refuse a game of teams, for `caller` knows two robots only; raises InvalidInput."""
        require(
            self.teams is None,
            "robots",
            self.size,
            f"1 v 1: {caller} knows games of two robots only",
        )

    def require_no_movers(self, caller: str) -> None:
        """Refuse a game with things that move by themselves, which `caller` does not know; raises
        InvalidInput.
        """
        bound = f"left out: {caller} does not know things that move by themselves"
        require(self.movers is None, "movers", "in the game", bound)

    def duel(self, caller: str) -> "Game":
        """Return the game between one robot of each team, for `caller` knows only two.

        Raises:
            InvalidInput: if the robots of a team differ.
        """
        alike = all(body == side[0] for side in self.bodies for body in side)
        require(
            alike,
            "robots",
            "of several kinds",
            f"alike on either side: {caller} knows one pursuer and one evader",
        )
        return replace(self, teams=None)

    def step(
        self, state: GameState, pursuer_action: SideAction, evader_action: SideAction
    ) -> Timestep:
        """Let all robots hold their actions for `dt` and judge the step.

        A team's actions are a list or tuple, one for each robot.
        """
        bodies, side_actions = self.at(state).bodies, BySide(pursuer_action, evader_action)

        def controls(role: Role) -> tuple[Controls, ...]:
            actions, count = side_actions[role], len(bodies[role])
            robot_actions = actions if isinstance(actions, list | tuple) else (actions,)
            require(
                len(robot_actions) == count,
                f"{role.name.lower()}_action",
                actions,
                f"{count} in number, one a robot",
            )
            pairs = zip(bodies[role], robot_actions, strict=True)
            return tuple(body.controls(as_action(action)) for body, action in pairs)

        return self.step_controls(state, ROLES.map(controls))

    def step_controls(self, state: GameState, controls: BySide[tuple[Controls, ...]]) -> Timestep:
        """Let the robots in play hold controls (u1 [m/s^2], u2 [rad/s]) for `dt`; judge the step.

        The state is one of a game that is not over.
        """
        game = self.at(state)

        def robots_after(role: Role) -> tuple[RobotState, ...]:
            robots = zip(game.bodies[role], state.robots[role], controls[role], strict=True)
            driven = tuple(body.move(robot, u1, u2, self.dt) for body, robot, (u1, u2) in robots)
            stopped = (replace(robot, v=jnp.zeros_like(robot.v)) for robot in state.robots[role])
            return tuple(map(tree_where, state.in_play[role], driven, stopped))

        movers_after = None
        if self.movers is not None:
            bound = "drawn by reset, as those of a game with movers are"
            require(state.movers is not None, "state", "without movers", bound)
            movers_after = self.movers.step(game.arena, state, game.bodies, self.dt)
        after = replace(
            state, robots=ROLES.map(robots_after), steps=state.steps + 1, movers=movers_after
        )
        outcome, status = judge(game, state, after)
        after = replace(after, status=status)
        chart = game.chart if self.reward.along_paths else None
        has_chart = chart is not None or not self.reward.along_paths
        bound = (
            "left out in a game without charts: apollonius.arenas.charting.with_chart draws them"
        )
        require(has_chart, "reward.along_paths", True, bound)
        out_of_time = outcome == Outcome.NO_RESULT
        truncated = out_of_time & (not self.reward.time_limit_wins)
        return Timestep(
            state=after,
            outcome=outcome,
            rewards=_rewards(self.reward, outcome, state, after, chart),
            terminated=(outcome != Outcome.ONGOING) & ~truncated,
            truncated=truncated,
        )


@fusion_barrier
def _rewards(
    reward: Reward,
    outcome: Int[Array, ""],
    before: GameState,
    after: GameState,
    chart: Chart | None,
) -> BySide[tuple[Scalar, ...]]:
    return reward(outcome, robot_events(before, after), nearest_distances(before, after, chart))


def reset_batch(game: Game, key: PRNGKeyArray, games: int) -> GameState:
    """Draw initial states of several games, leaves `[games]`. The key is consumed."""
    validation.require_key(key)
    return jax.vmap(game.reset)(jax.random.split(key, games))


def sample_starts(game: Game, key: PRNGKeyArray, games: int) -> GameState:
    """Draw the starts of `reset_batch` block by block.

    One compilation serves every number of games. Several arenas take turns (`Scenario.variant_of`).
    """

    def draw_block(first: int) -> GameState:
        return jax.device_get(_draw_block(game, key, np.uint32(first)))

    blocks = [draw_block(first) for first in range(0, games, _BLOCK)]
    return jax.device_put(jax.tree.map(lambda *leaves: np.concatenate(leaves)[:games], *blocks))


@jax.jit
def _draw_block(game: Game, key: PRNGKeyArray, first: UInt32[Array, ""]) -> GameState:
    # The i-th key that `split` makes is that of `fold_in` with i.
    index = first + jnp.arange(_BLOCK, dtype=jnp.uint32)

    def draw(number: UInt32[Array, ""]) -> GameState:
        start_key = jax.random.fold_in(key, number)
        if game.scenario is None:
            return game.reset(start_key)
        return game.reset_at(game.scenario.variant_of(number.astype(jnp.int32)), start_key)

    return jax.vmap(draw)(index)
