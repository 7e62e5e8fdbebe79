"""A belief: where opponents can be that are not seen, on the coarse cells of the arena's chart.

From where they were, they can have moved at their top speed along free cells, and they are in no cell that is seen to
be empty. So the set of these cells always holds the truth; to a searcher it is the contaminated part of the arena
(Guibas et al., "A visibility-based pursuit-evasion problem", 1999), at the resolution of the grid.
"""

import functools
import math
from collections.abc import Iterator, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.game.chart import COARSE, STEPS, Chart
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.sensing import BOUND, Noise, Percept, Sensors
from apollonius.game.types import Flag, Real, RobotState, Scalar

Cells = Bool[Array, "rows columns"]
Unseen = Float[Array, "rows columns"]
"""For each cell where an opponent can be the time since it was last seen [s], `NEVER` at most; elsewhere negative."""
NEVER = 1e3
"""Age of what was never seen [s]."""
LONG_AGO = 100.0
"""Time since a cell was seen [s] from which on it is as good as never seen."""
NEAR = 30.0
"""Length [m] that is added to those of paths, on the scale of the paper's arena, so that cells at hand are worth no
detour."""
RAYS = 128
"""Directions in which a robot's range of sight is looked up."""
_GLANCES = 16
"""Steps of such a ray."""
_SHARE = 0.8
"""Share of the distance between two cells' middles that an opponent needs to cross the one, at least."""
_NOBODY = -1.0
_ROUNDING = 0.01
"""Clearance [m] up to which a middle counts as in an obstacle, whose edges are often just there."""
_SEEN, _BLOCKED = -1, -2
"""In place of the number of a cell that is hidden: its middle is seen, or it is in an obstacle."""


class Belief(eqx.Module):
    """The cells where hidden opponents can be, and the time since each cell was last seen.

    Attributes:
        credit: for each cell the distance [m] that an opponent can have moved since it came in, `_most` at most;
            negative where none can be.
        unseen: times since each cell was last seen [s], `NEVER` at most.
    """

    credit: Float[Array, "rows columns"]
    unseen: Float[Array, "rows columns"]

    @property
    def where(self) -> Unseen:
        """The times of the cells in which an opponent can be."""
        return jnp.where(self.credit >= 0, self.unseen, _NOBODY)


def anywhere(chart: Chart) -> Belief:
    """Return the belief in which opponents can be wherever a robot can be, and no cell was ever seen."""
    return Belief(jnp.where(_links(chart) > 0, _most(chart), _NOBODY), jnp.full((COARSE, COARSE), NEVER, jnp.float32))


def prospects(chart: Chart, unseen: Unseen, robot: RobotState) -> Float[Array, "rows columns"]:
    """Return what a look at each cell is worth to a robot [s/m]: more where it is long ago and the path is short.

    It is the idleness of a patrol's places over what it takes to get there (Machado et al., "Multi-agent patrolling: an
    empirical analysis of alternative architectures", 2002); negative where no opponent can be.
    """
    lengths = chart.lengths_from(robot.x, robot.y)
    return jnp.where(unseen < 0, _NOBODY, jnp.minimum(unseen, LONG_AGO) / (lengths + NEAR))


def moved(chart: Chart, belief: Belief, reach: Scalar, time: Real) -> Belief:
    """Return what is known after a time [s] in which opponents have moved by up to `reach` [m].

    A robot near the edge of a cell is in the next one at once; from there on it has to cross the cells.
    """
    cell, links = _cell(chart), _links(chart)
    hops = jnp.ceil(reach / (_SHARE * cell))
    share = reach / jnp.maximum(hops, 1.0)

    def hop(_: Array, credit: Array) -> Array:
        credit = jnp.where(credit >= 0, jnp.minimum(credit + share, _most(chart)), _NOBODY)
        best = credit
        for length, is_entered, there in _beside(links, credit, _NOBODY):
            came = there - _SHARE * cell * length
            best = jnp.maximum(best, jnp.where(is_entered & (came >= 0), came, _NOBODY))
        return best

    credit = jax.lax.fori_loop(0, hops.astype(jnp.int32), hop, belief.credit)
    return Belief(credit, jnp.minimum(belief.unseen + time, NEVER))


def looked(chart: Chart, sensors: Sensors, belief: Belief, percept: Percept, active: Sequence[Flag]) -> Belief:
    """Return the belief without the cells that a side's robots see, none of which holds an opponent.

    A cell is seen where its middle is, and those of the cells beside it to which a robot could go; also those in which
    none fits in the middle, but that belong to this cell at their edges.
    """
    clear = functools.reduce(
        jnp.logical_or,
        [there & visible(chart, sensors, robot) for robot, there in zip(percept.own, active, strict=True)],
    )
    seen, number = clear & percept.looked, jnp.arange(COARSE**2).reshape(COARSE, COARSE)
    hidden = jnp.where(clear, _SEEN, _owners(chart))
    for _, is_entered, there in _beside(_links(chart), hidden, _SEEN):
        seen &= (there == _SEEN) | ~(is_entered | (there == number))
    return Belief(jnp.where(seen, _NOBODY, belief.credit), jnp.where(seen, 0.0, belief.unseen))


