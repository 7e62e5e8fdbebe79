"""Arenas: walls (Eq. 2), obstacles, and contact with them anywhere along a step."""

import functools
from collections import Counter

import jax.numpy as jnp

from apollonius.game.obstacle import AbstractObstacle, Walls, closest_approach_squared
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Edges, Polygon
from apollonius.game.types import Flag, Real, RobotState, Scalar
from apollonius.io import extensions
from apollonius.io.errors import require

MOST_POLYGONS = 500
"""Most polygons: each takes some time to compile."""
MOST_EDGES = 2_000
"""Most corners of all polygons together."""
MOST_DISCS = 250
"""Most discs: with this many, a game takes half a minute to compile."""


class Disc(AbstractObstacle):
    """A circular obstacle: centre (x, y) and radius [m]."""

    x: Real
    y: Real
    radius: Real

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point; negative inside."""
        return jnp.hypot(x - self.x, y - self.y) - self.radius

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Return the least clearance [m] on the segment between two states."""
        return jnp.sqrt(self._approach(before, after)) - self.radius

    def is_hit(self, before: RobotState, after: RobotState, radius: Real) -> Flag:
        """Check whether a body of this radius [m] touches it anywhere along the segment between
        two states.
        """
        return self._approach(before, after) < (self.radius + radius) ** 2

    def _approach(self, before: RobotState, after: RobotState) -> Scalar:
        dx, dy = after.x - before.x, after.y - before.y
        return closest_approach_squared(before.x - self.x, before.y - self.y, dx, dy)

    def check(self, name: str, walls: Walls) -> None:
        """Refuse a radius of 0 or less, and a centre outside the walls."""
        require(
            self.radius > 0,
            f"{name}.radius",
            self.radius,
            "more than 0 m; remove the disc to have none",
        )
        bound = f"inside the walls {walls.sides}; move or remove the disc"
        require(walls.enclose(self.x, self.y), f"{name} centre", (self.x, self.y), bound)


