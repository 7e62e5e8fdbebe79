"""A game as a picture with words around it: moving as GIF or WebP; its end as PNG."""

import functools
import io
import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float32, UInt32
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial.distance import cdist

from apollonius.arenas.charting import with_chart
from apollonius.evaluate.match import match_keys
from apollonius.game.game import Game
from apollonius.game.types import GameState, Role
from apollonius.io.document import write_atomically
from apollonius.io.errors import require
from apollonius.io.limits import MOVING
from apollonius.observe import tracking
from apollonius.play.random_bits import random_bits_of
from apollonius.play.replay import Replay
from apollonius.show.canvas import Canvas, draw_robot
from apollonius.show.palette import INK, PAPER, PURSUER, SIDES

LETTERS = 18
"""Height of a line's letters [pixels]."""
LINE = 26
"""Height of a line [pixels]."""
MARGIN = 10
"""Pixels around everything."""
LEAST_WIDTH = 520
"""Pixels that the words need, where the arena is narrow."""
_SIGN = 15
"""Size of a sign in the legend [pixels]."""


def _side_name(game: Game, role: Role) -> str:
    """Return the name of a side: `pursuer`, or `3 pursuers`."""
    count, name = len(game.bodies[role]), role.name.lower()
    return name if count == 1 else f"{count} {name}s"


def _score_line(
    game: Game, robots: Float32[np.ndarray, " numbers"], active: Bool[np.ndarray, " robots"]
) -> str:
    """Return the least distance of a pursuer and an evader; for teams also the numbers of robots in
    play.
    """
    count, places = len(game.bodies.pursuer), robots.reshape(-1, 4)[:, :2]
    pursuers, evaders = places[:count][active[:count]], places[count:][active[count:]]
    distances = cdist(pursuers, evaders)
    distance = f"distance {distances.min():.2f} m" if distances.size else ""
    if game.teams is None:
        return distance
    return f"{len(pursuers)} v {len(evaders)} in play{distance and ', '}{distance}"


def fog(replay: Replay) -> tuple[Role, Bool[np.ndarray, "states rows columns"]] | None:
    """Return a side and the coarse cells of the chart in which its robots could be in each state,
    as the other knew.

    The other side is the pursuer's or, if that sees everything, the evader's; None if both do.
    """
    game = replay.game
    role = next((role for role in Role if game.sensors and game.sensors[role]), None)
    if role is None:
        return None
    states, key = replay.trajectory().states, match_keys(np.uint32(replay.seed))[1]
    bits = random_bits_of(key, jnp.full(len(replay.states), replay.index), states.steps)
    return role.other, np.asarray(_beliefs(with_chart(game), states, bits[role], role)) >= 0


@functools.partial(jax.jit, static_argnames="role")
def _beliefs(game: Game, states: GameState, bits: UInt32[Array, " states"], role: Role) -> Array:
    def observe_step(
        track: Any, step_inputs: tuple[GameState, UInt32[Array, ""]]
    ) -> tuple[Any, Any]:
        state, own_bits = step_inputs
        track, knowledge = tracking.sense_and_update(game, role, track, state, own_bits)
        return track, knowledge.belief

    first = tracking.init_track(game, jax.tree.map(lambda leaf: leaf[0], states), role)
    return jax.lax.scan(observe_step, first, (states, bits))[1]


SLOWEST = 0.05
"""Fewest seconds of the game in a second of a moving picture."""
FASTEST = 100.0
"""Most seconds of the game in a second of a moving picture."""
_SHORTEST = 0.02
"""Least time that a picture is shown [s]: browsers take what is less for a mistake, and show it for
0.1 s.
"""
_LAST_SECONDS = 2.0
"""Time for which the end is shown."""
_COLOURS = 64
"""Colours of a GIF: those of its end, which has all trails."""


