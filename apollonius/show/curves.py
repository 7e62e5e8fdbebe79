"""Curves over training, one line per seed and their mean, and bars with intervals."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter
from scipy.ndimage import uniform_filter1d

Curve = tuple[Sequence[float | int], Sequence[float | int]]
"""Points of one seed: x, y."""


def draw_seeds(axes: Axes, curves: Sequence[Curve], colour: str, label: str) -> None:
    """The curve of every seed, thin, and their mean over the range that all of them cover."""
    for x, y in curves:
        axes.plot(x, y, color=colour, linewidth=0.7, alpha=0.4 if len(curves) > 1 else 1.0)
    first = max(x[0] for x, _ in curves)
    last = min(x[-1] for x, _ in curves)
    grid = np.linspace(first, last, 200)
    mean = np.mean([np.interp(grid, x, y) for x, y in curves], axis=0)
    axes.plot(grid, mean, color=colour, label=label)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))  # 50k, not 50000


def smooth(values: Sequence[float | int], window: int) -> list[float]:
    """Running means over `window` neighbours; beyond either end stands its last value."""
    return list(uniform_filter1d(np.asarray(values, float), window, mode="nearest"))


def draw_bars(
    axes: Axes, names: Sequence[str], rates: Sequence[float], intervals: Sequence[tuple[float, float]], colour: str
) -> None:
    """Rates in per cent with their intervals, and the figure above each."""
    heights = 100 * np.asarray(rates)
    low, high = 100 * np.asarray(intervals).T
    errors = np.stack([heights - low, high - heights])
    axes.bar(names, heights, color=colour, width=0.6, yerr=np.maximum(errors, 0), capsize=3, ecolor="#555555")
    for index, (height, top) in enumerate(zip(heights, high, strict=True)):
        inside = height > 15  # where no other line runs through the figure
        text = axes.text(index, height / 2 if inside else top, f"{height:.1f} %", ha="center", va="bottom", fontsize=8)
        if inside:
            text.set(va="center", color="white")
    axes.set_ylim(0, 108)
    axes.set_ylabel("games [%]")
    axes.grid(axis="x", visible=False)
