"""Both states, encoded for a network: no jump where a heading wraps, and clearances."""

from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.types import Scalar
from apollonius.observe.observation import AbstractObservation, clearances_ahead, position_and_speed, turned
from apollonius.observe.view import View


@dataclass(frozen=True)
class Encoded(AbstractObservation):
    """Seventeen numbers.

    Of each robot x, y, v mapped from their limits to [-1, 1] and the cosine and sine of its heading (10); the
    opponent's position ahead of and to the left of the robot itself, and its distance, over the arena's longer side
    (3); of each robot the clearance [m] where it stands and where it would come to rest if it braked straight ahead,
    clipped to [-1, 1] (4).
    """

    name = "encoded"
    size = 17

    def __call__(self, view: View) -> Float[Array, "17"]:
        arena, own, opponent = view.arena, view.own.state, view.opponent.state
        parts: list[Scalar] = []
        directions = [turned(robot.state.heading) for robot in view.robots]
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
