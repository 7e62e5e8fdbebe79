"""Manoeuvres in which a robot comes to rest, and the clearance that they keep."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from apollonius.game.arena import Arena
from apollonius.game.drive import limited_turn_rate
from apollonius.game.dynamics import Unicycle, unit_vector
from apollonius.game.game import Game
from apollonius.game.near_edges import NearEdges, near_edges
from apollonius.game.packed_arena import LENGTHS, PackedArena, pack, stacked_edges, without_edges
from apollonius.game.types import Action, Controls, Flag, Real, RobotState, Role, Scalar
from apollonius.game.uncertainty import Uncertainty
from apollonius.io.errors import require
from apollonius.observe.view import MoversInView, Robot, View

MARGIN = 1e-3
"""Clearance [m] that must be left at any scale of the robots: many times its rounding error."""
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
    def fastest(self) -> RobotState:
        """The state with the highest speed that the robot may have: it certainly rests if that
        is 0.
        """
        if self.uncertainty is None:
            return self.state
        return replace(self.state, v=self.state.v + self.uncertainty.speed)

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
        may_reverse: whether robots drive backwards, too, and then brake by speeding up.
        movers: those in the view, once `for_view` has looked at it.
    """

    arena: Arena
    dt: Real
    steps: int = eqx.field(static=True)
    manoeuvres: tuple[int, ...] = eqx.field(static=True, default=BRAKING)
    surroundings: NearEdges | None = None
    uses_arena_of_view: bool = eqx.field(static=True, default=False)
    most_error: Real | None = None
    may_reverse: bool = eqx.field(static=True, default=False)
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
        step = self._clearance_along(before.fastest, after.fastest, 0.0) - robot.body.radius
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
        if self.may_reverse:
            length = jnp.sign(after.v) * length
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
            return after, [(motion.fastest, motion.error) for motion in after]

        ends, paths = jax.lax.scan(one_step, [motion] * len(self.manoeuvres), length=self.steps)
        after, errors = jax.tree.map(lambda *leaves: jnp.stack(leaves), *paths)

        def shift(first: Array, later: Array) -> Array:
            firsts = jnp.broadcast_to(first, (len(later), 1))
            return jnp.concatenate([firsts, later[:, :-1]], axis=1)

        before = jax.tree.map(shift, motion.fastest, after)
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
        starts some time [s] after the action takes effect. Speeds are the highest possible ones.
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
        pairs = zip(motions, self.manoeuvres, strict=True)
        return [
            self._hold(robot, motion, self._braking_action(robot.body, motion.state.v, manoeuvre))
            for motion, manoeuvre in pairs
        ]

    def _braking_action(self, body: Unicycle, v: Scalar, manoeuvre: int) -> Action:
        """Return the action of a manoeuvre, which slows the robot down or keeps it at rest."""
        action = jnp.full((), manoeuvre, jnp.int32)
        if not self.may_reverse:
            return action
        return action + 3 * (1 + body.braking_level(v).astype(jnp.int32))

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
    is_uncertain = is_uncertain or game.uncertainty_of(role) is not None
    for body in bodies:
        bound = "at most 0 and more than 0: of a robot that can stop, as it does when it brakes"
        require(body.brakes_to_rest, "v_min, u1_max", (body.v_min, body.u1_max), bound)
        bound = "0 m/s: a robot that is uncertain of itself must not drive backwards"
        require(body.v_min == 0 or not is_uncertain, "v_min", body.v_min, bound)
    longer = _LONGER if is_uncertain else 1
    steps = longer * max(int(steps_to_rest(body, game.dt)) for body in bodies)
    most_error = min(map(_stopping_distance, bodies)) if is_uncertain else None
    surroundings = _surroundings(game, bodies, most_error or 0.0)
    arena = pack(replace(game.arena, polygons=()) if surroundings else game.arena)
    uses_arena_of_view = game.scenario is not None
    return Backup(
        arena,
        game.dt,
        steps,
        BRAKING,
        surroundings,
        uses_arena_of_view,
        most_error,
        may_reverse=any(body.v_min < 0 for body in bodies),
    )


def steps_to_rest(body: Unicycle, dt: Real) -> Int[Array, ""]:
    """Return the number of steps of `dt` [s] after which a robot that brakes certainly rests.

    It is one more than the top speed takes, as rounding may leave some 1e-6 m/s, and movers count
    until a robot rests.
    """
    top_speed = jnp.maximum(body.v_max, -body.v_min)
    return jnp.ceil(top_speed / (body.u1_max * dt)).astype(jnp.int32) + 1


def _stopping_distance(body: Unicycle) -> Real:
    """Return the way of a robot that brakes from its top speed [m]."""
    return body.top_speed**2 / (2 * body.u1_max)


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
    reach = max(body.radius + body.top_speed * game.dt / 2 for body in bodies) + 2 * MARGIN
    return edges and near_edges(edges, walls, float(reach + most_error))
