"""Players that find their way by the chart, and go by what they believe: one that searches, one that hides."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.classical import AbstractSteering, direction
from apollonius.agents.guidance import arc_speed
from apollonius.agents.policy import AbstractActionValuePolicy, Memory, mixed
from apollonius.game.chart import COARSE, Chart
from apollonius.game.sensing import Sensors
from apollonius.game.teams import separation
from apollonius.game.types import Bits, Flag, RobotState, Scalar, choose
from apollonius.observe.belief import prospects, visible
from apollonius.observe.view import View

COURSES = 32
"""Directions in which the next place on the way is looked for."""
_AHEAD = 1.2
"""Distance of these places [m], unless an obstacle is nearer."""
_MARGIN = 0.1
"""Clearance that a body keeps from such an obstacle [m]."""
_FAR = 1e3
"""Length of a missing way [m]."""
_RECENT = 1.05
"""Age of a sighting [s] up to which it is driven to."""
_AT_HAND = 1.0
"""Length of a path [m] up to which a cell is at hand."""
_CAUTION = 8.0
"""Length of a pursuer's way [m] beyond which a place is no safer."""


class AbstractWayfinder(AbstractSteering):
    """A player that drives along the shortest path to a place."""

    @property
    def charted(self) -> bool:
        return True

    def way(self, seen: View, place: RobotState) -> tuple[Scalar, Scalar]:
        """Return the heading [rad] and the speed [m/s] with which to set out for a place.

        Straight to it where that is free; else to the place a little ahead from which, together with the way there, the
        path is shortest.
        """
        chart, own, body = seen.chart, seen.own.state, seen.own.body
        distance, sight = separation(own, place), direction(own, place)
        room = body.radius + _MARGIN
        is_free = chart.range(own.x, own.y, jnp.cos(sight), jnp.sin(sight)) >= distance
        angles = jnp.arange(COURSES, dtype=jnp.float32) * (2 * jnp.pi / COURSES)
        cos, sin = jnp.cos(angles), jnp.sin(angles)
        ranges = jax.vmap(chart.range, in_axes=(None, None, 0, 0))(own.x, own.y, cos, sin)
        along = jnp.clip(ranges - room, 0.0, _AHEAD)
        x, y = own.x + along * cos, own.y + along * sin
        target = chart.nearest_cell(place.x, place.y)
        left = jax.vmap(lambda x, y: chart.path_length_from(target, chart.cell_weights(x, y)))(x, y)
        tight = jax.vmap(chart.clearance)(x, y) < room
        best = jnp.argmin(along + left + 0.5 * tight.astype(jnp.float32) + jnp.where(along < 0.05, _FAR, 0.0))
        corner = RobotState(x[best], y[best], own.v, own.heading)
        aim = choose(is_free, place, corner)
        ahead = chart.range(own.x, own.y, jnp.cos(own.heading), jnp.sin(own.heading))
        stoppable = jnp.sqrt(2 * body.u1_max * jnp.maximum(ahead - room, 0.0))
        return direction(own, aim), jnp.minimum(arc_speed(body, own, aim), stoppable)


