"""A picture that Pillow draws: an arena from above with trails and robots."""

from collections.abc import Sequence
from math import cos, pi, sin

import numpy as np
from jaxtyping import Bool
from PIL import Image, ImageDraw, ImageFont

from apollonius.game.arena import Arena, Disc
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.types import Role
from apollonius.show.palette import EVADER, INK, OBSTACLE, OTHER, PAPER, PURSUER, SIDES

WIDTH, HEIGHT = 1120, 640
"""Most pixels of the picture along x and y."""
_FINER = 2
"""Pixels are drawn this many times finer, then averaged."""
_SMALLEST = 0.018
"""Least radius of a robot's sign, as a share of the arena's longer side."""
_SHADE = 64
"""Share of the colour in a shade, of 255."""
_CORNERS = 96
"""Corners of a circle."""

Point = tuple[float, float]


def shapes(arena: Arena) -> list[tuple[list[Point], str, bool]]:
    """Return the obstacles, the territory and the walls of an arena, without the cells of a map.

    Each shape has corners x, y [m], a colour, and whether it is filled; otherwise only its edge is
    drawn.
    """
    x, y, x_max, y_max = (
        float(end) for end in (arena.x_min, arena.y_min, arena.x_max, arena.y_max)
    )
    outlines = [
        _circle(obstacle) if isinstance(obstacle, Disc) else obstacle.outline()
        for obstacle in arena.obstacles
    ]
    polygons = [
        ([(float(x), float(y)) for x, y in outline], OBSTACLE, True)
        for outline in outlines
        if outline
    ]
    if arena.territory:
        polygons.append((_circle(arena.territory), EVADER, False))
    return [*polygons, ([(x, y), (x_max, y), (x_max, y_max), (x, y_max)], INK, False)]


def _circle(disc: Disc) -> list[Point]:
    x = float(disc.x)
    y = float(disc.y)
    radius = float(disc.radius)
    angles = [2 * pi * corner / _CORNERS for corner in range(_CORNERS)]
    return [(x + radius * cos(angle), y + radius * sin(angle)) for angle in angles]


