"""How every figure looks: lines and letters, and how one is made and saved."""

import io
import re
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from apollonius.document import write_atomically
from apollonius.show.palette import GRID, INK, LIGHT

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
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
}


@contextmanager
def picture(
    path: Path, columns: int = 1, width: float = 4.6, height: float = 3.0, rows: int = 1
) -> Generator[list[Axes], None, None]:
    """A figure of panels in rows, saved as PNG when the block ends.

    Args:
        path: where to save it.
        columns, rows: number of panels.
        width, height: of a panel [inches].

    Yields:
        The panels, from left to right, row by row.
    """
    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(columns * width, rows * height), layout="constrained")
        yield list(figure.subplots(rows, columns, squeeze=False).flat)
        content = io.BytesIO()
        figure.savefig(content)
    write_atomically(path, content.getvalue())


def inline_svg(draw: Callable[[Axes], None], label: str, width: float = 4.6, height: float = 3.0) -> str:
    """A figure of one panel as an `<svg>` element for a page that defines the palette's colours as CSS variables.

    The same figure serves light and dark pages. Letters stay text.

    Args:
        draw: draws on the panel.
        label: what the figure shows, for readers who do not see it; plain text that needs no escaping.
        width, height: of the panel [inches].
    """
    settings: dict[Any, Any] = _SETTINGS | {"svg.fonttype": "none", "svg.hashsalt": label}
    with mpl.rc_context(settings):
        figure = Figure(figsize=(width, height), layout="constrained")
        draw(figure.subplots())
        file = io.StringIO()
        nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(file, format="svg", transparent=True, metadata=nothing)
    drawn = re.search(r"<svg.*</svg>", file.getvalue(), re.DOTALL)
    assert drawn, "matplotlib writes one svg element"
    svg = re.sub(r'<metadata>.*?</metadata>|xmlns(:\w+)?="[^"]*"', "", drawn.group(), flags=re.DOTALL)
    for name, colour in LIGHT.items():
        svg = svg.replace(colour, f"var(--{name})")
    return svg.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)
