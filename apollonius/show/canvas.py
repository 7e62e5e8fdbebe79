"""Pictures that Pillow draws: an arena from above with trails and robots, and several pictures side by side."""

import io
from collections.abc import Mapping, Sequence
from math import cos, hypot, pi, sin
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool
from PIL import Image, ImageDraw, ImageFont

from apollonius.game.arena import Arena, Disc
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.types import Role
from apollonius.io.document import write_atomically
from apollonius.show.palette import EVADER, INK, OBSTACLE, PAPER, PURSUER

SIZE = 480
"""Pixels of the picture's longer side."""
_FINER = 2
"""Pixels are drawn this many times finer, then averaged."""
_SMALLEST = 0.014
"""Least radius of a robot's sign, as a share of the arena's longer side."""
_DASH = 0.02
"""Length of the evader's dashes, and of the gaps between them, as a share of the arena's longer side."""
_SHADE = 64
"""Share of the colour in a shade, of 255."""
_CORNERS = 96
"""Corners of a circle."""

Point = tuple[float, float]


class Shape(NamedTuple):
    """A shape of an arena: its corners x, y [m]; only its edge is drawn where it is not filled."""

    corners: Sequence[Point]
    colour: str
    filled: bool = True


def shapes(arena: Arena) -> list[Shape]:
    """Return the obstacles, the territory and the walls of an arena, without the cells of a map."""
    x, y, x_max, y_max = (float(end) for end in (arena.x_min, arena.y_min, arena.x_max, arena.y_max))
    outlines = [_circle(one) if isinstance(one, Disc) else one.outline() for one in arena.obstacles]
    found = [Shape([(float(x), float(y)) for x, y in outline], OBSTACLE) for outline in outlines if outline]
    if arena.territory:
        found.append(Shape(_circle(arena.territory), EVADER, filled=False))
    return [*found, Shape([(x, y), (x_max, y), (x_max, y_max), (x, y_max)], INK, filled=False)]


def _circle(disc: Disc) -> list[Point]:
    x, y, radius = float(disc.x), float(disc.y), float(disc.radius)
    angles = [2 * pi * corner / _CORNERS for corner in range(_CORNERS)]
    return [(x + radius * cos(angle), y + radius * sin(angle)) for angle in angles]


class Canvas:
    """The arena of a game, on which its robots leave trails as they move.

    A pursuer is a full disc with a solid trail, and around it the reach of a capture is dotted; an evader is a ring
    with a dashed trail, so that they differ without colours. Robots of a team have their numbers, and one that is
    out of play is a cross.
    """

    def __init__(self, game: Game) -> None:
        self._arena = arena = game.arena
        self._reach = float(game.capture_distance)
        sides = (float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min))
        self._length = max(sides)
        self._robots = [
            (role, str(number) if len(game.bodies[role]) > 1 else "", max(float(body.radius), _SMALLEST * self._length))
            for role in Role
            for number, body in enumerate(game.bodies[role], start=1)
        ]
        self.scale = SIZE / self._length
        """Pixels of a metre in the picture."""
        width, height = (round(side * self.scale) * _FINER for side in sides)
        self._trails = Image.new("RGB", (width, height), PAPER)
        if arena.map:
            self._draw_cells(arena.map)
        draw = ImageDraw.Draw(self._trails)
        for corners, colour, filled in shapes(arena):
            fill, outline = (colour, None) if filled else (None, colour)
            draw.polygon([self._pixel(x, y) for x, y in corners], fill, outline, 2 * _FINER)
        self._here: list[Sequence[float]] = []
        self._active: Sequence[bool] = ()
        self._driven = [0.0] * len(self._robots)

    def move(self, robots: Sequence[float], active: Sequence[bool]) -> None:
        """Move all robots; from the second time on each leaves a piece of trail.

        Args:
            robots: x [m], y [m], v [m/s], heading [rad] of each pursuer, then of each evader.
            active: for each robot, whether it is in play.
        """
        here = [robots[first : first + 4] for first in range(0, 4 * len(self._robots), 4)]
        draw = ImageDraw.Draw(self._trails)
        for index, (before, after) in enumerate(zip(self._here, here, strict=False)):
            role = self._robots[index][0]
            self._driven[index] += hypot(after[0] - before[0], after[1] - before[1])
            if not role or self._driven[index] // (_DASH * self._length) % 2 == 0:
                ends = [self._pixel(before[0], before[1]), self._pixel(after[0], after[1])]
                draw.line(ends, fill=_COLOURS[role], width=2 * _FINER, joint="curve")
        self._here, self._active = here, active

    def picture(self, fog: tuple[Bool[np.ndarray, "rows columns"], Role] | None = None) -> Image.Image:
        """Return the game as it stands, or an empty arena where no robot has moved yet.

        Args:
            fog: cells of the square on the arena's lower left corner, its lowest row first, that are shaded, and the
                side in whose colour.
        """
        picture = self._trails.copy()
        if fog:
            self._shade(picture, *fog)
        self._draw_robots(ImageDraw.Draw(picture))
        return picture.reduce(_FINER)

    def _draw_robots(self, draw: ImageDraw.ImageDraw) -> None:
        finer, robots = self.scale * _FINER, list(zip(self._active, self._robots, self._here, strict=False))
        for active, (role, _, radius), (x, y, *_) in robots:
            if not active:
                _draw_cross(draw, self._pixel(x, y), radius * finer, _COLOURS[role])
            elif role == Role.PURSUER:
                draw_reach(draw, self._pixel(x, y), self._reach * finer, _FINER)
        for active, (role, mark, radius), (x, y, _, heading) in robots:
            if active:
                nose = self._pixel(x + 2 * radius * cos(heading), y + 2 * radius * sin(heading))
                draw.line([self._pixel(x, y), nose], fill=_COLOURS[role], width=3 * _FINER)
                draw_robot(draw, self._pixel(x, y), radius * finer, role, mark)

    def _shade(self, picture: Image.Image, cells: Bool[np.ndarray, "rows columns"], role: Role) -> None:
        side = round(self._length * self.scale) * _FINER
        mask = Image.fromarray(np.where(cells[::-1], _SHADE, 0).astype(np.uint8)).resize((side, side))
        picture.paste(_COLOURS[role], (0, picture.height - side), mask)

    def _draw_cells(self, occupancy: OccupancyMap) -> None:
        """Draw occupied cells; the picture's own pixels may be coarser."""
        left, top = self._pixel(float(occupancy.x), float(occupancy.y_max))
        right, bottom = self._pixel(float(occupancy.x_max), float(occupancy.y))
        cells = Image.fromarray(np.ascontiguousarray(occupancy.occupied()[::-1]))
        size = (max(1, round(right - left)), max(1, round(bottom - top)))
        self._trails.paste(OBSTACLE, (round(left), round(top)), cells.convert("L").resize(size, Image.Resampling.BOX))

    def _pixel(self, x: float, y: float) -> Point:
        finer = self.scale * _FINER
        return (x - float(self._arena.x_min)) * finer, (float(self._arena.y_max) - y) * finer


