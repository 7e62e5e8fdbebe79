"""Actions allowed to a pursuer at rest: driving off, or turning towards a free way to its opponent.

A policy without a memory that turns on the spot can stand for ever, right of a heading at which
left is best and left of one at which right is best, most often nose to an obstacle that it must not
touch.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from apollonius.agents.policy import AbstractValueWrapper, Memory
from apollonius.game.dynamics import wrap_angle
from apollonius.game.types import NUM_ACTIONS, RandomBits, Scalar
from apollonius.observe.view import View

NEAR = 0.05
"""Clearance [m] below which a robot at rest drives only where it gains some; like
the lengths below, on the scale of the paper's robots."""
_DIRECTIONS = 32
"""Directions in which a free way is looked for."""
_PLACES = (0.05, 0.1, 0.2, 0.3)
"""Distances [m] of the places on such a way at which its clearance is looked up."""
_GAIN = 1 / 8
"""Clearance that a free way gains in a metre [m], until there is `NEAR`: more than a step's turn
would lose again.
"""
_LONGEST = 1e6
"""Length [m] of a way that is not free."""
_FORBIDDEN = 1e5
"""Cost of an action that is not allowed, beyond all values of actions."""
_RIGHT, _LEFT = 0, 2
"""Actions that turn on the spot."""
_AHEAD = 7
"""The action that drives straight on."""


def departures(view: View) -> Bool[Array, "9"]:
    """Return the actions that are allowed: all nine to a robot that moves.

    One at rest may drive off, or turn towards the direction in which the path to its opponent is
    shortest, among those in which the body has a clearance of `NEAR` or gains it. With less
    clearance than that it does only the latter and, once it heads there to a step's turn, drives
    straight on. Where no direction is free all actions are allowed.
    """
    chart = view.chart
    own = view.own.predicted
    body = view.own.body
    room = chart.clearance(own.x, own.y) - body.radius
    target = chart.nearest_cell(view.opponent.state.x, view.opponent.state.y)

    def path_length(angle: Scalar) -> Scalar:
        """Return the length [m] of the path to the opponent from the end of a way, `_LONGEST` if
        that is not free.
        """

        def place_at(distance: float) -> tuple[Scalar, Scalar]:
            return own.x + distance * jnp.cos(angle), own.y + distance * jnp.sin(angle)

        places = [place_at(distance) for distance in _PLACES]
        clearances = jnp.stack([chart.clearance(x, y) for x, y in places]) - body.radius
        least = jnp.minimum(NEAR, room + _GAIN * jnp.array(_PLACES))
        length = chart.path_length_from(target, chart.cell_weights(*places[-1]))
        return jnp.where(jnp.all(clearances >= least), length, _LONGEST)

    angles = jnp.arange(_DIRECTIONS, dtype=jnp.float32) * (2 * jnp.pi / _DIRECTIONS)
    lengths = jax.vmap(path_length)(angles)
    turn = wrap_angle(angles[jnp.argmin(lengths)] - own.heading)
    heads_there = jnp.abs(turn) <= body.u2_max * view.dt
    best = jnp.where(heads_there, _AHEAD, jnp.where(turn > 0, _LEFT, _RIGHT))
    actions = jnp.arange(NUM_ACTIONS)
    drives_off = (actions >= NUM_ACTIONS - 3) & (room >= NEAR)
    is_at_rest = own.v < body.u1_max * view.dt / 2
    return ~(is_at_rest & (jnp.min(lengths) < _LONGEST)) | drives_off | (actions == best)


def departure_costs(view: View) -> Float[Array, "9"]:
    """Return the cost of each of the nine actions: 0 where `departures` allows it."""
    return jnp.where(departures(view), 0.0, _FORBIDDEN)


class Departing(AbstractValueWrapper):
    """Another pursuer, which at rest does only what `departures` allows."""

    @property
    def needs_chart(self) -> bool:
        return True

    def score(
        self, view: View, memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        values, memory = self.score_view(view, memory, bits)
        return values - departure_costs(view), memory
