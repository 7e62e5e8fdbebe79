"""A game under way, seen from above, with walls, obstacles, trails and robots; or several side by side. Only Pillow."""

import io
from collections.abc import Mapping, Sequence
from math import cos, hypot, sin
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.types import Role
from apollonius.io.document import write_atomically
from apollonius.show.palette import EVADER, INK, OBSTACLE, PAPER, PURSUER
from apollonius.show.parts import Round, Straight, robots_of, shapes

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

    A pursuer is a full disc with a solid trail, and around it the reach of a capture is dotted; an evader is a ring
    with a dashed trail: they can be told apart without colours. Robots of a team have their numbers, and one that is
    out of play is a cross.
    """

    def __init__(self, game: Game) -> None:
        self._arena = arena = game.arena
        self._reach = float(game.capture_distance)
        self._length = max(float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min))
        self._robots = robots_of(game)
        self._radii = [max(robot.radius, _SMALLEST * self._length) for robot in self._robots]
        self.scale = SIZE / self._length
        """Pixels of a metre in the picture."""
        sides = (arena.x_max - arena.x_min, arena.y_max - arena.y_min)
        size = [round(float(side) * self.scale) * _FINER for side in sides]
        self._empty = Image.new("RGB", (size[0], size[1]), PAPER)
        draw = ImageDraw.Draw(self._empty)
        if arena.map:
            self._cells(arena.map)
        for shape in shapes(arena):
            self._draw(draw, shape)
        self.wipe()

    def wipe(self) -> None:
        self._trails = self._empty.copy()
        self._shown = self._trails.reduce(_FINER)
        self._here: list[Sequence[float]] = []
        self._active: Sequence[bool] = ()
        self._driven = [0.0] * len(self._robots)

    def move(self, robots: Sequence[float], active: Sequence[bool] | None = None) -> None:
        """Where all robots are now; from the second time on they have left a piece of trail.

        Args:
            robots: x [m], y [m], v [m/s], heading [rad] of each pursuer, then of each evader.
            active: which of them are in play; all, if it is not said.
        """
        here = [robots[first : first + 4] for first in range(0, 4 * len(self._robots), 4)]
        draw = ImageDraw.Draw(self._trails)
        for index, (before, after) in enumerate(zip(self._here, here, strict=False)):
            length = hypot(after[0] - before[0], after[1] - before[1])
            self._driven[index] += length
            if self._robots[index].role and self._driven[index] // (_DASH * self._length) % 2:
                continue
            ends = [self._pixel(before[0], before[1]), self._pixel(after[0], after[1])]
            draw.line(ends, fill=self._robots[index].colour, width=2 * _FINER, joint="curve")
            self._average(self._shown, self._around(after[0], after[1], length))
        self._here, self._active = here, [True] * len(here) if active is None else active

    def picture(self) -> Image.Image:
        """The game as it stands; an empty arena where none has begun."""
        picture = self._shown.copy()
        if self._here:
            # Only what lies around the robots is drawn anew, and then as it was before.
            boxes = [
                self._around(place[0], place[1], 2 * radius if robot.role else max(self._reach, 2 * radius))
                for robot, radius, place in zip(self._robots, self._radii, self._here, strict=True)
            ]
            before = [self._trails.crop(box) for box in boxes]
            self._draw_robots(ImageDraw.Draw(self._trails))
            for box in boxes:
                self._average(picture, box)
            for box, there in zip(boxes, before, strict=True):
                self._trails.paste(there, box)
        return picture

    def _draw_robots(self, draw: ImageDraw.ImageDraw) -> None:
        """All as they stand, those out of play below, with headings, and around pursuers the reach of a capture."""
        robots = list(zip(self._active, self._robots, self._radii, self._here, strict=True))
        for active, robot, size, (x, y, *_) in robots:
            if not active:
                draw_cross(draw, self._pixel(x, y), size * self.scale * _FINER, robot.colour)
            elif robot.role == Role.PURSUER:
                draw_reach(draw, self._pixel(x, y), self._reach * self.scale * _FINER, _FINER)
        for active, robot, size, (x, y, _, heading) in robots:
            if active:
                here, nose = self._pixel(x, y), self._pixel(x + 2 * size * cos(heading), y + 2 * size * sin(heading))
                draw.line([here, nose], fill=robot.colour, width=3 * _FINER)
                draw_robot(draw, here, size * self.scale * _FINER, robot.role, robot.mark)

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


def draw_robot(
    draw: ImageDraw.ImageDraw, centre: tuple[float, float], radius: float, role: Role, mark: str = ""
) -> None:
    """The sign of a pursuer, a full disc, or of an evader, a ring, and in it its mark; in pixels."""
    if role == Role.PURSUER:
        draw.ellipse(_square(centre, radius), fill=PURSUER)
    else:
        draw.ellipse(_square(centre, radius), fill=PAPER, outline=EVADER, width=round((0.3 if mark else 0.6) * radius))
    if mark:
        font = ImageFont.load_default(round(1.4 * radius))
        draw.text(centre, mark, fill=EVADER if role else PAPER, font=font, anchor="mm")


def draw_cross(draw: ImageDraw.ImageDraw, centre: tuple[float, float], radius: float, colour: str) -> None:
    """The sign of a robot that is out of play; in pixels."""
    left, top, right, bottom = _square(centre, 0.8 * radius)
    for ends in ([(left, top), (right, bottom)], [(left, bottom), (right, top)]):
        draw.line(ends, fill=colour, width=round(0.4 * radius))


def draw_reach(draw: ImageDraw.ImageDraw, centre: tuple[float, float], radius: float, width: int) -> None:
    """The reach of a capture, dotted; in pixels."""
    for angle in range(0, 360, 30):
        draw.arc(_square(centre, radius), angle, angle + 15, fill=PURSUER, width=width)


def _square(centre: tuple[float, float], reach: float) -> tuple[float, float, float, float]:
    return centre[0] - reach, centre[1] - reach, centre[0] + reach, centre[1] + reach


_SIDE = 240
"""Pixels of a drawing's longer side."""
_GAP = 16
_LETTERS = 15
"""Height of a name [pixels]."""
_COLUMNS = 4


def save_gallery(games: Mapping[str, Game], path: Path, columns: int = _COLUMNS) -> None:
    """Write a picture of games' arenas, so many side by side, each with its name and its size below."""
    width, height = _SIDE + _GAP, _SIDE + 2 * _GAP + _LETTERS
    rows = -(-len(games) // columns)
    whole = Image.new("RGB", (min(len(games), columns) * width + _GAP, rows * height + _GAP), PAPER)
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(_LETTERS)
    for number, (name, game) in enumerate(games.items()):
        left, top = _GAP + number % columns * width, _GAP + number // columns * height
        drawing = Canvas(game).picture()
        drawing.thumbnail((_SIDE, _SIDE), Image.Resampling.BOX)
        whole.paste(drawing, (left, top + _SIDE - drawing.height))
        arena = game.arena
        size = f"{float(arena.x_max - arena.x_min):.4g} x {float(arena.y_max - arena.y_min):.4g} m"
        below = top + _SIDE + _GAP // 3
        draw.text((left, below), f"{name}, {size}", fill=INK, font=font)
    content = io.BytesIO()
    whole.save(content, "PNG", optimize=True)
    write_atomically(path, content.getvalue())