_COLOURS = (PURSUER, EVADER)
"""By role."""


def draw_robot(draw: ImageDraw.ImageDraw, centre: Point, radius: float, role: Role, mark: str = "") -> None:
    """Draw the sign of a pursuer, a full disc, or of an evader, a ring, and its mark inside; in pixels."""
    if role == Role.PURSUER:
        draw.circle(centre, radius, fill=PURSUER)
    else:
        draw.circle(centre, radius, fill=PAPER, outline=EVADER, width=round((0.3 if mark else 0.6) * radius))
    if mark:
        font = ImageFont.load_default(round(1.4 * radius))
        draw.text(centre, mark, fill=EVADER if role else PAPER, font=font, anchor="mm")


def draw_reach(draw: ImageDraw.ImageDraw, centre: Point, radius: float, width: int) -> None:
    """Draw the reach of a capture, dotted; in pixels."""
    box = (centre[0] - radius, centre[1] - radius, centre[0] + radius, centre[1] + radius)
    for angle in range(0, 360, 30):
        draw.arc(box, angle, angle + 15, fill=PURSUER, width=width)


def _draw_cross(draw: ImageDraw.ImageDraw, centre: Point, radius: float, colour: str) -> None:
    (x, y), reach = centre, 0.8 * radius
    for sign in (-1, 1):
        ends = [(x - reach, y - sign * reach), (x + reach, y + sign * reach)]
        draw.line(ends, fill=colour, width=round(0.4 * radius))


_GAP = 16
_LETTERS = 15
"""Height of a caption [pixels]."""


def save_side_by_side(pictures: Mapping[str, Image.Image], path: Path, columns: int, size: int) -> None:
    """Write pictures in rows as one PNG, each above its caption; `size` bounds their longer sides [pixels]."""
    lines = 1 + max(caption.count("\n") for caption in pictures)
    width, height = size + _GAP, size + 2 * _GAP + lines * _LETTERS
    rows = -(-len(pictures) // columns)
    whole = Image.new("RGB", (min(len(pictures), columns) * width + _GAP, rows * height + _GAP), PAPER)
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(_LETTERS)
    for number, (caption, picture) in enumerate(pictures.items()):
        left, top = _GAP + number % columns * width, _GAP + number // columns * height
        picture.thumbnail((size, size), Image.Resampling.BOX)
        whole.paste(picture, (left, top + size - picture.height))
        draw.text((left, top + size + _GAP // 3), caption, fill=INK, font=font)
    content = io.BytesIO()
    whole.save(content, "PNG", optimize=True)
    write_atomically(path, content.getvalue())


def save_gallery(games: Mapping[str, Game], path: Path, columns: int = 4) -> None:
    """Write a picture of games' arenas, each above its name and size."""
    pictures: dict[str, Image.Image] = {}
    for name, game in games.items():
        width, height = game.arena.x_max - game.arena.x_min, game.arena.y_max - game.arena.y_min
        pictures[f"{name}, {float(width):.3g} x {float(height):.3g} m"] = Canvas(game).picture()
    save_side_by_side(pictures, path, columns, size=SIZE // 2)
