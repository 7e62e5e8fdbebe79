"""The style of all figures, and their parts: curves over training, strips of trainings."""

import io
import re
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter
from scipy.ndimage import uniform_filter1d

from apollonius.evaluate.statistics import mean_band, wilson_interval
from apollonius.io.document import write_atomically
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
    path: Path, columns: int = 1, width: float = 4.6, height: float = 3.0
) -> Generator[list[Axes], None, None]:
    """Open a figure of panels side by side, which is saved as PNG when the block ends.

    Args:
        path: File to write.
        columns: Number of panels.
        width: Width of a panel [inches].
        height: Height of the figure [inches].
    """
    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(columns * width, height), layout="constrained")
        yield list(figure.subplots(1, columns, squeeze=False).flat)
        content = io.BytesIO()
        figure.savefig(content)
    write_atomically(path, content.getvalue())


def inline_svg(draw: Callable[[Axes], None], label: str) -> str:
    """Return a figure of one panel as an `<svg>` for a page that defines the palette's colours as
    CSS variables.

    The same figure serves light and dark pages. Letters stay text; the label is plain text for who
    does not see it.
    """
    settings: dict[Any, Any] = _SETTINGS | {"svg.fonttype": "none", "svg.hashsalt": label}
    with mpl.rc_context(settings):
        figure = Figure(figsize=(4.6, 3.0), layout="constrained")
        draw(figure.subplots())
        file = io.StringIO()
        nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(file, format="svg", transparent=True, metadata=nothing)
    svg_element = re.search(r"<svg.*</svg>", file.getvalue(), re.DOTALL)
    assert svg_element, "matplotlib writes one svg element"
    svg = re.sub(
        r'<metadata>.*?</metadata>|xmlns(:\w+)?="[^"]*"', "", svg_element.group(), flags=re.DOTALL
    )
    for name, colour in LIGHT.items():
        svg = svg.replace(colour, f"var(--{name})")
    return svg.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)


Curve = tuple[Sequence[float | int], Sequence[float | int]]
"""Points of one seed: x, y."""


def draw_seeds(axes: Axes, curves: Sequence[Curve], colour: str, label: str) -> None:
    """Draw the curve of one seed, or the curves of several with their mean and its 95 % band
    (Student's t).

    Args:
        axes: The panel.
        curves: A curve for each seed.
        colour: Colour of all curves.
        label: Words for the legend.
    """
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))  # 50k, not 50000
    if len(curves) == 1:
        axes.plot(*curves[0], color=colour, label=label)
        return
    for x, y in curves:
        axes.plot(x, y, color=colour, linewidth=0.7, alpha=0.5)
    first = max(x[0] for x, _ in curves)
    last = min(x[-1] for x, _ in curves)
    grid = np.linspace(first, last, 200)
    seeds = np.stack([np.interp(grid, x, y) for x, y in curves])
    low, high = mean_band(seeds)
    axes.fill_between(grid, low, high, color=colour, alpha=0.15, linewidth=0)
    axes.plot(
        grid,
        seeds.mean(axis=0),
        color=colour,
        label=f"{label}: mean of {len(curves)} seeds, 95 % band",
    )


def draw_rate(
    axes: Axes,
    x: Sequence[float | int],
    times: Sequence[int],
    games: Sequence[int],
    colour: str,
    label: str,
) -> None:
    """Draw a rate [%] along x, with Wilson's 95 % intervals over games as a band.

    Args:
        axes: The panel.
        x: The points.
        times: Games that count, at each point.
        games: All games, at each point.
        colour: Colour of the curve.
        label: Words for the legend.
    """
    low, high = 100 * np.transpose(
        [wilson_interval(*counts) for counts in zip(times, games, strict=True)]
    )
    axes.fill_between(x, low, high, color=colour, alpha=0.18, linewidth=0)
    axes.plot(x, 100 * np.asarray(times) / np.asarray(games), color=colour, label=label)


def smooth(values: Sequence[float | int], window: int) -> list[float]:
    """Return running means over `window` neighbours; each end is repeated beyond itself."""
    return list(uniform_filter1d(np.asarray(values, float), window, mode="nearest"))


def draw_strips(
    axes: Axes,
    names: Sequence[str],
    rates: Sequence[Sequence[Sequence[float]]],
    intervals: Sequence[tuple[float, float]],
    colours: Sequence[str],
) -> None:
    """Draw the rates of trainings against those of the other side, a strip for each name.

    Each training is a line from its least to its largest rate with a dot at the mean; trainings are
    sorted by their means. Beside each strip is the prediction interval of another pair.

    Args:
        axes: The panel.
        names: Name of each strip.
        rates: Rates in [0, 1] of each strip, a row for each training.
        intervals: Prediction interval of each strip, in [0, 1].
        colours: Colour of each strip.
    """
    for index, (rows, (low, high), colour) in enumerate(
        zip(rates, intervals, colours, strict=True)
    ):
        percents = 100 * np.asarray(sorted(rows, key=np.mean))
        places = index + (np.linspace(-0.3, 0.2, len(rows)) if len(rows) > 1 else np.zeros(1))
        axes.vlines(
            places, percents.min(axis=1), percents.max(axis=1), color=colour, alpha=0.4, linewidth=3
        )
        axes.plot(places, percents.mean(axis=1), "o", color=colour, markersize=4)
        axes.vlines(index + 0.35, 100 * low, 100 * high, color=INK, linewidth=2)
    axes.set_xticks(range(len(names)), names)
    axes.set(ylabel="games [%]", xlim=(-0.5, len(names) - 0.4), ylim=(0, 103))
    axes.grid(axis="x", visible=False)
