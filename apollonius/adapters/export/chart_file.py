"""An arena's chart as a file of NumPy's, by which an exported policy plays on another map."""

import io

import numpy as np

from apollonius.arenas.charting import charted
from apollonius.game.game import Game

SUFFIX = ".npz"
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


def chart_bytes(parts: Parts) -> bytes:
    """The content of the file, the same for the same chart."""
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=False, **parts)
    return out.getvalue()
