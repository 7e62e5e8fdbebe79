"""The arenas of several games side by side. Needs Pillow only."""

from collections.abc import Mapping
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from apollonius.game.game import Game
from apollonius.show.canvas import Canvas
from apollonius.show.palette import INK, PAPER

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
        draw.text((left, top + _SIDE + _GAP // 3), f"{name}, {size}", fill=INK, font=font)
    whole.save(path, optimize=True)
