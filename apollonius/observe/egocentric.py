"""The view in a robot's own frame: the same in every arena, so that players carry over."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.game.chart import Chart
from apollonius.game.dynamics import MIRRORED
from apollonius.game.types import NUM_ACTIONS, Real, RobotState, Scalar
from apollonius.observe.braking import clearances_after
from apollonius.observe.observation import AbstractObservation, Mirror, clearances_ahead, cos_sin
from apollonius.observe.surroundings import Surroundings
from apollonius.observe.view import Robot, View

RAYS = 32
"""Directions of rays to walls and obstacles, the first one ahead, counter-clockwise."""
COURSES = 16
"""Directions, every other one of those, of points whose path lengths from the opponent are given.
"""
NEAR, AHEAD = 1.5, 5.0
"""Distances of these points [m], unless an obstacle is nearer."""
_BEFORE = 0.1
"""Distance of a point from such an obstacle [m]."""
_SHARPNESS = 4.0
"""Sharpness of the softmax over directions."""
ROOM = 0.3
"""Clearance after braking [m] above which more makes no difference."""
SPEED = 1.2
_U1 = 0.3
_U2 = 0.8
_LENGTH = 0.3
"""Units of the limits: those of the paper's robots."""

Courses = tuple[Float[Array, "16"], Float[Array, "16"], Float[Array, "16"]]
"""Ranges [m], cosines and sines of `COURSES` directions, the first one ahead."""


def _mirror() -> Mirror:
    """Return the mirror of the numbers: it exchanges directions on the left and on the right."""
    rays, longer = 23, 23 + RAYS + 3
    shorter = longer + COURSES
    first, braking = shorter + 2, shorter + 2 + COURSES

    def around(start: int, directions: int) -> list[int]:
        return [start + -number % directions for number in range(directions)]

    order = [
        *range(rays),
        *around(rays, RAYS),
        *range(rays + RAYS, longer),
        *around(longer, COURSES),
    ]
    order += [
        shorter,
        shorter + 1,
        *around(first, COURSES),
        *(braking + action for action in MIRRORED),
    ]
    to_the_left = 9, 14, shorter + 1
    return Mirror(tuple(order), tuple(-1 if number in to_the_left else 1 for number in order))


class Egocentric(AbstractObservation):
    """The robots, and of the arena rays and path lengths; networks read all on the scale of the
    paper's robots.

    Robots (23). Of the robot itself its speed, v_max, v_min, u1_max, largest turn rate at half the
    top speed and radius in units of the paper's robots, and its clearance here and where it would
    come to rest if it braked straight ahead, clipped to [-1, 1] (8). Of the opponent cosine and
    sine of its bearing, its distance d as 1 / (1 + d) and log(1 + d) / 2, what is left of it before
    a capture, clipped to 3 m, cosine and sine of its heading, all as the robot sees it; its speed
    and limits without v_min, and its clearance (14). And the capture distance (1).

    Rays (32): reciprocals 1 / (1 + r) of how far the robot's body could go [m] (IPAPRec: Zhang et
    al., "Learning to navigate with IPAPRec", 2021). Where movers come within a second at their
    velocities counts as theirs.

    Paths (37): whether the opponent can be seen; the path length w to it as 1 / (1 + w) and log(1 +
    w) / 2; in sixteen directions how much longer that path would be from 1.5 m ahead, over 1.5 m;
    where those point where it gets shorter (2); and who would be first 5 m ahead, as the difference
    of the times that both robots would take at their top speeds over their sum (16).

    Braking (9): the clearance that each action leaves (`apollonius.observe.braking`), over 0.3 m,
    clipped to [-1, 1], if movers keep their velocities.
    """

    name = "egocentric"
    size = 23 + RAYS + 5 + 2 * COURSES + NUM_ACTIONS
    needs_chart = True
    mirror = _mirror()

    def __call__(self, view: View) -> Float[Array, " size"]:
        """Return the numbers of a view; raises InvalidInput in an arena without a chart."""
        surroundings = view.surroundings
        own = view.own.state
        opponent = view.opponent.state
        cos, sin = cos_sin(own.heading)
        dx, dy = opponent.x - own.x, opponent.y - own.y
        distance = jnp.hypot(dx, dy)
        robots = _robots(view, surroundings, (cos, sin), (dx, dy), distance)
        angles = own.heading + jnp.arange(RAYS, dtype=jnp.float32) * (2 * jnp.pi / RAYS)
        directions = jnp.cos(angles), jnp.sin(angles)
        range_in = jax.vmap(surroundings.range, in_axes=(None, None, 0, 0, None))
        ranges = range_in(own.x, own.y, *directions, view.own.body.radius)
        rays = 1 / (1 + jnp.maximum(ranges - view.own.body.radius, 0.0))
        every = RAYS // COURSES
        courses = ranges[::every], directions[0][::every], directions[1][::every]
        room = jnp.clip(clearances_after(surroundings, view.own, view.dt) / ROOM, -1.0, 1.0)
        paths = _paths(view, view.chart, (dx, dy), distance, courses)
        return jnp.concatenate([robots, rays, paths, room])


