"""The view of two teams: the nearest opponent as in a game of two, and the robots around one by
one.
"""

from collections.abc import Sequence
from functools import partial

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.chart import CellWeights, Chart
from apollonius.game.teams import by_distance, distance_squared
from apollonius.game.types import RobotState, Scalar
from apollonius.observe.egocentric import EGOCENTRIC, SPEED, on_two_scales
from apollonius.observe.observation import AbstractObservation, Mirror, cos_sin
from apollonius.observe.view import Robot, View

MATES, OPPONENTS = 3, 2
"""Mates, and opponents besides the nearest; of more, those whose centres are nearest."""
OF_A_ROBOT = 13
"""Numbers of each other robot."""


def _mirror() -> Mirror:
    """Return the mirror of the numbers: it flips the sign of those of a robot that are positive to
    the left.
    """
    first = EGOCENTRIC.mirror
    assert first, "it has one"
    signs = [-1 if number in (2, 6, 8) else 1 for number in range(OF_A_ROBOT)] * (MATES + OPPONENTS)
    more = range(EGOCENTRIC.size, EGOCENTRIC.size + len(signs))
    return Mirror((*first.order, *more), (*first.signs, *signs))


class Team(AbstractObservation):
    """`egocentric`, of the nearest active opponent, and the other active robots: the mates from the
    nearest to the farthest, then the other opponents.

    Of each (13): that it is there; cosine and sine of its bearing, and its distance d as 1 / (1 +
    d) and log(1 + d) / 2; its velocity ahead and to the left; cosine and sine of the angle at the
    nearest opponent between the robot and it; the path length w to it as log(1 + w) / 2, and its
    own to the nearest opponent as 1 / (1 + w) and log(1 + w) / 2; and whether that opponent is
    between them: 0 where the way from one to the other leads through it, 1 where one is on the
    other's way to it (their Gromov product there, over its largest value). All are 0 of one that is
    not there, so that a network reads teams of every size, and one for `egocentric` can be trained
    further with weights of 0 for the rest.
    """

    name = "team"
    size = EGOCENTRIC.size + (MATES + OPPONENTS) * OF_A_ROBOT
    needs_chart = True
    extends = EGOCENTRIC.name
    mirror = _mirror()

    def __call__(self, view: View) -> Float[Array, " size"]:
        """Return the numbers of a view; raises InvalidInput as `egocentric` does."""
        first = EGOCENTRIC(view)
        chart = view.chart
        own = view.own.state
        opponent = view.opponent.state
        ends = chart.cell_weights(own.x, own.y), chart.cell_weights(opponent.x, opponent.y)
        own_length = _path_length(chart, (own, ends[0]), (opponent, ends[1]))

        def of(robots: Sequence[Robot], slots: int) -> Float[Array, " numbers"]:
            numbers_of = partial(_of_a_robot, chart, view, ends, own_length)
            numbers = [numbers_of(robot) for robot in robots[:slots]]
            blank = jnp.zeros((slots - len(numbers)) * OF_A_ROBOT, jnp.float32)
            return jnp.concatenate([*numbers, blank])

        def in_order(robots: Sequence[Robot]) -> list[Robot]:
            states = [robot.state for robot in robots]
            return by_distance(own, states, [robot.active for robot in robots], robots)

        mates = in_order(view.mates)
        opponents = in_order(view.opponents)
        return jnp.concatenate([first, of(mates, MATES), of(opponents[1:], OPPONENTS)])


def _path_length(
    chart: Chart, start: tuple[RobotState, CellWeights], end: tuple[RobotState, CellWeights]
) -> Scalar:
    """Return the path length [m] between two robots, at least their distance."""
    distance = jnp.sqrt(distance_squared(start[0], end[0]))
    return jnp.maximum(chart.path_length(start[1], end[1]), distance)


def _of_a_robot(
    chart: Chart,
    view: View,
    ends: tuple[CellWeights, CellWeights],
    own_length: Scalar,
    robot: Robot,
) -> Float[Array, "13"]:
    """Return the numbers of a robot besides the nearest opponent.

    Args:
        chart: the arena's chart.
        view: what the robot that looks sees.
        ends: cell weights of the robot that looks and of the nearest opponent.
        own_length: path length between those two [m].
        robot: the other robot.
    """
    own = view.own.state
    opponent = view.opponent.state
    other = robot.state
    cos, sin = cos_sin(own.heading)
    their_cos, their_sin = cos_sin(other.heading)
    dx, dy = other.x - own.x, other.y - own.y
    distance = jnp.hypot(dx, dy)
    far = jnp.maximum(distance, 1e-6)
    away = (own.x - opponent.x, own.y - opponent.y)
    across = (other.x - opponent.x, other.y - opponent.y)
    spread = jnp.maximum(jnp.hypot(*away) * jnp.hypot(*across), 1e-6)
    end = other, chart.cell_weights(other.x, other.y)
    length = _path_length(chart, (own, ends[0]), end)
    length_to_opponent = _path_length(chart, end, (opponent, ends[1]))
    excess = own_length + length_to_opponent - length
    joint = excess / jnp.maximum(2 * jnp.minimum(own_length, length_to_opponent), 1e-6)
    numbers = [
        jnp.ones((), jnp.float32),
        (cos * dx + sin * dy) / far,
        (cos * dy - sin * dx) / far,
        *on_two_scales(distance),
        other.v * (cos * their_cos + sin * their_sin) / SPEED,
        other.v * (cos * their_sin - sin * their_cos) / SPEED,
        (away[0] * across[0] + away[1] * across[1]) / spread,
        (away[0] * across[1] - away[1] * across[0]) / spread,
        on_two_scales(length)[1],
        *on_two_scales(length_to_opponent),
        jnp.clip(joint, 0.0, 1.0),
    ]
    return jnp.where(robot.active, jnp.stack(numbers), 0.0)


TEAM = Team()
