"""A player that does not crash: another's actions, unless they leave no way to stop in time."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.game.arena import Arena
from apollonius.game.drive import limited_turn_rate
from apollonius.game.dynamics import Unicycle, action_levels, unit_vector
from apollonius.game.game import Game
from apollonius.game.near_edges import NearEdges, near_edges
from apollonius.game.packed_arena import LENGTHS, PackedArena, pack, stacked_edges, without_edges
from apollonius.game.types import (
    NUM_ACTIONS,
    Action,
    Controls,
    Flag,
    RandomBits,
    Real,
    RobotState,
    Role,
    Scalar,
)
from apollonius.game.uncertainty import Uncertainty
from apollonius.io.errors import require
from apollonius.observe.view import MoversInView, Robot, View

MARGIN = 1e-3
"""Clearance [m] that must be left at any scale of the robots: many times its rounding error."""
_NO_MANOEUVRE = -1
_NOT_OVER = -1e6
"""Clearance [m] of a stop that is not certainly over."""
_LONGER = 2
"""Times as many steps as braking takes, in which a robot that is uncertain of itself has to come to
rest.
"""
BRAKING = (0, 1, 2)
"""Actions that brake: while turning right, going straight, or turning left."""


class BrakingMotion(eqx.Module):
    """A robot on a manoeuvre: its state and, with a slow drive, its turn rate [rad/s]. Of one that
    is uncertain of these, the bounds of its errors and its latest command, u1 [m/s^2] and
    u2 [rad/s].
    """

    state: RobotState
    turn_rate: Scalar | None
    uncertainty: Uncertainty | None = None
    command: Controls | None = None

    @classmethod
    def of(cls, robot: Robot) -> "BrakingMotion":
        """Return a robot when a command that is given now takes effect."""
        motion = cls(robot.predicted, robot.turn_rate)
        if robot.uncertainty is None:
            return motion
        no_command = jnp.zeros(()), jnp.zeros(())
        return replace(motion, uncertainty=robot.uncertainty, command=robot.command or no_command)

    @property
    def error(self) -> Real | None:
        """The largest distance of the true place from the known one [m], if there is any."""
        return self.uncertainty and self.uncertainty.position

    def is_over(self, most_error: Real) -> Flag:
        """Check whether the robot has certainly come to rest, and within an error of its place."""
        assert self.uncertainty is not None, "else it knows"
        is_at_rest = (self.state.v <= 0) & (self.uncertainty.speed <= 0)
        return is_at_rest & (self.uncertainty.position <= most_error)


class Backup(eqx.Module):
    """Manoeuvres in which a robot comes to rest, played by the rules' own dynamics and contact.

    Attributes:
        arena, dt: where the manoeuvres are tried, and for how long an action is held [s].
        steps: how many steps they last.
        manoeuvres: the braking action that each holds to the end.
        surroundings: the polygons, which `arena` then lacks, by the edges near each step; None:
            every edge is looked at.
        uses_arena_of_view: whether the arena of the view is used, as it differs from state to
            state.
        most_error: the largest distance of the true place of a robot that is uncertain of itself
            from the known one [m], beyond which no stop is safe; None for one that is certain.
        movers: those in the view, once `for_view` has looked at it.
    """

    arena: Arena
    dt: Real
    steps: int = eqx.field(static=True)
    manoeuvres: tuple[int, ...] = eqx.field(static=True, default=BRAKING)
    surroundings: NearEdges | None = None
    uses_arena_of_view: bool = eqx.field(static=True, default=False)
    most_error: Real | None = None
    movers: MoversInView | None = None

    @property
    def is_uncertain(self) -> bool:
        """Check whether the robot is uncertain of itself."""
        return self.most_error is not None

    def for_view(self, view: View) -> "Backup":
        """Return the manoeuvres of the robot that sees this."""
        arena = view.arena
        backup = self if view.movers is None else replace(self, movers=view.movers)
        if not self.uses_arena_of_view:
            return backup
        if self.surroundings is None or not isinstance(arena, PackedArena):
            return replace(backup, arena=arena)
        surroundings = replace(self.surroundings, member=arena.member)
        return replace(backup, arena=without_edges(arena), surroundings=surroundings)

    @jax.jit
    def clearance_after(self, robot: Robot, action: Action) -> Scalar:
        """Return the least clearance [m] of the best stop after one step of an action.

        It is the least on the path from when the action takes effect until rest, less the body's
        radius, for the best of the manoeuvres; of movers, from all that they can reach by then.
        Where the robot is uncertain of itself, it is less by the largest distance of its true place
        from that path. Of the `surroundings` only those within reach are looked at; that only
        changes clearances above `MARGIN`.
        """
        return jnp.max(self.clearances_after(robot, action))

    def clearances_after(self, robot: Robot, action: Action) -> Float[Array, " manoeuvres"]:
        """Return the least clearance [m] of each stop after one step of an action."""
        before = BrakingMotion.of(robot)
        after = self._hold(robot, before, action)
        step = self._clearance_along(before.state, after.state, 0.0) - robot.body.radius
        if after.error is not None:
            step -= after.error
        return jnp.minimum(step, self._clearances(robot, after))

    @jax.jit
    def can_stop_straight(self, robot: Robot, action: Action) -> Flag:
        """Check by one segment whether braking straight ahead after an action is certainly safe.

        As one segment the path takes little arithmetic. It must leave twice the `MARGIN`, once for
        rounding.
        """
        by_steps = self.arena.map is not None or self.surroundings is not None or self.movers
        if by_steps or robot.turn_time is not None or robot.uncertainty:
            # Clearances on maps depend on where a segment is cut, edges are looked up step by step,
            # a slow drive keeps turning, and errors and the reach of movers grow from step to step.
            return replace(self, manoeuvres=(1,)).clearance_after(robot, action) > MARGIN
        before = BrakingMotion(robot.predicted, None)
        after = self._hold(robot, before, action).state
        (cos, sin), length = unit_vector(after.heading), after.v**2 / (2 * robot.body.u1_max)
        rest = replace(after, x=after.x + length * cos, y=after.y + length * sin)
        least = jnp.minimum(
            self._clearance_along(before.state, after, 0.0),
            self._clearance_along(after, rest, self.dt),
        )
        return least - robot.body.radius > 2 * MARGIN

    def _clearances(self, robot: Robot, motion: BrakingMotion) -> Float[Array, " manoeuvres"]:
        def one_step(
            before: list[BrakingMotion], _: None
        ) -> tuple[list[BrakingMotion], list[tuple[RobotState, Real | None]]]:
            after = self._brake(robot, before)
            return after, [(motion.state, motion.error) for motion in after]

        ends, paths = jax.lax.scan(one_step, [motion] * len(self.manoeuvres), length=self.steps)
        after, errors = jax.tree.map(lambda *leaves: jnp.stack(leaves), *paths)

        def shift(first: Array, later: Array) -> Array:
            firsts = jnp.broadcast_to(first, (len(later), 1))
            return jnp.concatenate([firsts, later[:, :-1]], axis=1)

        before = jax.tree.map(shift, motion.state, after)
        times = self.dt * jnp.arange(1, self.steps + 1, dtype=jnp.float32)
        along_steps = jax.vmap(self._clearance_along)
        along = jax.vmap(along_steps, (0, 0, None))(before, after, times)
        if self.most_error is None:
            return jnp.min(along, axis=1) - robot.body.radius
        clearances = jnp.min(along - errors, axis=1) - robot.body.radius
        is_safe = jnp.stack([end.is_over(self.most_error) for end in ends])
        return jnp.where(is_safe, clearances, _NOT_OVER)

    def _clearance_along(self, before: RobotState, after: RobotState, time: Real) -> Scalar:
        """Return the least clearance [m] from the arena, its surroundings and movers on a step that
        starts some time [s] after the action takes effect.
        """
        clearance = self.arena.clearance_along(before, after)
        if self.movers is not None:
            to_movers = self.movers.clearance_along(before, after, time, self.dt)
            clearance = jnp.minimum(clearance, to_movers)
        if self.surroundings is None:
            return clearance
        return jnp.minimum(clearance, self.surroundings.clearance_along(before, after))

    def _brake(self, robot: Robot, motions: list[BrakingMotion]) -> list[BrakingMotion]:
        """Return the motion in each manoeuvre after one more step."""
        actions = [jnp.full((), action, jnp.int32) for action in self.manoeuvres]
        pairs = zip(motions, actions, strict=True)
        return [self._hold(robot, motion, action) for motion, action in pairs]

    def _hold(self, robot: Robot, motion: BrakingMotion, action: Action) -> BrakingMotion:
        u1, u2 = robot.body.controls(action)
        mean, rate = limited_turn_rate(robot.body, robot.turn_time, motion.turn_rate, u2, self.dt)
        after = robot.body.move(motion.state, u1, mean, self.dt)
        if motion.uncertainty is None:
            return BrakingMotion(after, rate)
        assert motion.command is not None, "it has one where it is uncertain"
        uncertainty = motion.uncertainty.after_switch(motion.command, (u1, u2))
        uncertainty = uncertainty.after_motion(robot.body, motion.state, after, (u1, u2), self.dt)
        return BrakingMotion(after, rate, uncertainty, (u1, u2))


class Shielded(AbstractWrapper[AbstractPolicy]):
    """Another player, held back from actions after which the robot could not brake to rest without
    touching anything.

    An action is allowed where, after it, one of the backup manoeuvres comes to rest with clearance
    to spare. The rest of that manoeuvre is then allowed in the next step, and so on; so from rest,
    or from any state from which one of the manoeuvres is free, the robot never fails. This is a
    safety filter with backup manoeuvres (Hobbs et al., "Runtime assurance for safety-critical
    systems", 2023): what it calls safe is a part of the viability kernel.

    A robot that is uncertain of itself keeps farther away by the largest distance between its true
    path and the one that it knows. What it knows in the next step may be worse by chance.
    Where no action is allowed then, it continues the manoeuvre that was safe.

    A player with continuous actions keeps its own where that is allowed, and otherwise has the
    allowed discrete action nearest to it.
    """

    backup: Backup

    @property
    def memory(self) -> Memory:
        """The memory of the player and, of a robot that is uncertain of itself, the last manoeuvre
        that was safe; `_NO_MANOEUVRE` before there is one.
        """
        if not self.backup.is_uncertain:
            return self.policy.memory
        return self.policy.memory, jnp.int32(_NO_MANOEUVRE)

    def __call__(self, view: View, memory: Memory, bits: RandomBits) -> tuple[Action, Memory]:
        own_memory, last_safe = memory if self.backup.is_uncertain else (memory, None)
        scores, own_memory = self.score_view(view, own_memory, bits)
        search = jax.lax.while_loop(
            lambda search: search.is_open,
            lambda search: self.try_next(view, scores, search),
            self.start_search(view, scores),
        )
        if last_safe is None:
            return search.action, own_memory
        action, manoeuvre = self.continue_unless_safe(view, search.action, last_safe)
        return action, (own_memory, manoeuvre)

    def continue_unless_safe(
        self, view: View, action: Action, last_safe: Int[Array, ""]
    ) -> tuple[Action, Int[Array, ""]]:
        """Return an action that is safe; otherwise that of the last safe manoeuvre, and without one
        the action itself. The second value is the manoeuvre that is safe now.

        Args:
            view: what the robot sees.
            action: the one that the search for an allowed one ended with.
            last_safe: the last safe manoeuvre; `_NO_MANOEUVRE` before the first.
        """
        backup = self.backup.for_view(view)
        clearances = backup.clearances_after(view.own, action)
        is_safe = jnp.max(clearances) > MARGIN
        braking = jnp.asarray(backup.manoeuvres, jnp.int32)[jnp.maximum(last_safe, 0)]
        braking_action = jnp.stack(action_levels(braking)) if self.policy.continuous else braking
        continues = ~is_safe & (last_safe != _NO_MANOEUVRE)
        safe = jnp.where(is_safe, jnp.argmax(clearances), last_safe).astype(jnp.int32)
        return jnp.where(continues, braking_action, action), safe

    def promises(self, view: View) -> Flag:
        """Check whether the robot certainly never fails from here on: whether some action leaves a
        safe stop.
        """
        backup = self.backup.for_view(view)
        actions = jnp.arange(NUM_ACTIONS)
        clearances = jax.vmap(backup.clearance_after, (None, 0))(view.own, actions)
        return jnp.max(clearances) > MARGIN

    def preferred_action(self, scores: Any) -> Action:
        """Return the action of the player behind the shield."""
        if self.policy.continuous:
            return scores
        return self.policy.select(scores, jnp.ones(NUM_ACTIONS, bool))

    def start_search(self, view: View, scores: Any) -> "_Search":
        """Start the search for an allowed action; it ends at once where the own one surely is."""
        action = self.preferred_action(scores)
        number = jnp.full((), NUM_ACTIONS, jnp.int32) if self.policy.continuous else action
        is_open = ~self.backup.for_view(view).can_stop_straight(view.own, action)
        return _Search(action, number, jnp.full(NUM_ACTIONS, jnp.inf), is_open)

    def try_next(self, view: View, scores: Any, search: "_Search") -> "_Search":
        """Try the search's action; unless it is allowed, the best untried one comes next."""
        clearance = self.backup.for_view(view).clearance_after(view.own, search.action)
        allowed = clearance > MARGIN
        clearances = jnp.where(
            jnp.arange(NUM_ACTIONS) == search.number, clearance, search.clearances
        )
        untried = jnp.isinf(clearances)
        some_untried = jnp.any(untried)
        number = jnp.where(
            some_untried, self.policy.select(scores, untried), jnp.argmax(clearances)
        ).astype(jnp.int32)
        action = jnp.stack(action_levels(number)) if self.policy.continuous else number
        return _Search(
            jnp.where(allowed, search.action, action), number, clearances, ~allowed & some_untried
        )


class _Search(eqx.Module):
    """A search for an allowed action.

    Attributes:
        action: the one to try next or, at the end, to take.
        number: its index; `NUM_ACTIONS` for a player's own continuous action.
        clearances: clearance that each of the nine actions leaves [m]; infinite until it is tried.
        is_open: whether an action is still to be tried.
    """

    action: Action
    number: Int[Array, ""]
    clearances: Float[Array, "9"]
    is_open: Flag


def brakes(game: Game, role: Role, is_uncertain: bool = False) -> Backup:
    """Return full braking in three directions.

    Args:
        game: the rules.
        role: the side whose robots brake.
        is_uncertain: whether they are uncertain of themselves, as they are where the game says so.

    Raises:
        InvalidInput: where one of the robots does not come to rest by braking.
    """
    kinds = game.scenario.kinds if game.scenario else None
    bodies = game.bodies[role] if kinds is None else kinds.every(role)
    for body in bodies:
        bound = "0 and more than 0: of a robot that can stop, as it does when it brakes"
        require(body.brakes_to_rest, "v_min, u1_max", (body.v_min, body.u1_max), bound)
    is_uncertain = is_uncertain or game.uncertainty_of(role) is not None
    longer = _LONGER if is_uncertain else 1
    steps = longer * max(ceil(body.v_max / (body.u1_max * game.dt)) for body in bodies)
    most_error = min(map(_stopping_distance, bodies)) if is_uncertain else None
    surroundings = _surroundings(game, bodies, most_error or 0.0)
    arena = pack(replace(game.arena, polygons=()) if surroundings else game.arena)
    uses_arena_of_view = game.scenario is not None
    return Backup(arena, game.dt, steps, BRAKING, surroundings, uses_arena_of_view, most_error)


def _stopping_distance(body: Unicycle) -> Real:
    """Return the way of a robot that brakes from its top speed [m]."""
    return body.v_max**2 / (2 * body.u1_max)


def _surroundings(game: Game, bodies: Sequence[Unicycle], most_error: Real) -> NearEdges | None:
    """Index the polygons near any step of a robot; None without any, or if they are traced.

    Args:
        game: the rules.
        bodies: the limits of the robots.
        most_error: the largest distance of a robot's true place from the known one [m].
    """
    walls = game.arena if game.scenario is None else game.scenario.arenas
    shapes = game.arena.polygons if game.scenario is None else game.scenario.bounds
    numbers = (shapes, walls.x_min, walls.x_max, walls.y_min, walls.y_max, list(bodies), game.dt)
    if not shapes or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(numbers)):
        return None
    edges = game.scenario.edges if game.scenario else stacked_edges([game.arena], LENGTHS)
    reach = max(body.radius + body.v_max * game.dt / 2 for body in bodies) + 2 * MARGIN
    return edges and near_edges(edges, walls, float(reach + most_error))


def with_shield(
    policy: AbstractPolicy, game: Game, role: Role, is_uncertain: bool = False
) -> Shielded:
    """Put a player behind a shield, which replaces actions after which it could not brake in time.

    Args:
        policy: the player.
        game: the rules.
        role: its side.
        is_uncertain: whether its robot is uncertain of itself, as it is where the game says so.

    Raises:
        InvalidInput: if a robot of the side cannot brake to rest.
    """
    return Shielded(policy, brakes(game, role, is_uncertain))
