"""Players that chase by a law of guidance, pure pursuit or constant bearing, that flee, or that
guard a territory.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.classical import AbstractClassical, AbstractSteering, direction
from apollonius.game.dynamics import Unicycle, wrap_angle
from apollonius.game.game import Game
from apollonius.game.teams import separation
from apollonius.game.types import NUM_ACTIONS, Real, RobotState, Role, Scalar
from apollonius.observe.view import View


class PurePursuit(AbstractSteering):
    """Heads for where the opponent is (Bouguer's curve of pursuit, 1732), as fast as the way there
    can be driven.

    The way there is the arc of Coulter, "Implementation of the Pure Pursuit Path Tracking
    Algorithm" (1992).
    """

    def course(self, view: View) -> tuple[Scalar, Scalar]:
        own, opponent = view.own.state, view.opponent.state
        return direction(own, opponent), arc_speed(view.own.body, own, opponent)


class Intercept(AbstractSteering):
    """Heads for where both could be at the same time, if the opponent kept its velocity: constant
    bearing.

    That is the point where the opponent's course meets the circle of Apollonius, the places that
    both reach at the same time (Isaacs, "Differential Games", 1965): there the pursuer, at its top
    speed, keeps abreast of the opponent's motion across the line of sight. An opponent that crosses
    faster than that is led by a right angle.
    """

    def course(self, view: View) -> tuple[Scalar, Scalar]:
        body = view.own.body
        own = view.own.state
        opponent = view.opponent.state
        sight = direction(own, opponent)
        across = opponent.v * jnp.sin(opponent.heading - sight)
        lead = jnp.arcsin(jnp.clip(across / body.v_max, -1.0, 1.0))
        return sight + lead, arc_speed(body, own, opponent)


def arc_speed(body: Unicycle, robot: RobotState, target: RobotState) -> Scalar:
    """Return the highest speed [m/s] at which a robot can drive the arc from where it is, and
    heads, to a target.

    The arc has the radius `distance / (2 sin(angle off the heading))`, and what is behind takes
    half the distance: a robot faster than that runs around its target for ever.
    """
    angle = jnp.abs(wrap_angle(direction(robot, target) - robot.heading))
    sine = jnp.sin(jnp.minimum(angle, jnp.pi / 2))
    return body.fastest_on_arc(separation(robot, target) / jnp.maximum(2 * sine, 1e-6))


_HORIZON = 4.0
"""Time that a fleeing robot looks ahead [s]: the paper's needs as long to stop from its top speed.
"""
_MARGIN = 0.1
"""Least clearance of a way [m], on the scale of the paper's robots."""
_WIDE = 1.0
"""Clearance [m] up to which a metre of it is worth a metre of distance, on the scale of the paper's
robots; beyond it more is worth nothing."""


class _Escape(NamedTuple):
    """A robot's state on a trial, least clearance so far [m], and steps with enough of it."""

    robot: RobotState
    clearance: Scalar
    clear_steps: Scalar


class Flee(AbstractSteering):
    """Moves in the direction furthest from the pursuer: the heuristic evader of the paper's
    reference [13].

    Egorov, "Multi-Agent Deep Reinforcement Learning" (2016). It minds neither walls nor obstacles.
    """

    def course(self, view: View) -> tuple[Scalar, Scalar]:
        speed = jnp.asarray(view.own.body.v_max, jnp.float32)
        return direction(view.opponent.state, view.own.state), speed


class FleeAware(AbstractClassical):
    """Moves to where it will be furthest from the pursuer, among the ways that touch neither wall
    nor obstacle.

    The dynamic window approach (Fox, Burgard and Thrun, 1997): each action is tried for 4 s ahead,
    and judged by the distance from the pursuer there, which is taken to go straight on, and by its
    least clearance on the way.
    """

    def values(self, view: View) -> Float[Array, "9"]:
        """Return distance and clearance in metres; where that runs out, how late, below all ways on
        which it lasts.
        """
        coast, body = jnp.zeros(()), view.own.body
        steps = jnp.ceil(_HORIZON / jnp.asarray(view.dt, jnp.float32))
        pursuer = view.opponent.body.move(view.opponent.state, coast, coast, steps * view.dt)

        def value(action: Int[Array, ""]) -> Scalar:
            def one_step(_: Int[Array, ""], escape: _Escape) -> _Escape:
                after = body.move(escape.robot, *body.controls(action), view.dt)
                along = view.arena.clearance_along(escape.robot, after) - body.radius
                clearance = jnp.minimum(escape.clearance, along)
                is_clear = (clearance > _MARGIN).astype(jnp.float32)
                return _Escape(after, clearance, escape.clear_steps + is_clear)

            start = _Escape(view.own.state, jnp.asarray(jnp.inf, jnp.float32), jnp.zeros(()))
            end = jax.lax.fori_loop(0, steps.astype(jnp.int32), one_step, start)
            value_if_clear = separation(end.robot, pursuer) + jnp.minimum(end.clearance, _WIDE)
            missing_steps = end.clear_steps - steps
            return jnp.where(end.clearance > _MARGIN, value_if_clear, missing_steps)

        return jax.vmap(value)(jnp.arange(NUM_ACTIONS))


_EQUAL = 1e-3
"""Squares of speeds that differ by less than this share are equal: the circle of Apollonius is then
a line.
"""


def nearest_reach(
    evader: tuple[Scalar, Scalar],
    pursuer: tuple[Scalar, Scalar],
    ratio: Real,
    goal: tuple[Scalar, Scalar],
) -> tuple[Scalar, Scalar]:
    """Return the point nearest to a goal that the evader can reach before the pursuer [m].

    Both can turn at once, and nothing stands in their way. Then these places are bounded by the
    circle of Apollonius, where the evader's distance is `ratio` times the pursuer's: they are
    inside where the evader is slower, outside where it is faster, and on its side of the
    perpendicular bisector where both are equally fast. The evader comes no nearer to the goal than
    that place if the pursuer heads for it, and the pursuer cannot keep it further away: it is the
    solution of the target-guarding problem (Isaacs, "Differential Games", 1965, example 1.9.2).

    Args:
        evader, pursuer: their positions x, y [m].
        ratio: the evader's speed over the pursuer's.
        goal: the goal's position x, y [m].
    """
    ex, ey = evader
    px, py = pursuer
    gx, gy = goal
    square = jnp.asarray(ratio, jnp.float32) ** 2
    to_goal = (gx - ex) ** 2 + (gy - ey) ** 2
    within = to_goal < square * ((gx - px) ** 2 + (gy - py) ** 2)
    # The perpendicular bisector: the goal, moved along the line of sight as far as it is on the
    # pursuer's side.
    sight_x, sight_y = px - ex, py - ey
    sight_squared = jnp.maximum(sight_x**2 + sight_y**2, 1e-9)
    beyond = ((gx - (ex + px) / 2) * sight_x + (gy - (ey + py) / 2) * sight_y) / sight_squared
    line = gx - beyond * sight_x, gy - beyond * sight_y
    # The circle: the goal, moved to it towards its centre or away from it.
    equal = jnp.abs(1 - square) < _EQUAL
    rest = jnp.where(equal, 1.0, 1 - square)
    centre_x, centre_y = (ex - square * px) / rest, (ey - square * py) / rest
    radius = jnp.sqrt(square * sight_squared) / jnp.abs(rest)
    out_x, out_y = gx - centre_x, gy - centre_y
    scale = radius / jnp.maximum(jnp.hypot(out_x, out_y), 1e-6)
    circle = centre_x + scale * out_x, centre_y + scale * out_y
    pairs = zip(line, circle, strict=True)
    x, y = (jnp.where(equal, on_line, on_circle) for on_line, on_circle in pairs)
    return jnp.where(within, gx, x), jnp.where(within, gy, y)


class Territory(AbstractSteering):
    """Heads for the place of the evader's reach that is nearest to the territory's middle: the best
    for either side.

    See `nearest_reach`. It is a rule of thumb for robots that take time to turn and to speed up,
    and minds neither walls nor obstacles. The evader heads for the middle itself once that is
    within its reach; the pursuer guards.
    """

    guards: bool = eqx.field(static=True, default=True)
    misfit = (
        "arena.territory",
        "none",
        "a disc for 'territory' to guard or to reach, as in the game called territory",
    )

    @classmethod
    def fits(cls, game: Game) -> bool:
        return game.arena.territory is not None

    @classmethod
    def for_side(cls, game: Game, role: Role, **rule: Any) -> AbstractClassical:
        return super().for_side(game, role, guards=role == Role.PURSUER, **rule)

    def course(self, view: View) -> tuple[Scalar, Scalar]:
        goal, own = view.arena.territory, view.own.state
        assert goal is not None, "it fits the game"
        ends = [((robot.state.x, robot.state.y), robot.body.v_max) for robot in view.robots]
        (pursuer, fast), (evader, slow) = ends if self.guards else ends[::-1]
        x, y = nearest_reach(
            evader, pursuer, slow / fast, (jnp.float32(goal.x), jnp.float32(goal.y))
        )
        target = RobotState(x, y, own.v, own.heading)
        return direction(own, target), arc_speed(view.own.body, own, target)