def _owners(chart: Chart) -> Int[Array, "rows columns"]:
    """Return the number of the cell that each cell's middle belongs to."""
    x, y = jnp.broadcast_arrays(*chart.middles())
    clearance, owner = (jax.vmap(jax.vmap(read))(x, y) for read in (chart.clearance, chart.nearest_cell))
    return jnp.where(clearance > _ROUNDING, owner, _BLOCKED)


def at(chart: Chart, robot: RobotState, bound: Scalar) -> Float[Array, "rows columns"]:
    """Return the credit of an opponent that is within `bound` [m] of where it is seen."""
    x, y = chart.middles()
    near = (bound > 0) & (jnp.hypot(x - robot.x, y - robot.y) <= bound + 1.5 * _cell(chart))
    here = jnp.arange(COARSE**2).reshape(COARSE, COARSE) == chart.nearest_cell(robot.x, robot.y)
    return jnp.where(here | near & (_links(chart) > 0), _most(chart), _NOBODY)


@fusion_barrier
def visible(chart: Chart, sensors: Sensors, robot: RobotState) -> Cells:
    """Return the cells whose middles a robot surely sees, wherever the errors of its own state let it be."""
    x, y = chart.middles()
    dx, dy = x - robot.x, y - robot.y
    away, own = jnp.hypot(dx, dy), sensors.own_noise or Noise()
    seen = jnp.ones((COARSE, COARSE), bool)
    if sensors.line_of_sight:
        seen &= away <= _profile(chart, robot, own.reach)[_ray(dx, dy)]
    if sensors.range is not None:
        seen &= away <= sensors.range - own.reach
    if sensors.field_of_view is not None:
        half = sensors.field_of_view / 2 - own.heading * BOUND
        cos, sin = jnp.cos(robot.heading), jnp.sin(robot.heading)
        ahead, aside = cos * dx + sin * dy, jnp.abs(cos * dy - sin * dx)
        from_edge = jnp.sin(half) * ahead - jnp.cos(half) * aside
        is_far = jnp.cos(half) * ahead + jnp.sin(half) * aside < 0  # more than a right angle from the edge
        within = (half > 0) & (ahead >= jnp.cos(half) * away)
        seen &= (half >= jnp.pi) | (within & (jnp.where(is_far, away, from_edge) >= own.reach))
    return seen


def _ray(dx: Array, dy: Array) -> Int[Array, "..."]:
    """Return the number of the ray that is nearest to each direction.

    Rays are evenly spaced along a square that stands on its corner: which one is the nearest takes no arctangent.
    """
    along = dy / jnp.maximum(jnp.abs(dx) + jnp.abs(dy), 1e-6)
    quarter_turns = jnp.where(dx >= 0, along, 2 - along)
    return jnp.round(quarter_turns * (RAYS / 4)).astype(jnp.int32) % RAYS


def _profile(chart: Chart, robot: RobotState, margin: Scalar) -> Float[Array, " rays"]:
    """Return the distance [m] up to which nothing is in a cone around each ray, or within `margin` [m] of the cone.

    Neighbouring cones touch.

    Cones traced through the field of clearances (Crassin et al., 2011; Amanatides, "Ray tracing with cones", 1984).
    """
    place = jnp.arange(RAYS, dtype=jnp.float32) * (4 / RAYS)
    x, y = jnp.abs(place - 2) - 1, 1 - jnp.abs((place + 1) % 4 - 2)
    cos, sin, spread = x / jnp.hypot(x, y), y / jnp.hypot(x, y), 4 / RAYS

    def on(_: Array, along: Array) -> Array:
        clearance = jax.vmap(chart.clearance)(robot.x + along * cos, robot.y + along * sin)
        return along + jnp.maximum(clearance - spread * along - margin, 0.0)

    return jax.lax.fori_loop(0, _GLANCES, on, jnp.zeros(RAYS))


def _beside(links: Array, values: Array, outside: float | int) -> Iterator[tuple[float, Array, Array]]:
    """Yield for each of a cell's neighbours their distance [cells], whether it is entered from there, and its value."""
    wide = jnp.pad(values, 2, constant_values=outside)
    for bit, (right, up) in enumerate(STEPS):
        there = wide[2 - up : 2 - up + COARSE, 2 - right : 2 - right + COARSE]
        yield math.hypot(right, up), (links >> bit) & 1 > 0, there


def _links(chart: Chart) -> UInt32[Array, "rows columns"]:
    assert chart.links is not None, "charts in Python have them"
    return chart.links[chart.member]


def _cell(chart: Chart) -> Scalar:
    return chart.side[chart.member] / COARSE


def _most(chart: Chart) -> Scalar:
    """Return the largest credit [m]: enough to be in the next cell at once."""
    return _cell(chart) * 2.5