class Arena(Walls):
    """Walls with obstacles between them. Only the numbers of obstacles and of their corners are
    static.

    Attributes:
        map: cells that are obstacles, or None.
        territory: where the evader wins and does not start, or None.
        extra: obstacles of other kinds, each in a file's table of its kind (`register_obstacle`).
    """

    discs: tuple[Disc, ...] = ()
    polygons: tuple[Polygon, ...] = ()
    map: OccupancyMap | None = None
    territory: Disc | None = None
    extra: tuple[AbstractObstacle, ...] = ()

    @property
    def named_obstacles(self) -> dict[str, AbstractObstacle]:
        """All obstacles by their names in a game's file: discs, polygons, the map, and those of
        other kinds.
        """
        obstacles: dict[str, AbstractObstacle] = {
            f"arena.discs[{index}]": obstacle for index, obstacle in enumerate(self.discs)
        }
        obstacles |= {
            f"arena.polygons[{index}]": obstacle for index, obstacle in enumerate(self.polygons)
        }
        if self.map is not None:
            obstacles["arena.map"] = self.map
        counts = Counter[str]()
        for obstacle in self.extra:
            table = table_of(type(obstacle)) or "extra"
            obstacles[f"arena.{table}[{counts[table]}]"] = obstacle
            counts[table] += 1
        return obstacles

    @property
    def obstacles(self) -> tuple[AbstractObstacle, ...]:
        return tuple(self.named_obstacles.values())

    @property
    def _merged(self) -> list[AbstractObstacle]:
        """The obstacles, with all polygons as one: that costs less than each alone."""
        unmerged: list[AbstractObstacle] = [
            obstacle for obstacle in self.obstacles if not isinstance(obstacle, Polygon)
        ]
        return [*unmerged, Edges.of(self.polygons)] if self.polygons else unmerged

    def check(self) -> None:
        """Refuse walls, obstacles and a territory that cannot be."""
        require(
            self.x_min < self.x_max, "arena.x_min", self.x_min, f"less than x_max = {self.x_max} m"
        )
        require(
            self.y_min < self.y_max, "arena.y_min", self.y_min, f"less than y_max = {self.y_max} m"
        )
        corners = sum(len(polygon.vertices) for polygon in self.polygons)
        for name, count, unit, most in (
            ("discs", len(self.discs), "discs", MOST_DISCS),
            ("polygons", len(self.polygons), "polygons", MOST_POLYGONS),
            ("polygons", corners, "corners in all", MOST_EDGES),
        ):
            bound = f"at most {most}; draw the obstacles as an occupancy map"
            require(count <= most, f"arena.{name}", f"{count:,} {unit}", bound)
        for name, obstacle in self.named_obstacles.items():
            obstacle.check(name, self)
        if self.territory:
            self.territory.check("arena.territory", self)

    def require_only(self, kinds: tuple[type[AbstractObstacle], ...], bound: str) -> None:
        """Refuse other kinds of obstacles than these."""
        foreign = [obstacle for obstacle in self.obstacles if not isinstance(obstacle, kinds)]
        names = sorted({type(obstacle).__name__ for obstacle in foreign})
        require(not foreign, "obstacles", ", ".join(names), bound)

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Return the distance [m] from a point to the nearest wall or obstacle; negative beyond."""
        return functools.reduce(
            jnp.minimum,
            [obstacle.clearance(x, y) for obstacle in self._merged],
            self._to_walls(x, y),
        )

    def is_clear(self, x: Scalar, y: Scalar, distance: Real, matters: Flag | bool = True) -> Flag:
        """Check whether walls and obstacles are at least a distance [m] away from a point; where it
        does not matter, the answer may be wrong.
        """
        del matters
        return self.clearance(x, y) >= distance

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Return the least clearance [m] on the segment between two states."""
        least = jnp.minimum(self._to_walls(before.x, before.y), self._to_walls(after.x, after.y))
        return functools.reduce(
            jnp.minimum,
            [obstacle.clearance_along(before, after) for obstacle in self._merged],
            least,
        )

    def _to_walls(self, x: Scalar, y: Scalar) -> Scalar:
        return jnp.minimum(
            jnp.minimum(x - self.x_min, self.x_max - x), jnp.minimum(y - self.y_min, self.y_max - y)
        )

    def hits_obstacle(self, before: RobotState, after: RobotState, radius: Real) -> Flag:
        """Check whether a body of this radius [m] touches an obstacle anywhere along a straight
        step.
        """
        hits = [obstacle.is_hit(before, after, radius) for obstacle in self._merged]
        return functools.reduce(jnp.logical_or, hits, jnp.zeros((), bool))

    def hides(self, observer: RobotState, target: RobotState) -> Flag:
        """Check whether an obstacle is in the line of sight between two robots' centres."""
        blocked = [obstacle.hides(observer, target) for obstacle in self._merged]
        return functools.reduce(jnp.logical_or, blocked, jnp.zeros((), bool))

    def reaches_territory(self, before: RobotState, after: RobotState) -> Flag:
        """Check whether a robot's centre enters the territory anywhere along the segment between
        two states.
        """
        assert self.territory is not None, "callers look first"
        return self.territory.is_hit(before, after, 0.0)

    def is_out_of_range(self, after: RobotState, radius: Real) -> Flag:
        """Check whether a body of this radius [m] reaches beyond a wall (Eq. 2).

        The walls bound a convex region, so a segment that starts inside leaves it only if its end
        does.
        """
        return (
            (after.x - radius < self.x_min)
            | (after.x + radius > self.x_max)
            | (after.y - radius < self.y_min)
            | (after.y + radius > self.y_max)
        )


_KINDS: dict[str, type[AbstractObstacle]] = {}
"""Kinds of obstacles of other packages by the names of their tables in game files."""
_KIND = "a class of obstacles, an AbstractObstacle"


def register_obstacle(table: str, kind: type[AbstractObstacle]) -> None:
    """Make a kind of obstacles known to game files, by the name of its table: `capsules` for
    `[[arena.capsules]]`.

    Raises InvalidInput if an arena has a field of this name, or another kind has it.
    """
    is_free = table not in Arena.__dataclass_fields__ and _KINDS.get(table, kind) is kind
    require(
        table.isidentifier() and is_free,
        "table",
        table,
        "a word that names no other part of an arena",
    )
    _KINDS[table] = kind


def find_obstacle_kind(table: str) -> type[AbstractObstacle] | None:
    """Return the kind of obstacles of a table, registered or of an entry point
    `apollonius.obstacles`, or None.

    Raises InvalidInput for a broken one of another package.
    """
    if table not in _KINDS:
        kind = extensions.load_extension(extensions.OBSTACLES, table, _KIND)
        if kind is None:
            return None
        if not isinstance(kind, type) or not issubclass(kind, AbstractObstacle):
            raise extensions.unfit_extension(extensions.OBSTACLES, table, _KIND, kind)
        register_obstacle(table, kind)
    return _KINDS[table]


def table_of(kind: type[AbstractObstacle]) -> str | None:
    """Return the name of the table of a kind of obstacles in game files; None if it has none."""
    return next((table for table, other in _KINDS.items() if other is kind), None)
