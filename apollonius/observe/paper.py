"""Observations in the arena's frame: the paper's (Eq. 6, 7), and another encoding of the same for a
network.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.arena import Arena
from apollonius.game.types import Scalar
from apollonius.observe.observation import AbstractObservation, clearances_ahead, cos_sin, rescale
from apollonius.observe.view import Robot, View


def position_and_speed(arena: Arena, robot: Robot) -> list[Scalar]:
    """Return a robot's x, y and v, mapped from their limits to [-1, 1]."""
    body, state = robot.body, robot.state
    return [
        rescale(state.x, arena.x_min, arena.x_max),
        rescale(state.y, arena.y_min, arena.y_max),
        rescale(state.v, body.v_min, body.v_max),
    ]


class Paper(AbstractObservation):
    """x, y, v, heading of the robot itself, then of its opponent (Eq. 7).

    Positions and speeds are mapped linearly from their limits to [-1, 1], headings are divided by
    pi.
    """

    name = "paper"
    size = 8

    def __call__(self, view: View) -> Float[Array, "8"]:
        return jnp.stack(
            [
                number
                for robot in view.robots
                for number in (*position_and_speed(view.arena, robot), robot.state.heading / jnp.pi)
            ]
        )


PAPER = Paper()


class Encoded(AbstractObservation):
    """Seventeen numbers: no jump where a heading wraps, and clearances.

    Of each robot x, y, v mapped from their limits to [-1, 1] and the cosine and sine of its heading
    (10); the opponent's position ahead of and to the left of the robot itself, and its distance,
    over the arena's longer side (3); of each robot the clearance [m] where it stands and where it
    would come to rest if it braked straight ahead, clipped to [-1, 1] (4).
    """

    name = "encoded"
    size = 17

    def __call__(self, view: View) -> Float[Array, "17"]:
        arena = view.arena
        own = view.own.state
        opponent = view.opponent.state
        parts: list[Scalar] = []
        directions = [cos_sin(robot.state.heading) for robot in view.robots]
        for robot, direction in zip(view.robots, directions, strict=True):
            parts += [*position_and_speed(arena, robot), *direction]
        size = jnp.maximum(arena.x_max - arena.x_min, arena.y_max - arena.y_min)
        dx, dy = (opponent.x - own.x) / size, (opponent.y - own.y) / size
        cos, sin = directions[0]
        parts += [cos * dx + sin * dy, cos * dy - sin * dx, jnp.hypot(dx, dy)]
        for robot, direction in zip(view.robots, directions, strict=True):
            parts += clearances_ahead(arena, robot, *direction)
        return jnp.stack(parts)


ENCODED = Encoded()
