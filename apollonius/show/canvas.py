"""A game under way, seen from above: walls, obstacles, both trails, robots and headings. Needs Pillow only."""

from collections.abc import Sequence
from math import cos, hypot, sin

import numpy as np
from PIL import Image, ImageDraw

from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.show.palette import EVADER, OBSTACLE, PAPER, PURSUER
from apollonius.show.shapes import Round, Straight, shapes

SIZE = 480
"""Pixels of the picture's longer side."""
_FINER = 2
"""Pixels are drawn this many times finer, then averaged."""
_SMALLEST = 0.014
"""Least radius of a robot's sign, as a share of the arena's longer side."""
_DASH = 0.02
"""Length of the evader's dashes, and of the gaps between them, as a share of the arena's longer side."""


class Canvas:
    """The arena of a game, on which its robots leave trails as they move.

    The pursuer is a full disc with a solid trail, and around it the reach of a capture is dotted; the evader is a ring
    with a dashed trail: they can be told apart without colours.
    """

    def __init__(self, game: Game) -> None:
        game.require_two("a picture")
        self._arena = arena = game.arena
        self._reach = float(game.capture_distance)
        self._length = max(float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min))
        self._radii = [max(float(body.radius), _SMALLEST * self._length) for body in (game.pursuer, game.evader)]
        self.scale = SIZE / self._length
        """Pixels of a metre in the picture."""
        size = [round(float(side) * self.scale) * _FINER for side in self._sides()]
        self._empty = Image.new("RGB", (size[0], size[1]), PAPER)
        draw = ImageDraw.Draw(self._empty)
        if arena.map:
            self._cells(arena.map)
        for shape in shapes(arena):
            self._draw(draw, shape)
        self.wipe()

    def wipe(self) -> None:
        """Forget the trails, for another game."""
        self._trails = self._empty.copy()
        self._shown = self._trails.reduce(_FINER)
        self._here: Sequence[float] = ()
        self._driven = 0.0

    def move(self, robots: Sequence[float]) -> None:
        """Where both robots are now; from the second time on they have left a piece of trail.

        Args:
            robots: x [m], y [m], v [m/s], heading [rad] of the pursuer, then of the evader.
        """
        if self._here:
            draw = ImageDraw.Draw(self._trails)
            for index, colour in enumerate((PURSUER, EVADER)):
                before, after = self._here[4 * index :][:2], robots[4 * index :][:2]
                if index == 1:
                    self._driven += hypot(after[0] - before[0], after[1] - before[1])
                    if self._driven // (_DASH * self._length) % 2:
                        continue
                draw.line(
                    [self._pixel(before[0], before[1]), self._pixel(after[0], after[1])],
                    fill=colour,
                    width=2 * _FINER,
                    joint="curve",
                )
                self._average(
                    self._shown, self._around(after[0], after[1], hypot(after[0] - before[0], after[1] - before[1]))
                )
        self._here = robots

    def picture(self) -> Image.Image:
        """The game as it stands; an empty arena where none has begun."""
        picture = self._shown.copy()
        if self._here:
            # Only what lies around the robots is drawn anew, and then as it was before.
            reaches = (max(self._reach, 2 * self._radii[0]), 2 * self._radii[1])
            places = [self._here[4 * index :][:2] for index in range(2)]
            boxes = [self._around(place[0], place[1], reach) for place, reach in zip(places, reaches, strict=True)]
            before = [self._trails.crop(box) for box in boxes]
            self._draw_robots(ImageDraw.Draw(self._trails))
            for box in boxes:
                self._average(picture, box)
            for box, there in zip(boxes, before, strict=True):
                self._trails.paste(there, box)
        return picture

    def _draw_robots(self, draw: ImageDraw.ImageDraw) -> None:
        """Both as they stand, with their headings, and around the pursuer the reach of a capture."""
        draw_reach(draw, self._pixel(self._here[0], self._here[1]), self._reach * self.scale * _FINER, _FINER)
        for index, (colour, size) in enumerate(zip((PURSUER, EVADER), self._radii, strict=True)):
            x, y, _, heading = self._here[4 * index :][:4]
            here, nose = self._pixel(x, y), self._pixel(x + 2 * size * cos(heading), y + 2 * size * sin(heading))
            draw.line([here, nose], fill=colour, width=3 * _FINER)
            draw_robot(draw, here, size * self.scale * _FINER, index)

    def _around(self, x: float, y: float, reach: float) -> tuple[int, int, int, int]:
        """The box of whole pixels of the picture, in finer ones, that holds all lines up to so many metres away."""
        left, top, right, bottom = self._box(x, y, reach)
        ends = (left - 4 * _FINER, top - 4 * _FINER, right + 5 * _FINER, bottom + 5 * _FINER)
        width, height = self._trails.size
        limits = (width, height, width, height)
        a, b, c, d = (min(max(int(end // _FINER) * _FINER, 0), limit) for end, limit in zip(ends, limits, strict=True))
        return a, b, c, d

    def _average(self, picture: Image.Image, box: tuple[int, int, int, int]) -> None:
        """Renew what a picture shows of this box of finer pixels."""
        if box[0] < box[2] and box[1] < box[3]:
            picture.paste(self._trails.crop(box).reduce(_FINER), (box[0] // _FINER, box[1] // _FINER))

    def _sides(self) -> tuple[float, float]:
        return float(self._arena.x_max - self._arena.x_min), float(self._arena.y_max - self._arena.y_min)

    def _draw(self, draw: ImageDraw.ImageDraw, shape: Round | Straight) -> None:
        fill, outline = (shape.colour, None) if shape.filled else (None, shape.colour)
        if isinstance(shape, Round):
            draw.ellipse(self._box(shape.x, shape.y, shape.radius), fill, outline, 2 * _FINER)
        else:
            draw.polygon([self._pixel(x, y) for x, y in shape.corners], fill, outline, 2 * _FINER)

    def _cells(self, occupancy: OccupancyMap) -> None:
        """Occupied cells; the picture's own pixels may be coarser."""
        left, top = self._pixel(float(occupancy.x), float(occupancy.y_max))
        right, bottom = self._pixel(float(occupancy.x_max), float(occupancy.y))
        cells = Image.fromarray(np.ascontiguousarray(occupancy.occupied()[::-1]))
        size = (max(1, round(right - left)), max(1, round(bottom - top)))
        self._empty.paste(OBSTACLE, (round(left), round(top)), cells.convert("L").resize(size, Image.Resampling.BOX))

    def _pixel(self, x: float, y: float) -> tuple[float, float]:
        finer = self.scale * _FINER
        return (x - float(self._arena.x_min)) * finer, (float(self._arena.y_max) - y) * finer

    def _box(self, x: float, y: float, radius: float) -> tuple[float, float, float, float]:
        return _square(self._pixel(x, y), radius * self.scale * _FINER)


def draw_robot(draw: ImageDraw.ImageDraw, centre: tuple[float, float], radius: float, index: int) -> None:
    """The sign of the pursuer (0), a full disc, or of the evader (1), a ring; in pixels."""
    if index == 0:
        draw.ellipse(_square(centre, radius), fill=PURSUER)
    else:
        draw.ellipse(_square(centre, radius), fill=PAPER, outline=EVADER, width=round(0.6 * radius))


def draw_reach(draw: ImageDraw.ImageDraw, centre: tuple[float, float], radius: float, width: int) -> None:
    """The reach of a capture, dotted; in pixels."""
    for angle in range(0, 360, 30):
        draw.arc(_square(centre, radius), angle, angle + 15, fill=PURSUER, width=width)


def _square(centre: tuple[float, float], reach: float) -> tuple[float, float, float, float]:
    return centre[0] - reach, centre[1] - reach, centre[0] + reach, centre[1] + reach
