"""A game under way, seen from above: walls, obstacles, both trails, robots and headings. Needs Pillow only."""

from collections.abc import Sequence
from math import cos, sin

import numpy as np
from PIL import Image, ImageDraw

from apollonius.game.arena import Disc
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.show.palette import EVADER, INK, OBSTACLE, PAPER, PURSUER

SIZE = 480
"""Pixels of the picture's longer side."""
_FINER = 2
"""Pixels are drawn this many times finer, then averaged."""


class Canvas:
    """The arena of a game, on which its robots leave trails as they move."""

    def __init__(self, game: Game) -> None:
        self._arena = arena = game.arena
        self._robots = ((PURSUER, float(game.pursuer.radius)), (EVADER, float(game.evader.radius)))
        self._length = max(float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min))
        self._scale = SIZE * _FINER / self._length
        size = (float(arena.x_max - arena.x_min) * self._scale, float(arena.y_max - arena.y_min) * self._scale)
        self._empty = Image.new("RGB", (round(size[0]), round(size[1])), PAPER)
        draw = ImageDraw.Draw(self._empty)
        if arena.map:
            self._cells(arena.map)
        for obstacle in arena.discs:
            self._disc(draw, float(obstacle.x), float(obstacle.y), float(obstacle.radius), OBSTACLE)
        for polygon in arena.polygons:
            draw.polygon([self._pixel(float(x), float(y)) for x, y in polygon.vertices], fill=OBSTACLE)
        if arena.territory:
            self._ring(draw, arena.territory)
        draw.rectangle((0, 0, self._empty.width - 1, self._empty.height - 1), outline=INK, width=2 * _FINER)
        self.wipe()

    def wipe(self) -> None:
        """Forget the trails, for another game."""
        self._trails = self._empty.copy()
        self._here: Sequence[float] = ()

    def move(self, robots: Sequence[float]) -> None:
        """Where both robots are now; from the second time on they have left a piece of trail.

        Args:
            robots: x [m], y [m], v [m/s], heading [rad] of the pursuer, then of the evader.
        """
        draw = ImageDraw.Draw(self._trails)
        for index, (colour, _) in enumerate(self._robots if self._here else ()):
            ends = [self._pixel(*place[4 * index : 4 * index + 2]) for place in (self._here, robots)]
            draw.line(ends, fill=colour, width=2 * _FINER, joint="curve")
        self._here = robots

    def picture(self) -> Image.Image:
        """The game as it stands; an empty arena where none has begun."""
        picture = self._trails.copy()
        draw = ImageDraw.Draw(picture)
        for index, (colour, body) in enumerate(self._robots if self._here else ()):
            x, y, _, heading = self._here[4 * index : 4 * index + 4]
            size = max(body, 0.012 * self._length)
            self._disc(draw, x, y, size, colour)
            nose = self._pixel(x + 2 * size * cos(heading), y + 2 * size * sin(heading))
            draw.line([self._pixel(x, y), nose], fill=colour, width=3 * _FINER)
        return picture.reduce(_FINER)

    def _ring(self, draw: ImageDraw.ImageDraw, goal: Disc) -> None:
        """The edge of the territory, in the colour of who would reach it."""
        column, row = self._pixel(float(goal.x), float(goal.y))
        reach = float(goal.radius) * self._scale
        draw.ellipse((column - reach, row - reach, column + reach, row + reach), outline=EVADER, width=2 * _FINER)

    def _cells(self, occupancy: OccupancyMap) -> None:
        """Occupied cells; the picture's own pixels may be coarser."""
        left, top = self._pixel(float(occupancy.x), float(occupancy.y_max))
        right, bottom = self._pixel(float(occupancy.x_max), float(occupancy.y))
        cells = Image.fromarray(np.ascontiguousarray(occupancy.occupied()[::-1]))
        size = (max(1, round(right - left)), max(1, round(bottom - top)))
        self._empty.paste(OBSTACLE, (round(left), round(top)), cells.convert("L").resize(size, Image.Resampling.BOX))

    def _pixel(self, x: float, y: float) -> tuple[float, float]:
        return (x - float(self._arena.x_min)) * self._scale, (float(self._arena.y_max) - y) * self._scale

    def _disc(self, draw: ImageDraw.ImageDraw, x: float, y: float, radius: float, colour: str) -> None:
        column, row = self._pixel(x, y)
        reach = radius * self._scale
        draw.ellipse((column - reach, row - reach, column + reach, row + reach), fill=colour)