class Canvas:
    """The arena of a game, on which its robots leave trails as they move, with the signs of the
    page (`draw.js`).

    A pursuer is an arrowhead in a ring, the reach of a capture; an evader is a disc with a nose, so
    that they differ without colours. Rings are starts. Robots of a team have their numbers, and one
    that is out of play is a cross. Movers are discs and capsules in a colour of their own, without
    trails.
    """

    def __init__(self, game: Game) -> None:
        self._arena = arena = game.arena
        self._reach = float(game.capture_distance)
        sides = (float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min))
        self._robots = [
            (
                role,
                str(number) if len(game.bodies[role]) > 1 else "",
                max(float(body.radius), _SMALLEST * max(sides)),
            )
            for role in Role
            for number, body in enumerate(game.bodies[role], start=1)
        ]
        bodies = game.movers and game.movers.bodies
        shapes_of_movers = (bodies.hx, bodies.hy, bodies.radius) if bodies else ((), (), ())
        self._movers = np.array(shapes_of_movers, float).T.tolist()
        scale = min(WIDTH / sides[0], HEIGHT / sides[1])
        width, height = (round(side * scale) * _FINER for side in sides)
        self._scale = scale * _FINER
        self._trails = Image.new("RGB", (width, height), PAPER)
        if arena.map:
            self._draw_cells(arena.map)
        draw = ImageDraw.Draw(self._trails)
        for corners, colour, is_filled in shapes(arena):
            fill, outline = (colour, None) if is_filled else (None, colour)
            draw.polygon([self._pixel(x, y) for x, y in corners], fill, outline, 2 * _FINER)
        self._here: list[Sequence[float]] = []
        self._active: Sequence[bool] = ()
        self._mover_places: Sequence[Sequence[float]] = ()

    def move(
        self,
        robots: Sequence[float],
        active: Sequence[bool],
        movers: Sequence[Sequence[float]] = (),
    ) -> None:
        """Move all robots, which are in play or not; from the second time on each leaves a piece of
        trail.

        A robot is x [m], y [m], v [m/s], heading [rad]; the pursuers come first. Movers are x [m],
        y [m] each.
        """
        self._mover_places = movers
        places = [robots[first : first + 4] for first in range(0, 4 * len(self._robots), 4)]
        draw, is_first = ImageDraw.Draw(self._trails), not self._here
        for (role, _, radius), before, after in zip(
            self._robots, self._here or places, places, strict=True
        ):
            if is_first:
                start = self._pixel(after[0], after[1])
                draw.circle(start, radius / 2 * self._scale, outline=SIDES[role], width=_FINER)
            ends = [self._pixel(before[0], before[1]), self._pixel(after[0], after[1])]
            draw.line(ends, fill=SIDES[role], width=2 * _FINER, joint="curve")
        self._here, self._active = places, active

    def picture(
        self, fog: tuple[Bool[np.ndarray, "rows columns"], Role] | None = None
    ) -> Image.Image:
        """Return the game as it stands, or an empty arena where no robot has moved yet.

        In fog cells of the square on the arena's lower left corner, the lowest row first, have a
        side's colour.
        """
        picture = self._trails.copy()
        if fog:
            (cells, role), side = fog, max(picture.size)
            mask = Image.fromarray(np.where(cells[::-1], _SHADE, 0).astype(np.uint8)).resize(
                (side, side)
            )
            picture.paste(SIDES[role], (0, picture.height - side), mask)
        draw, finer = ImageDraw.Draw(picture), self._scale
        for (hx, hy, radius), (x, y) in zip(self._movers, self._mover_places, strict=False):
            ends = [self._pixel(x - hx, y - hy), self._pixel(x + hx, y + hy)]
            draw.line(ends, fill=OTHER, width=round(2 * radius * finer))
            for end in ends:
                draw.circle(end, radius * finer, fill=OTHER)
        for active, (role, mark, radius), (x, y, _, heading) in zip(
            self._active, self._robots, self._here, strict=False
        ):
            centre = self._pixel(x, y)
            if not active:
                _draw_cross(draw, centre, radius * finer, SIDES[role])
                continue
            if role == Role.PURSUER:
                draw.circle(centre, self._reach * finer, outline=PURSUER, width=_FINER)
            draw_robot(draw, centre, radius * finer, role, heading)
            if mark:
                self._draw_mark(draw, mark, centre, radius * finer, SIDES[role])
        return picture.reduce(_FINER)

    def _draw_mark(
        self, draw: ImageDraw.ImageDraw, mark: str, centre: Point, radius: float, colour: str
    ) -> None:
        """Draw a number beside a robot, on the side of the arena's middle."""
        size, away = self._trails.size, 2.4 * radius
        x, y = (
            coordinate + (away if coordinate < side / 2 else -away)
            for coordinate, side in zip(centre, size, strict=True)
        )
        draw.text(
            (x, y), mark, fill=colour, font=ImageFont.load_default(round(2.2 * radius)), anchor="mm"
        )

    def _draw_cells(self, occupancy: OccupancyMap) -> None:
        """Draw occupied cells; the picture's own pixels may be coarser."""
        left, top = self._pixel(float(occupancy.x), float(occupancy.y_max))
        right, bottom = self._pixel(float(occupancy.x_max), float(occupancy.y))
        cells = Image.fromarray(np.ascontiguousarray(occupancy.occupied()[::-1]))
        size = (max(1, round(right - left)), max(1, round(bottom - top)))
        self._trails.paste(
            OBSTACLE,
            (round(left), round(top)),
            cells.convert("L").resize(size, Image.Resampling.BOX),
        )

    def _pixel(self, x: float, y: float) -> Point:
        return (x - float(self._arena.x_min)) * self._scale, (
            float(self._arena.y_max) - y
        ) * self._scale


_ARROWHEAD = ((1.4, 0.0), (1.2, 2.4), (0.4, pi), (1.2, -2.4))
"""Its corners: distance from the middle in radii, angle to the heading [rad]."""


def draw_robot(
    draw: ImageDraw.ImageDraw, centre: Point, radius: float, role: Role, heading: float = 0.0
) -> None:
    """Draw the sign of a pursuer, an arrowhead, or of an evader, a disc with a nose.

    Args:
        draw: The picture.
        centre: Its middle [pixels].
        radius: Its radius [pixels].
        role: The robot's side.
        heading: The robot's heading [rad].
    """

    def ahead(length: float, angle: float = 0.0) -> Point:
        x, y = cos(heading + angle), sin(heading + angle)
        return centre[0] + length * radius * x, centre[1] - length * radius * y

    if role == Role.PURSUER:
        draw.polygon([ahead(*corner) for corner in _ARROWHEAD], fill=PURSUER)
    else:
        draw.circle(centre, 0.8 * radius, fill=EVADER)
        draw.line([centre, ahead(1.7)], fill=EVADER, width=round(0.4 * radius))


def _draw_cross(draw: ImageDraw.ImageDraw, centre: Point, radius: float, colour: str) -> None:
    x, y = centre
    for sign in (-1, 1):
        ends = [(x - radius, y - sign * radius), (x + radius, y + sign * radius)]
        draw.line(ends, fill=colour, width=round(0.4 * radius))
