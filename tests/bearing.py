"""A new observation: where the opponent is, as a robot with a camera sees it."""

from dataclasses import dataclass

import jax.numpy as jnp

from apollonius.game.dynamics import unit_vector
from apollonius.observe.observation import AbstractObservation, rescale


@dataclass(frozen=True)
class Bearing(AbstractObservation):
    """Six numbers: own speed, cosine and sine of the opponent's bearing, distance, both robots' clearances."""

    name = "bearing"
    size = 6

    def __call__(self, view):
        arena, own, opponent = view.arena, view.own.state, view.opponent.state
        body = view.own.body
        direction = jnp.arctan2(opponent.y - own.y, opponent.x - own.x) - own.heading
        longer = jnp.maximum(arena.x_max - arena.x_min, arena.y_max - arena.y_min)
        distance = jnp.hypot(opponent.x - own.x, opponent.y - own.y) / longer
        clearances = [arena.clearance(one.state.x, one.state.y) - one.body.radius for one in view.robots]
        speed = rescale(own.v, body.v_min, body.v_max)
        return jnp.stack([speed, *unit_vector(direction), distance, *(jnp.clip(one, -1.0, 1.0) for one in clearances)])


BEARING = Bearing()
