"""A belief: where opponents can be that are not seen, on the coarse cells of the arena's chart.

From where they were, they can have moved at their top speed along free cells, and they are in no
cell that is seen to be empty. So the set of these cells always holds the truth; to a searcher it is
the contaminated part of the arena (Guibas et al., "A visibility-based pursuit-evasion problem",
1999), at the resolution of the grid.
"""

import functools
import math
from collections.abc import Iterator, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.game.chart import STEPS, Chart
from apollonius.game.sensing import BOUND, Noise, Percept, Sensors
from apollonius.game.types import Flag, Real, RobotState, Scalar

Cells = Bool[Array, "rows columns"]
Unseen = Float[Array, "rows columns"]
"""For each cell where an opponent can be the time since it was last seen [s], `NEVER` at most;
elsewhere negative.
"""
NEVER = 1e3
"""Age of what was never seen [s]."""
LONG_AGO = 100.0
"""Time since a cell was seen [s] from which on it is as good as never seen."""
NEAR = 30.0
"""Length [m] that is added to those of paths, on the scale of the paper's arena, so that cells at
hand are worth no detour."""
RAYS = 128
"""Directions in which a robot's range of sight is looked up."""
_GLANCES = 16
"""Steps of such a ray."""
_SHARE = 0.8
"""Share of the distance between two cells' middles that an opponent needs to cross the one, at
least.
"""
_NOBODY = -1.0
_ROUNDING = 0.01
"""Clearance [m] up to which a middle counts as in an obstacle, whose edges are often just there."""
_SEEN, _BLOCKED = -1, -2
"""In place of the number of a cell that is hidden: its middle is seen, or it is in an obstacle."""


class Belief(eqx.Module):
    """The cells where hidden opponents can be, and the time since each cell was last seen.

    Attributes:
        travel_budget: for each cell the distance [m] that an opponent can have moved since it came
            in, `_most` at most; negative where none can be.
        unseen: times since each cell was last seen [s], `NEVER` at most.
    """

    travel_budget: Float[Array, "rows columns"]
    unseen: Float[Array, "rows columns"]

    @property
    def where(self) -> Unseen:
        """The times of the cells in which an opponent can be."""
        return jnp.where(self.travel_budget >= 0, self.unseen, _NOBODY)


def uniform(chart: Chart) -> Belief:
    """Return the belief in which opponents can be wherever a robot can be, and no cell was ever
    seen.
    """
    return Belief(
        jnp.where(_links(chart) > 0, _most(chart), _NOBODY),
        jnp.full((chart.columns, chart.columns), NEVER, jnp.float32),
    )


def search_priority(
    chart: Chart, unseen: Unseen, robot: RobotState
) -> Float[Array, "rows columns"]:
    """Return the search priority of each cell for a robot [s/m]; negative where no opponent can be.

    It is the time since the cell was seen over the length of the path to it, as in patrolling
    (Machado et al., "Multi-agent patrolling: an empirical analysis of alternative architectures",
    2002).
    """
    lengths = chart.lengths_from(robot.x, robot.y)
    return jnp.where(unseen < 0, _NOBODY, jnp.minimum(unseen, LONG_AGO) / (lengths + NEAR))


def propagate(chart: Chart, belief: Belief, reach: Scalar, time: Real) -> Belief:
    """Propagate a belief over a time [s] in which opponents moved by up to `reach` [m].

    An opponent near the edge of a cell is in the next one at once, and then has to cross the cells.

    Args:
        chart: the arena's chart.
        belief: the belief before.
        reach: longest distance [m] that an opponent can have moved.
        time: the time that passed [s].
    """
    cell, links = chart.coarse_cell, _links(chart)
    hops = jnp.ceil(reach / (_SHARE * cell))
    share = reach / jnp.maximum(hops, 1.0)

    def one_hop(_: Array, budget: Array) -> Array:
        budget = jnp.where(budget >= 0, jnp.minimum(budget + share, _most(chart)), _NOBODY)
        best = budget
        for length, is_entered, neighbour_budget in _beside(links, budget, _NOBODY):
            remaining = neighbour_budget - _SHARE * cell * length
            best = jnp.maximum(best, jnp.where(is_entered & (remaining >= 0), remaining, _NOBODY))
        return best

    budget = jax.lax.fori_loop(0, hops.astype(jnp.int32), one_hop, belief.travel_budget)
    return Belief(budget, jnp.minimum(belief.unseen + time, NEVER))


def observe_belief(
    chart: Chart, sensors: Sensors, belief: Belief, percept: Percept, active: Sequence[Flag]
) -> Belief:
    """Remove the cells that a side's robots see from a belief, as they hold no opponent.

    A cell counts as seen if its middle is seen, and so is the middle of every cell beside it from
    which a robot can enter it, or whose middle belongs to it because no robot fits there.

    Args:
        chart: the arena's chart.
        sensors: the side's sensors.
        belief: the belief before.
        percept: what the side's robots sense.
        active: whether each robot is in play.
    """
    robots = zip(percept.own, active, strict=True)
    is_visible = functools.reduce(
        jnp.logical_or, [is_active & visible(chart, sensors, robot) for robot, is_active in robots]
    )
    is_seen, number = is_visible & percept.has_looked, _numbers(chart)
    hidden = jnp.where(is_visible, _SEEN, _owners(chart))
    for _, is_entered, owner in _beside(_links(chart), hidden, _SEEN):
        is_seen &= (owner == _SEEN) | ~(is_entered | (owner == number))
    budget = jnp.where(is_seen, _NOBODY, belief.travel_budget)
    return Belief(budget, jnp.where(is_seen, 0.0, belief.unseen))