def save_animation(replay: Replay, path: Path, speed: float = 1.0) -> None:
    """Write a game as a moving picture, or its end as a PNG; raises InvalidInput for another format
    or an impossible speed.

    The speed is seconds of the game in one of the picture. Where that asks for too many frames,
    some steps are left out; the last one never is.
    """
    formats = (*MOVING, ".png")
    require(
        path.suffix in formats, "path", path, f"a file that ends in one of {', '.join(formats)}"
    )
    require(
        SLOWEST <= speed <= FASTEST,
        "speed",
        speed,
        f"from {SLOWEST:g} to {FASTEST:g} times real time",
    )
    if path.suffix == ".png":
        write_atomically(path, _encode(last_frame(replay), "png"))
        return
    last, pace = len(replay.actions), float(replay.game.dt) / speed
    steps = [*range(0, last, math.ceil(_SHORTEST / pace - 1e-6)), last]
    pictures = list(frames(replay, steps, speed))
    # Rounded to what the format knows, in such a way that nothing adds up.
    tick, shortest = 10 if path.suffix == ".gif" else 1, round(1000 * _SHORTEST)
    ends = [tick * round(1000 * pace * step / tick) for step in steps]
    durations = [
        *(max(after - before, shortest) for before, after in pairwise(ends)),
        round(1000 * _LAST_SECONDS),
    ]
    if path.suffix == ".gif":
        palette = pictures[-1].quantize(_COLOURS, Image.Quantize.MAXCOVERAGE)
        pictures = [
            picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
        ]
    options: dict[str, Any] = (
        {"optimize": True} if path.suffix == ".gif" else {"method": 0, "quality": 80}
    )
    options |= {"save_all": True, "append_images": pictures[1:], "duration": durations, "loop": 0}
    write_atomically(path, _encode(pictures[0], path.suffix[1:], **options))


def _encode(picture: Image.Image, kind: str, **options: Any) -> bytes:
    content = io.BytesIO()
    picture.save(content, kind, **options)
    return content.getvalue()


def frames(
    replay: Replay, steps: list[int] | None = None, speed: float = 1.0
) -> Iterator[Image.Image]:
    """Yield a picture for each of these steps of a game, or for every one; those in between leave
    their trail. Above the arena are names and legend, below it the clock and at the end the
    outcome.
    """
    game = replay.game
    last = len(replay.actions)
    in_play = replay.in_play()
    movers = replay.mover_places()
    hidden = fog(replay)
    canvas = Canvas(game)
    shown_steps = set(range(last + 1) if steps is None else steps)
    page = _page(replay, canvas.picture().size, hidden and hidden[0])
    pace = "" if speed == 1 else f", {speed:g} x real time"
    font = ImageFont.load_default(LETTERS)
    baseline = page.height - (LINE + MARGIN) // 2
    for step in range(last + 1):
        robots, active = replay.states[step], in_play[step]
        canvas.move(robots.tolist(), active.tolist(), movers[step].tolist())
        if step not in shown_steps:
            continue
        picture, arena = page.copy(), canvas.picture(hidden and (hidden[1][step], hidden[0]))
        picture.paste(arena, ((page.width - arena.width) // 2, MARGIN + 2 * LINE))
        write = functools.partial(ImageDraw.Draw(picture).text, fill=INK, font=font)
        clock = replay.ending() if step == last else f"{step * float(game.dt):.1f} s"
        write((MARGIN, baseline), f"{clock}{pace}", anchor="lm")
        write((page.width - MARGIN, baseline), _score_line(game, robots, active), anchor="rm")
        yield picture


def _page(replay: Replay, arena: tuple[int, int], hidden: Role | None) -> Image.Image:
    """Return the page around an arena of a size [pixels]: the signs of both robots with their
    players' names, the reach of a capture, and which side is hidden in fog.
    """
    game, font = replay.game, ImageFont.load_default(LETTERS)
    width = max(arena[0], LEAST_WIDTH) + 2 * MARGIN
    height = arena[1] + 3 * LINE + 2 * MARGIN
    page = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(page)
    right = page.width - MARGIN
    write = functools.partial(draw.text, font=font)
    first, second = (MARGIN + LINE // 2 + LINE * line for line in range(2))
    reach = f"capture within {float(game.capture_distance):g} m"
    write((right, first), reach, PURSUER, anchor="rm")
    sign_left = right - font.getlength(reach) - 6 - _SIGN
    draw.circle((sign_left + _SIGN / 2, first), _SIGN / 2, outline=PURSUER)
    if hidden is not None:
        shade = f"shaded: where the {_side_name(game, hidden)} can be"
        write((right, second), shade, SIDES[hidden], anchor="rm")
        right -= font.getlength(shade) + 6
    names = (replay.pursuer, replay.evader)
    rows = (first, second)
    ends = (sign_left, right)
    for role, name, colour, row, end in zip(Role, names, SIDES, rows, ends, strict=True):
        draw_robot(draw, (MARGIN + _SIGN / 2, float(row)), _SIGN / 2, role)
        text_left = MARGIN + _SIGN + 10
        text = f"{_side_name(game, role)} {name}"
        while text and font.getlength(text) > end - text_left - MARGIN:
            text = text[:-1]
        write((text_left, row), text, colour, anchor="lm")
    return page


def last_frame(replay: Replay) -> Image.Image:
    """Return the end of a game with all trails."""
    return next(frames(replay, [len(replay.actions)]))
