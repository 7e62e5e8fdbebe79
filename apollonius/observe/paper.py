"""The paper's observation (Eq. 6, 7)."""

from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.observe.observation import AbstractObservation, position_and_speed
from apollonius.observe.view import View


@dataclass(frozen=True)
class Paper(AbstractObservation):
    """x, y, v, heading of the robot itself, then of its opponent (Eq. 7).

    Positions and speeds are mapped linearly from their limits to [-1, 1], headings are divided by pi.
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
