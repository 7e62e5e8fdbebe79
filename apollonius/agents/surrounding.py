"""Pursuers that surround the evader as a team: by the area that is left to it, and by their
bearings around it.

Each decides for itself, by what it sees of its mates. Path lengths and cells are those of the
arena's chart, so that obstacles count. Lengths in their rules are on the scale of the paper's
robots.
"""

from abc import abstractmethod
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.agents.classical import AbstractSteering, direction
from apollonius.agents.guidance import arc_speed
from apollonius.game.chart import NO_PATH, Chart
from apollonius.game.dynamics import wrap_angle
from apollonius.game.game import Game
from apollonius.game.teams import separation
from apollonius.game.types import RobotState, Scalar
from apollonius.observe.view import Robot, View

_DIRECTIONS = 16
"""Directions in which it is looked ahead."""
_SHARPNESS = 8
"""Exponent of the weights of directions: a larger one favours the best direction more."""
_EVEN = 1e-3
"""Costs that differ by less are the same but for rounding: no path leads to where it would go."""
_POINTS = 20
"""Points along a side of the arena up to which paths are compared, or a few more."""
_AHEAD = 0.75
"""Distance of the places ahead that it compares [m]."""
_NEAR = 1.6
"""Path length to the evader [m] from which on a pursuer heads straight for it."""
_CLOSING = 0.7
"""Radius of the circle to be on, as a share of the pursuers' mean distance from the evader."""
_PATH_WEIGHT = 0.2
"""Weight of the path length to the evader next to the area [m]: it decides where nothing can be
done about the area.
"""

Cost = Callable[[Scalar, Scalar], Scalar]


class AbstractSurrounding(AbstractSteering):
    """A pursuer of a team that goes where its cost falls; near the evader, where it does not fall,
    straight at it.
    """

    misfit = "pursuers", "1", "2 at least, who surround an evader: as team-2v1"

    @property
    def needs_chart(self) -> bool:
        return True

    @classmethod
    def fits(cls, game: Game) -> bool:
        return len(game.bodies.pursuer) > 1

    def course(self, view: View) -> tuple[Scalar, Scalar]:
        """Return the direction of the falling cost, and the speed that the turn still to be made
        allows.
        """
        own = view.own.state
        body = view.own.body
        opponent = view.opponent.state
        angles = jnp.arange(_DIRECTIONS, dtype=jnp.float32) * (2 * jnp.pi / _DIRECTIONS)
        cos, sin = jnp.cos(angles), jnp.sin(angles)
        look = jax.vmap(view.chart.range, in_axes=(None, None, 0, 0))
        ranges = look(own.x, own.y, cos, sin) - body.radius
        reach = jnp.clip(ranges, 0.0, jnp.full(_DIRECTIONS, _AHEAD, jnp.float32))
        costs = jax.vmap(self.cost(view))(own.x + reach * cos, own.y + reach * sin)
        # A mean of the directions: of a cost that falls evenly it is just the direction in which it
        # falls.
        worst, best = jnp.max(costs), jnp.min(costs)
        weights = ((worst - costs) / jnp.maximum(worst - best, _EVEN)) ** _SHARPNESS
        downwards = jnp.arctan2(jnp.sum(weights * sin), jnp.sum(weights * cos))
        is_near = path_length_to(view, opponent)(own.x, own.y) < _NEAR
        goes_straight = is_near | (worst - best < _EVEN)
        heading = jnp.where(goes_straight, direction(own, opponent), downwards)
        # The part of the wanted velocity that a robot which cannot move sideways can have now.
        turning = body.v_max * jnp.maximum(jnp.cos(wrap_angle(heading - own.heading)), 0.0)
        return heading, jnp.where(goes_straight, arc_speed(body, own, opponent), turning)

    @abstractmethod
    def cost(self, view: View) -> Cost:
        """Return the cost of being at a point x, y [m]."""