def _owners(chart: Chart) -> Int[Array, "rows columns"]:
    """Return the number of the cell that each cell's middle belongs to."""
    x, y = jnp.broadcast_arrays(*chart.middles())
    clearance = jax.vmap(jax.vmap(chart.clearance))(x, y)
    owner = jax.vmap(jax.vmap(chart.nearest_cell))(x, y)
    return jnp.where(clearance > _ROUNDING, owner, _BLOCKED)


def localise(chart: Chart, robot: RobotState, bound: Scalar) -> Float[Array, "rows columns"]:
    """Return the budget of an opponent that is within `bound` [m] of where it is seen."""
    x, y = chart.middles()
    near = (bound > 0) & (jnp.hypot(x - robot.x, y - robot.y) <= bound + 1.5 * chart.coarse_cell)
    own_cell = _numbers(chart) == chart.nearest_cell(robot.x, robot.y)
    return jnp.where(own_cell | near & (_links(chart) > 0), _most(chart), _NOBODY)


@fusion_barrier
def visible(chart: Chart, sensors: Sensors, robot: RobotState) -> Cells:
    """Return the cells whose middles a robot surely sees, wherever the errors of its own state let
    it be.
    """
    x, y = chart.middles()
    dx, dy = x - robot.x, y - robot.y
    distance, own_noise = jnp.hypot(dx, dy), sensors.own_noise or Noise()
    is_seen = jnp.ones(distance.shape, bool)
    if sensors.line_of_sight:
        is_seen &= distance <= _profile(chart, robot, own_noise.reach)[_ray(dx, dy)]
    if sensors.range is not None:
        is_seen &= distance <= sensors.range - own_noise.reach
    if sensors.field_of_view is not None:
        half = sensors.field_of_view / 2 - own_noise.heading * BOUND
        cos, sin = jnp.cos(robot.heading), jnp.sin(robot.heading)
        forward, sideways = cos * dx + sin * dy, jnp.abs(cos * dy - sin * dx)
        from_edge = jnp.sin(half) * forward - jnp.cos(half) * sideways
        # more than a right angle from the edge
        is_far = jnp.cos(half) * forward + jnp.sin(half) * sideways < 0
        is_ahead = (half > 0) & (forward >= jnp.cos(half) * distance)
        sees_all = half >= jnp.pi
        edge_distance = jnp.where(is_far, distance, from_edge)
        is_seen &= sees_all | (is_ahead & (edge_distance >= own_noise.reach))
    return is_seen


def _ray(dx: Array, dy: Array) -> Int[Array, "..."]:
    """Return the number of the ray that is nearest to each direction.

    Rays are evenly spaced along a square that stands on its corner: which one is the nearest takes
    no arctangent.
    """
    along = dy / jnp.maximum(jnp.abs(dx) + jnp.abs(dy), 1e-6)
    quarter_turns = jnp.where(dx >= 0, along, 2 - along)
    return jnp.round(quarter_turns * (RAYS / 4)).astype(jnp.int32) % RAYS


def _profile(chart: Chart, robot: RobotState, margin: Scalar) -> Float[Array, " rays"]:
    """Return the distance [m] up to which nothing is in a cone around each ray, or within `margin`
    [m] of the cone.

    Neighbouring cones touch.

    Cones traced through the field of clearances (Crassin et al., 2011; Amanatides, "Ray tracing
    with cones", 1984).
    """
    place = jnp.arange(RAYS, dtype=jnp.float32) * (4 / RAYS)
    x, y = jnp.abs(place - 2) - 1, 1 - jnp.abs((place + 1) % 4 - 2)
    cos = x / jnp.hypot(x, y)
    sin = y / jnp.hypot(x, y)
    spread = 4 / RAYS

    def one_step(_: Array, distance: Array) -> Array:
        clearance = jax.vmap(chart.clearance)(robot.x + distance * cos, robot.y + distance * sin)
        return distance + jnp.maximum(clearance - spread * distance - margin, 0.0)

    return jax.lax.fori_loop(0, _GLANCES, one_step, jnp.zeros(RAYS))


def _beside(
    links: Array, values: Array, outside: float | int
) -> Iterator[tuple[float, Array, Array]]:
    """Yield for each of a cell's neighbours their distance [cells], whether it is entered from
    there, and its value.
    """
    rows, columns = values.shape
    wide = jnp.pad(values, 2, constant_values=outside)
    for bit, (right, up) in enumerate(STEPS):
        neighbours = wide[2 - up : 2 - up + rows, 2 - right : 2 - right + columns]
        yield math.hypot(right, up), (links >> bit) & 1 > 0, neighbours


def _links(chart: Chart) -> UInt32[Array, "rows columns"]:
    assert chart.links is not None, "charts in Python have them"
    return chart.links[chart.member]


def _numbers(chart: Chart) -> Int[Array, "rows columns"]:
    """Return the numbers of the coarse cells."""
    return jnp.arange(chart.columns**2).reshape(chart.columns, chart.columns)


def _most(chart: Chart) -> Scalar:
    """Return the largest budget [m]: enough to be in the next cell at once."""
    return chart.coarse_cell * 2.5