def _robots(
    view: View,
    surroundings: Surroundings,
    ahead: tuple[Scalar, Scalar],
    away: tuple[Scalar, Scalar],
    distance: Scalar,
) -> Float[Array, "23"]:
    """Return the numbers of both robots.

    Args:
        view: what the robot sees.
        surroundings: the arena's chart and movers.
        ahead: cosine and sine of its heading.
        away: vector to the opponent [m].
        distance: length of that vector [m].
    """
    (cos, sin), (dx, dy) = ahead, away
    other = view.opponent
    their_cos, their_sin = cos_sin(other.state.heading)
    far = jnp.maximum(distance, 1e-6)
    numbers: list[Real] = [
        *_motion(view.own),
        view.own.body.v_min / SPEED,
        *clearances_ahead(surroundings, view.own, cos, sin),
        (cos * dx + sin * dy) / far,
        (cos * dy - sin * dx) / far,
        *on_two_scales(distance),
        jnp.clip(distance - view.capture_distance, 0.0, 3.0) / 3,
        cos * their_cos + sin * their_sin,
        cos * their_sin - sin * their_cos,
        *_motion(other),
        *clearances_ahead(surroundings, other, their_cos, their_sin),
        view.capture_distance / _LENGTH,
    ]
    return jnp.stack([jnp.asarray(number, jnp.float32) for number in numbers])


def _motion(robot: Robot) -> list[Real]:
    body = robot.body
    return [
        robot.state.v / SPEED,
        body.v_max / SPEED,
        body.u1_max / _U1,
        body.usual_turn_rate / _U2,
        body.radius / _LENGTH,
    ]


def on_two_scales(length: Scalar) -> list[Scalar]:
    """Return a length [m] on two scales, one for near ones and one for all."""
    return [1 / (1 + length), jnp.log1p(length) / 2]


def _paths(
    view: View, chart: Chart, away: tuple[Scalar, Scalar], distance: Scalar, courses: Courses
) -> Float[Array, "37"]:
    """Return the opponent's path lengths to the robot and to points around it."""
    own, opponent = view.own.state, view.opponent.state
    is_seen = chart.has_line_of_sight(own.x, own.y, *away, distance)
    their_weights = chart.cell_weights(opponent.x, opponent.y)
    own_weights = chart.cell_weights(own.x, own.y)
    cell = their_weights[0][jnp.argmax(their_weights[1])]
    length_here = chart.path_length_from(cell, own_weights)
    _, near = _from_ahead(chart, cell, own, courses, NEAR)
    longer = jnp.clip((near - length_here) / NEAR, -1.0, 1.0)
    weights = jax.nn.softmax(-_SHARPNESS * longer)
    angles = jnp.arange(COURSES, dtype=jnp.float32) * (2 * jnp.pi / COURSES)
    shorter = jnp.stack([weights @ jnp.cos(angles), weights @ jnp.sin(angles)])
    own_lengths, their_lengths = _from_ahead(chart, cell, own, courses, AHEAD)
    own_time = own_lengths * view.opponent.body.v_max
    their_time = their_lengths * view.own.body.v_max
    lead = (their_time - own_time) / (their_time + own_time + 1e-3)
    path_length = chart.path_length(their_weights, own_weights)
    length = jnp.stack(on_two_scales(jnp.where(is_seen, distance, path_length)))
    return jnp.concatenate([is_seen[None].astype(jnp.float32), length, longer, shorter, lead])


def _from_ahead(
    chart: Chart, cell: Int[Array, ""], own: RobotState, courses: Courses, reach: float
) -> tuple[Float[Array, "16"], Float[Array, "16"]]:
    """Return distances of points ahead of a robot, and their path lengths from a coarse cell."""
    ranges, cos, sin = courses
    along = jnp.clip(ranges - _BEFORE, 0.0, reach)
    cell_weights = jax.vmap(chart.cell_weights)(own.x + along * cos, own.y + along * sin)
    return along, jax.vmap(chart.path_length_from, in_axes=(None, 0))(cell, cell_weights)


EGOCENTRIC = Egocentric()
BRAKING = EGOCENTRIC.size - NUM_ACTIONS
"""The first of the numbers of braking."""
