"""Both states, encoded for a network: no jump where a heading wraps, and clearances."""

from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.arena import Arena
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.types import Scalar
from apollonius.observe.observation import AbstractObservation, position_and_speed
from apollonius.observe.view import Robot, View


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
        directions = [_turned(robot.state.heading) for robot in view.robots]
        for robot, direction in zip(view.robots, directions, strict=True):
            parts += [*position_and_speed(arena, robot), *direction]
        size = jnp.maximum(arena.x_max - arena.x_min, arena.y_max - arena.y_min)
        dx, dy = (opponent.x - own.x) / size, (opponent.y - own.y) / size
        cos, sin = directions[0]
        parts += [cos * dx + sin * dy, cos * dy - sin * dx, jnp.hypot(dx, dy)]
        for robot, direction in zip(view.robots, directions, strict=True):
            parts += _clearances(arena, robot, *direction)
        return jnp.stack(parts)


@fusion_barrier
def _turned(heading: Scalar) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of a heading, which several numbers share."""
    return jnp.cos(heading), jnp.sin(heading)


def _clearances(arena: Arena, robot: Robot, cos: Scalar, sin: Scalar) -> list[Scalar]:
    """Return the clearance [m] of the body here, and at the point where braking straight ahead would stop it."""
    body, state = robot.body, robot.state
    braking = jnp.maximum(state.v, 0.0) ** 2 / jnp.maximum(2 * body.u1_max, 1e-6)
    here = arena.clearance(state.x, state.y)
    ahead = arena.clearance(state.x + braking * cos, state.y + braking * sin)
    return [jnp.clip(here - body.radius, -1.0, 1.0), jnp.clip(ahead - body.radius, -1.0, 1.0)]


ENCODED = Encoded()
