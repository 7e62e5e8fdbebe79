"""Actions allowed to a pursuer at rest: driving off, or turning towards a free way to its opponent.

A policy without a memory that turns on the spot can stand for ever, right of a heading at which
left is best and left of one at which right is best, most often nose to an obstacle that it must not
touch. A car there turns in several moves, forwards and backwards.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from apollonius.agents.policy import AbstractValueWrapper, Memory
from apollonius.game.dynamics import wrap_angle
from apollonius.game.types import NUM_ACTIONS, Flag, RandomBits, Scalar
from apollonius.observe.braking import clearances_after
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
_BEHIND = 2.3
"""Angle from the heading to a free way [rad], beyond which that is behind the robot."""
_LOSS = 2e-3
"""Clearance [m] that a move may cost a car that has less than `NEAR`."""
_FORBIDDEN = 1e5
"""Cost of an action that is not allowed, beyond all values of actions."""
_RIGHT, _LEFT = 0, 2
"""Actions that turn on the spot."""
_AHEAD = 7
"""The action that drives straight on."""
_FAR_ENOUGH = 1.5
"""Way ahead, in turning radii, and clearance, in `NEAR`, with which a car stops driving
backwards.
"""


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
    if isinstance(body.turns_on_the_spot, Array):
        on_the_spot = _turns_on_the_spot(view, room, turn, jnp.min(lengths) < _LONGEST)
        return jnp.where(body.turns_on_the_spot, on_the_spot, _moves_of_turn(view, room, turn))
    if not body.turns_on_the_spot:
        return _moves_of_turn(view, room, turn)
    return _turns_on_the_spot(view, room, turn, jnp.min(lengths) < _LONGEST)


def _turns_on_the_spot(
    view: View, room: Scalar, turn: Scalar, is_some_way_free: Flag
) -> Bool[Array, "9"]:
    """Return the actions allowed to a robot that turns on the spot.

    Args:
        view: what the robot sees.
        room: clearance of its body [m].
        turn: angle from its heading to the free way [rad].
        is_some_way_free: whether there is such a way.
    """
    own, body = view.own.predicted, view.own.body
    heads_there = jnp.abs(turn) <= body.u2_max * view.dt
    best = jnp.where(heads_there, _AHEAD, jnp.where(turn > 0, _LEFT, _RIGHT))
    actions = jnp.arange(NUM_ACTIONS)
    drives_off = (actions >= NUM_ACTIONS - 3) & (room >= NEAR)
    is_at_rest = own.v < body.u1_max * view.dt / 2
    return ~(is_at_rest & is_some_way_free) | drives_off | (actions == best)


def _moves_of_turn(view: View, room: Scalar, turn: Scalar) -> Bool[Array, "9"]:
    """Return the actions allowed to a car: all to one that drives forwards.

    At rest, with less way ahead than its turning radius or less clearance than `NEAR`, it drives to
    where there is more, forwards or backwards, steered so that it turns towards the free way or, if
    that is behind it, to the side with more room. It drives backwards until there is way enough
    ahead, or no room behind.

    Args:
        view: what the robot sees.
        room: clearance of its body [m].
        turn: angle from its heading to the free way [rad].
    """
    chart, car = view.chart, view.own.body
    own = view.own.predicted
    cos, sin = jnp.cos(own.heading), jnp.sin(own.heading)
    ahead = chart.range(own.x, own.y, cos, sin) - car.radius
    behind = chart.range(own.x, own.y, -cos, -sin) - car.radius
    to_the_left = chart.range(own.x, own.y, -sin, cos)
    to_the_right = chart.range(own.x, own.y, sin, -cos)
    is_left = jnp.where(jnp.abs(turn) < _BEHIND, turn > 0, to_the_left > to_the_right)
    forwards, backwards = jnp.where(is_left, 8, 6), jnp.where(is_left, 0, 2)
    room_after = clearances_after(view.surroundings, view.own, view.dt)
    is_safe = room_after >= jnp.minimum(NEAR, room - _LOSS)
    is_at_rest = jnp.abs(own.v) < car.u1_max * view.dt / 2
    is_backing = own.v < 0
    is_short = (ahead < car.turning_radius) | (room < NEAR)
    is_still_short = (ahead < _FAR_ENOUGH * car.turning_radius) | (room < _FAR_ENOUGH * NEAR)
    starts_back = is_at_rest & is_short & (behind > ahead)
    goes_on = ~is_at_rest & is_backing & is_still_short
    backs = (starts_back | goes_on) & is_safe[backwards] & (car.v_min < 0)
    actions = jnp.arange(NUM_ACTIONS)
    drives_off = actions >= NUM_ACTIONS - 3
    onward = jnp.where(is_at_rest & is_short & is_safe[forwards], actions == forwards, drives_off)
    is_free = ~is_at_rest & ~is_backing
    return jnp.where(backs, actions == backwards, is_free | onward)


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
