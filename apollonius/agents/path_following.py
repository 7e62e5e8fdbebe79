"""Players that find their way by the chart, and go by what they believe: one that searches, one
that hides.

Lengths and times in their rules are on the scale of the paper's robots.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.accelerate.bit_mixing import mix_bits
from apollonius.agents.classical import AbstractSteering, direction
from apollonius.agents.guidance import arc_speed
from apollonius.agents.policy import Memory
from apollonius.game.chart import Chart
from apollonius.game.sensing import Sensors
from apollonius.game.teams import separation
from apollonius.game.types import Flag, RandomBits, RobotState, Scalar, tree_where
from apollonius.observe.belief import search_priority, visible
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
_SAFE_LENGTH = 8.0
"""Length of a pursuer's way [m] beyond which a place is no safer."""
NOWHERE = -1
"""In place of the coarse cell that a robot drives to: none."""


class AbstractPathFollower(AbstractSteering):
    """A player that drives along the shortest path to a place."""

    @property
    def needs_chart(self) -> bool:
        return True

    def course_to(self, view: View, place: RobotState) -> tuple[Scalar, Scalar]:
        """Return the heading [rad] and the speed [m/s] with which to set out for a place.

        Straight to it where that is free; else to the place a little ahead from which, together
        with the way there, the path is shortest.
        """
        chart = view.chart
        own = view.own.state
        body = view.own.body
        distance, bearing = separation(own, place), direction(own, place)
        margin = body.radius + _MARGIN
        is_free = chart.range(own.x, own.y, jnp.cos(bearing), jnp.sin(bearing)) >= distance
        angles = jnp.arange(COURSES, dtype=jnp.float32) * (2 * jnp.pi / COURSES)
        cos, sin = jnp.cos(angles), jnp.sin(angles)
        ranges = jax.vmap(chart.range, in_axes=(None, None, 0, 0))(own.x, own.y, cos, sin)
        reach = jnp.clip(ranges - margin, 0.0, _AHEAD)
        x, y = own.x + reach * cos, own.y + reach * sin
        target = chart.nearest_cell(place.x, place.y)

        def length_to_target(x: Scalar, y: Scalar) -> Scalar:
            return chart.path_length_from(target, chart.cell_weights(x, y))

        remaining = jax.vmap(length_to_target)(x, y)
        is_tight = jax.vmap(chart.clearance)(x, y) < margin
        length = reach + remaining + 0.5 * is_tight.astype(jnp.float32)
        best = jnp.argmin(length + jnp.where(reach < 0.05, _FAR, 0.0))
        corner = RobotState(x[best], y[best], own.v, own.heading)
        aim = tree_where(is_free, place, corner)
        ahead = chart.range(own.x, own.y, jnp.cos(own.heading), jnp.sin(own.heading))
        stoppable = jnp.sqrt(2 * body.u1_max * jnp.maximum(ahead - margin, 0.0))
        return direction(own, aim), jnp.minimum(arc_speed(body, own, aim), stoppable)


class Search(AbstractPathFollower):
    """Drives along the shortest path to the opponent or, not seeing it, to one place after another
    where it can be.

    Places are drawn at random, the more often the more a look is worth
    (`apollonius.observe.belief.search_priority`): always to the best one, it would circle an
    obstacle behind which an opponent could keep away from it (Isler, Kannan and Khanna, "Randomized
    pursuit-evasion in a polygonal environment", 2005). A place is given up when the opponent cannot
    be there any more.
    """

    @property
    def memory(self) -> Int[Array, ""]:
        """The coarse cell that it drives to; -1 for none."""
        return jnp.full((), NOWHERE, jnp.int32)

    def score(
        self, view: View, memory: Int[Array, ""], bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        sought, cell = search_view(view, memory, random_shares(bits, view.chart))
        return self.values(sought), cell

    def course(self, view: View) -> tuple[Scalar, Scalar]:
        return self.course_to(view, view.opponent.state)


class Hide(AbstractPathFollower):
    """Drives where the pursuer does not see it, to a near place to which the pursuer has a long
    way, and stays there.

    Of the places behind obstacles (Reynolds, "Steering behaviors for autonomous characters", 1999).
    """

    def course(self, view: View) -> tuple[Scalar, Scalar]:
        chart, pursuer = view.chart, view.opponent
        states = (pursuer.state, view.own.state)
        pursuer_lengths, own_lengths = (
            jnp.minimum(chart.lengths_from(state.x, state.y), _FAR) for state in states
        )
        is_hidden = ~visible(chart, Sensors(line_of_sight=True), pursuer.state)
        safety = jnp.minimum(pursuer_lengths, _SAFE_LENGTH) - jnp.where(
            is_hidden, 0.0, _SAFE_LENGTH / 2
        )
        is_first = pursuer_lengths > own_lengths + 0.5
        score = jnp.where(is_first, safety - 0.7 * own_lengths, safety - 2 * _SAFE_LENGTH)
        place = cell_middle(chart, jnp.argmax(jnp.where(own_lengths < _FAR, score, -_FAR)))
        heading, speed = self.course_to(view, place)
        distance = separation(view.own.state, place)
        stopping = jnp.sqrt(2 * view.own.body.u1_max * jnp.maximum(distance - 0.2, 0.0))
        return heading, jnp.minimum(speed, stopping)


def search_view(
    view: View, cell: Int[Array, ""], shares: Float[Array, " coarse"]
) -> tuple[View, Int[Array, ""]]:
    """Return the view of a robot that searches, and the coarse cell that it drives to.

    In that view its opponents are at rest in the cell, where one opponent can be. If one was seen
    lately, the view stays as it is, and the cell is -1.

    Args:
        view: the robot's view.
        cell: the cell that it has driven to; -1 for none.
        shares: random numbers from 0 to 1, which draw the next cell.
    """
    if view.belief is None:
        return view, cell
    chart, own = view.chart, view.own.state
    new_cell = jnp.argmax(shares * search_priority(chart, view.belief, own).ravel()).astype(
        jnp.int32
    )
    can_be_there = view.belief.ravel()[cell] >= 0
    is_far = chart.lengths_from(own.x, own.y).ravel()[cell] > _AT_HAND
    place = jnp.where((cell >= 0) & can_be_there & is_far, cell, new_cell)
    opponent_found = is_tracked(view)
    target = cell_middle(chart, place)
    opponents = tuple(
        replace(robot, state=tree_where(opponent_found, robot.state, target))
        for robot in view.opponents
    )
    return replace(view, opponents=opponents), jnp.where(opponent_found, NOWHERE, place)


def random_shares(bits: RandomBits, chart: Chart) -> Float[Array, " coarse"]:
    """Return a random number from 0 to 1 for each coarse cell of a chart."""
    words = mix_bits(bits, jnp.arange(1, chart.columns**2 + 1, dtype=jnp.uint32))
    return (words >> 8).astype(jnp.float32) / 2**24


def is_tracked(view: View) -> Flag:
    """Check whether the opponent was seen so lately that it is driven to."""
    return jnp.asarray(view.opponent.age) < _RECENT


def cell_middle(chart: Chart, cell: Int[Array, ""]) -> RobotState:
    """Return the middle of a coarse cell, as of a robot at rest."""
    (x, y), zero = chart.middles(), jnp.zeros(())
    return RobotState(x[0, cell % chart.columns], y[cell // chart.columns, 0], zero, zero)