class Search(AbstractWayfinder):
    """Drives along the shortest path to the opponent or, not seeing it, to one place after another where it can be.

    Places are drawn at random, the more often the more a look is worth (`apollonius.observe.belief.prospects`): always
    to the best one, it would circle an obstacle behind which an opponent could keep away from it (Isler, Kannan and
    Khanna, "Randomized pursuit-evasion in a polygonal environment", 2005). A place is given up when the opponent cannot
    be there any more.
    """

    @property
    def memory(self) -> Int[Array, ""]:
        """The coarse cell that it drives to; -1 for none."""
        return jnp.full((), -1, jnp.int32)

    def weigh(self, seen: View, memory: Int[Array, ""], bits: Bits) -> tuple[Float[Array, "9"], Memory]:
        words = mixed(bits, jnp.arange(1, COARSE**2 + 1, dtype=jnp.uint32))
        shares = (words >> 8).astype(jnp.float32) / 2**24
        return (self.values(seen), memory) if seen.belief is None else self.look_on(seen, memory, shares)

    def look_on(
        self, seen: View, memory: Int[Array, ""], shares: Float[Array, " coarse"]
    ) -> tuple[Float[Array, "9"], Int[Array, ""]]:
        """Return the values of the actions, and the cell that it drives to, drawn by random shares from 0 to 1."""
        chart, opponent, own = seen.chart, seen.opponent, seen.own.state
        assert seen.belief is not None, "it searches"
        unseen = seen.belief.ravel()
        drawn = jnp.argmax(shares * prospects(chart, seen.belief, own).ravel()).astype(jnp.int32)
        stays = (memory >= 0) & (unseen[memory] >= 0) & (chart.lengths_from(own.x, own.y).ravel()[memory] > _AT_HAND)
        cell, found = jnp.where(stays, memory, drawn), is_found(seen)
        place = choose(found, opponent.state, middle_of(chart, cell))
        return self.towards(seen.own, *self.way(seen, place)), jnp.where(found, -1, cell)

    def course(self, seen: View) -> tuple[Scalar, Scalar]:
        return self.way(seen, seen.opponent.state)


class Searching(AbstractActionValuePolicy):
    """Another pursuer, which searches as `Search` does while it does not see its opponent."""

    policy: AbstractActionValuePolicy
    search: Search

    @property
    def charted(self) -> bool:
        return True

    @property
    def memory(self) -> tuple[Memory, Memory]:
        return self.policy.memory, self.search.memory

    def values(self, seen: View) -> Float[Array, "9"]:
        return self.policy.values(self.policy.observation(seen))

    def weigh(self, seen: View, memory: tuple[Memory, Memory], bits: Bits) -> tuple[Float[Array, "9"], Memory]:
        own, own_memory = self.policy.weigh(self.policy.observation(seen), memory[0], bits)
        search, place = self.search.weigh(seen, memory[1], bits)
        return jnp.where(is_found(seen), own, search), (own_memory, place)


class Hide(AbstractWayfinder):
    """Drives where the pursuer does not see it, to a near place to which the pursuer has a long way, and stays there.

    Of the places behind obstacles (Reynolds, "Steering behaviors for autonomous characters", 1999).
    """

    def course(self, seen: View) -> tuple[Scalar, Scalar]:
        chart, pursuer = seen.chart, seen.opponent
        theirs, ours = (
            jnp.minimum(chart.lengths_from(robot.state.x, robot.state.y), _FAR) for robot in (pursuer, seen.own)
        )
        hidden = ~visible(chart, Sensors(line_of_sight=True), pursuer.state)
        safe = jnp.minimum(theirs, _CAUTION) - jnp.where(hidden, 0.0, _CAUTION / 2)
        first = jnp.where(theirs > ours + 0.5, safe - 0.7 * ours, safe - 2 * _CAUTION)
        place = middle_of(chart, jnp.argmax(jnp.where(ours < _FAR, first, -_FAR)))
        heading, speed = self.way(seen, place)
        away = separation(seen.own.state, place)
        stopping = jnp.sqrt(2 * seen.own.body.u1_max * jnp.maximum(away - 0.2, 0.0))
        return heading, jnp.minimum(speed, stopping)


def is_found(seen: View) -> Flag:
    """Return whether the opponent was seen so lately that it is driven to."""
    return jnp.asarray(seen.opponent.age) < _RECENT


def middle_of(chart: Chart, cell: Int[Array, ""]) -> RobotState:
    """Return the middle of a coarse cell, as of a robot at rest."""
    (x, y), zero = chart.middles(), jnp.zeros(())
    return RobotState(x[0, cell % COARSE], y[cell // COARSE, 0], zero, zero)
