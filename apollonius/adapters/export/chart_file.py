"""An arena's chart as a file, by which an exported policy plays on another map: one of NumPy's, or bytes for C."""

import io

import numpy as np

from apollonius.arenas.charting import charted
from apollonius.game.game import Game

SUFFIX, RAW = ".npz", ".chart"
"""How the names of both kinds of files end."""
PARTS = ("field", "beside", "ways", "x", "y", "side")
"""Names of the arrays, which mean what those of `Chart` do: `field` float32 [193, 193], `beside` uint16 [192, 192],
`ways` uint16 [1600, 1600], and `x`, `y` and `side`, single float32."""
Parts = dict[str, np.ndarray]
"""The arrays by name."""


def chart_parts(game: Game) -> Parts:
    """The chart of a game's arena, drawn for its larger robot.

    Raises:
        InvalidInput: for a game in several arenas.
    """
    game.require_one_arena("a chart in a file")
    chart = charted(game).arena.chart
    return {name: np.asarray(getattr(chart, name))[0, ...] for name in PARTS}


def chart_bytes(parts: Parts, suffix: str = SUFFIX) -> bytes:
    """The content of a file whose name ends so, the same for the same chart; raw it is one array after the other."""
    if suffix == RAW:
        return b"".join(array.astype(array.dtype.newbyteorder("<")).tobytes() for array in parts.values())
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=False, **parts)
    return out.getvalue()
