"""The arenas of several games side by side, empty or with a game that was played there. Needs Pillow only."""

import io
from collections.abc import Mapping
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from apollonius.document import write_atomically
from apollonius.game.game import Game
from apollonius.replay import Replay
from apollonius.show.canvas import Canvas
from apollonius.show.palette import INK, PAPER
from apollonius.show.robots import in_play
from apollonius.show.words import describe_end

_SIDE = 240
"""Pixels of a drawing's longer side."""
_GAP = 16
_LETTERS = 15
"""Height of a name [pixels]."""
_COLUMNS = 4


def save_gallery(games: Mapping[str, Game | Replay], path: Path, columns: int = _COLUMNS) -> None:
    """Write a picture of games' arenas, so many side by side, each with its name and its size below.

    Of a replay there are the robots' trails too, and below it how it ended.
    """
    lines = 2 if any(isinstance(one, Replay) for one in games.values()) else 1
    width, height = _SIDE + _GAP, _SIDE + 2 * _GAP + lines * (_LETTERS + 4) - 4
    rows = -(-len(games) // columns)
    whole = Image.new("RGB", (min(len(games), columns) * width + _GAP, rows * height + _GAP), PAPER)
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(_LETTERS)
    for number, (name, one) in enumerate(games.items()):
        game = one.game if isinstance(one, Replay) else one
        left, top = _GAP + number % columns * width, _GAP + number // columns * height
        canvas = Canvas(game)
        if isinstance(one, Replay):
            for robots, active in zip(one.states.tolist(), in_play(game, one).tolist(), strict=True):
                canvas.move(robots, active)
        drawing = canvas.picture()
        drawing.thumbnail((_SIDE, _SIDE), Image.Resampling.BOX)
        whole.paste(drawing, (left, top + _SIDE - drawing.height))
        arena = game.arena
        size = f"{float(arena.x_max - arena.x_min):.4g} x {float(arena.y_max - arena.y_min):.4g} m"
        below = top + _SIDE + _GAP // 3
        draw.text((left, below), f"{name}, {size}", fill=INK, font=font)
        if isinstance(one, Replay):
            draw.text((left, below + _LETTERS + 4), describe_end(game, one), fill=INK, font=font)
    content = io.BytesIO()
    whole.save(content, "PNG", optimize=True)
    write_atomically(path, content.getvalue())
