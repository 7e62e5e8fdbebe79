"""How every figure looks: lines and letters, and how one is made and saved."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from apollonius.show.palette import INK

_SETTINGS: dict[Any, Any] = {
    "figure.dpi": 120,
    "savefig.dpi": 160,
    "savefig.bbox": "tight",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "axes.grid": True,
    "grid.color": "#e4e4df",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
}


@contextmanager
def picture(path: Path, columns: int = 1, width: float = 4.6, height: float = 3.0) -> Iterator[list[Axes]]:
    """A figure of panels side by side, saved as PNG when the block ends.

    Args:
        path: where to save it; its folder must exist.
        columns: number of panels.
        width, height: of a panel [inches].

    Yields:
        The panels, from left to right.
    """
    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(columns * width, height), layout="constrained")
        yield list(figure.subplots(1, columns, squeeze=False)[0])
        figure.savefig(path)
