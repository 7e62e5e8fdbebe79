"""The player that guards a territory, or would reach it: by where the evader's reach comes nearest to it."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp

from apollonius.agents.chasing import arc_speed
from apollonius.agents.classical import AbstractClassical, AbstractSteering, direction
from apollonius.game.game import Game
from apollonius.game.types import Real, RobotState, Role, Scalar
from apollonius.observe.view import View

_EQUAL = 1e-3
"""Squares of speeds that differ by less than this share are equal: the circle of Apollonius is then a line."""


def nearest_reach(
    evader: tuple[Scalar, Scalar], pursuer: tuple[Scalar, Scalar], ratio: Real, goal: tuple[Scalar, Scalar]
) -> tuple[Scalar, Scalar]:
    """Return the point nearest to a goal that the evader can reach before the pursuer [m].

    Both can turn at once, and nothing stands in their way. Then these places are bounded by the circle of Apollonius,
    where the evader's distance is `ratio` times the pursuer's: they are inside where the evader is slower, outside
    where it is faster, and on its side of the perpendicular bisector where both are equally fast. The evader comes no
    nearer to the goal than that place if the pursuer heads for it, and the pursuer cannot keep it further away: it is
    the solution of the target-guarding problem (Isaacs, "Differential Games", 1965, example 1.9.2).
    """
    (ex, ey), (px, py), (gx, gy) = evader, pursuer, goal
    square = jnp.asarray(ratio, jnp.float32) ** 2
    to_goal = (gx - ex) ** 2 + (gy - ey) ** 2
    within = to_goal < square * ((gx - px) ** 2 + (gy - py) ** 2)
    # The perpendicular bisector: the goal, moved along the line of sight as far as it is on the pursuer's side.
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
    x, y = (jnp.where(equal, on_line, on_circle) for on_line, on_circle in zip(line, circle, strict=True))
    return jnp.where(within, gx, x), jnp.where(within, gy, y)


class Territory(AbstractSteering):
    """Heads for the place of the evader's reach that is nearest to the territory's middle: the best for either side.

    See `nearest_reach`. It is a rule of thumb for robots that take time to turn and to speed up, and minds neither
    walls nor obstacles. The evader heads for the middle itself once that is within its reach.

    Attributes:
        guards: whether it is the pursuer.
    """

    guards: bool = eqx.field(static=True, default=True)
    misfit = "arena.territory", "none", "a disc for 'territory' to guard or to reach, as in the game called territory"

    @classmethod
    def fits(cls, game: Game) -> bool:
        return game.arena.territory is not None

    @classmethod
    def for_side(cls, game: Game, role: Role, **rule: Any) -> AbstractClassical:
        return super().for_side(game, role, guards=role == Role.PURSUER, **rule)

    def course(self, seen: View) -> tuple[Scalar, Scalar]:
        goal, own = seen.arena.territory, seen.own.state
        assert goal is not None, "it fits the game"
        ends = [((robot.state.x, robot.state.y), robot.body.v_max) for robot in seen.robots]
        (pursuer, fast), (evader, slow) = ends if self.guards else ends[::-1]
        x, y = nearest_reach(evader, pursuer, slow / fast, (jnp.float32(goal.x), jnp.float32(goal.y)))
        target = RobotState(x, y, own.v, own.heading)
        return direction(own, target), arc_speed(seen.own.body, own, target)