class VoronoiPursuit(AbstractSurrounding):
    """Shrinks the part of the arena that the nearest evader reaches first: its cell among the
    pursuers' Voronoi cells.

    Each pursuer goes where that area falls most, taking the others to stand. Without obstacles and
    between equally fast robots that is straight to the middle of the edge between its cell and the
    evader's, and the evader cannot but be caught (Huang, Zhang, Ding, Stipanovic and Tomlin,
    "Guaranteed decentralized pursuit-evasion in the plane with multiple pursuers", CDC 2011). A
    pursuer whose cell is not beside the evader's goes to it (Pierson, Wang and Schwager,
    "Intercepting rogue robots", RA-L 2017). Here cells are by shortest paths, over the robots' top
    speeds.
    """

    def cost(self, view: View) -> Cost:
        """Return the area [m^2], and a little of the path to the evader [m]."""
        evader, mates = view.opponent, view.mates
        evader_lengths = path_lengths_from(view, evader)
        is_reachable = evader_lengths < NO_PATH / 100
        chart = view.chart
        cell = (chart.side[chart.member] * _stride(chart) / chart.columns) ** 2
        blur = jnp.sqrt(cell) / view.own.body.v_max
        deadline = jnp.full(evader_lengths.shape, jnp.inf)
        for mate in mates:
            deadline = jnp.minimum(
                deadline,
                jnp.where(mate.active, path_lengths_from(view, mate) / mate.body.v_max, jnp.inf),
            )
        path_length = path_length_to(view, evader.state)

        def cost(x: Scalar, y: Scalar) -> Scalar:
            state = view.own.state
            own = Robot(view.own.body, RobotState(x, y, state.v, state.heading))
            arrival = jnp.minimum(deadline, path_lengths_from(view, own) / own.body.v_max)
            lead = arrival - evader_lengths / evader.body.v_max
            area = cell * jnp.sum(jnp.where(is_reachable, jax.nn.sigmoid(lead / blur), 0.0))
            return area + _PATH_WEIGHT * path_length(x, y)

        return cost


class Encirclement(AbstractSurrounding):
    """Takes its own bearing around the nearest evader, evenly apart from its mates', and closes in
    on it.

    The formation of target capturing by cyclic pursuit (Kim and Sugie, "Cooperative control for
    target-capturing task based on a cyclic pursuit strategy", Automatica 2007), around an evader
    that moves: bearings keep their order and are turned together, so that all together have as
    little to turn as can be.
    """

    def cost(self, view: View) -> Cost:
        """Return the length of the path to its own bearing [m]."""
        evader = view.opponent.state
        team = [view.own, *view.mates]
        active = jnp.stack([jnp.asarray(robot.active) for robot in team])
        bearings = jnp.stack([direction(evader, robot.state) for robot in team])
        distances = jnp.stack([separation(evader, robot.state) for robot in team])
        count = jnp.maximum(jnp.sum(active.astype(jnp.float32)), 1.0)
        bearing = even_bearings(bearings, active)[0]
        radius = _CLOSING * jnp.sum(jnp.where(active, distances, 0.0)) / count
        arena = view.arena
        x = jnp.clip(evader.x + radius * jnp.cos(bearing), arena.x_min, arena.x_max)
        y = jnp.clip(evader.y + radius * jnp.sin(bearing), arena.y_min, arena.y_max)
        return path_length_to(view, RobotState(x, y, evader.v, evader.heading))


def even_bearings(
    bearings: Float[Array, " robots"], active: Bool[Array, " robots"]
) -> Float[Array, " robots"]:
    """Return the evenly spaced bearings [rad], in the same order, nearest to those of the active
    robots.
    """
    count = jnp.maximum(jnp.sum(active.astype(jnp.float32)), 1.0)
    before = active[None, :] & (bearings[None, :] < bearings[:, None])
    slots = jnp.sum(before.astype(jnp.float32), axis=1) * (2 * jnp.pi / count)
    offsets = bearings - slots
    sines, cosines = jnp.sin(offsets), jnp.cos(offsets)
    sin, cos = (jnp.sum(jnp.where(active, part, 0.0)) for part in (sines, cosines))
    return slots + jnp.arctan2(sin, cos)


def path_length_to(view: View, end: RobotState) -> Cost:
    """Return the length [m] of the path from a point to a robot."""
    chart, end_weights = view.chart, view.chart.cell_weights(end.x, end.y)
    return lambda x, y: chart.path_length(chart.cell_weights(x, y), end_weights)


def path_lengths_from(view: View, robot: Robot) -> Float[Array, " places"]:
    """Return the lengths [m] of the paths from a robot to points all over the arena, huge where it
    cannot be.
    """
    chart = view.chart
    cells, weights = chart.cell_weights(robot.state.x, robot.state.y)
    return weights @ (chart.lengths_between(cells, place_cells(chart)) / 100)


def place_cells(chart: Chart) -> Int[Array, " places"]:
    """Return the coarse cells in whose middles these points are."""
    numbers = jnp.arange(0, chart.columns, _stride(chart))
    return (numbers[:, None] * chart.columns + numbers[None, :]).ravel()


def _stride(chart: Chart) -> int:
    """Return the coarse cells from one of these points to the next."""
    return chart.columns // _POINTS
