"""Curves over training: one line per seed, their mean and how sure it is; and bars with intervals."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter
from scipy.ndimage import uniform_filter1d

from apollonius.evaluate.statistics import mean_band, wilson_interval

Curve = tuple[Sequence[float | int], Sequence[float | int]]
"""Points of one seed: x, y."""


def draw_seeds(axes: Axes, curves: Sequence[Curve], colour: str, label: str) -> None:
    """The curve of a lone seed; of several each one, thin, their mean over the range that all of them cover, and its
    95 % interval (Student's t) as a band."""
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
    axes.plot(grid, seeds.mean(axis=0), color=colour, label=f"{label}: mean of {len(curves)} seeds, 95 % band")


def draw_rate(
    axes: Axes, x: Sequence[float | int], times: Sequence[int], games: Sequence[int], colour: str, label: str
) -> None:
    """How often something happened [%] along x, with Wilson 95 % intervals over games as a band."""
    low, high = 100 * np.transpose([wilson_interval(*counts) for counts in zip(times, games, strict=True)])
    axes.fill_between(x, low, high, color=colour, alpha=0.18, linewidth=0)
    axes.plot(x, 100 * np.asarray(times) / np.asarray(games), color=colour, label=label)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))


def smooth(values: Sequence[float | int], window: int) -> list[float]:
    """Running means over `window` neighbours; beyond either end stands its last value."""
    return list(uniform_filter1d(np.asarray(values, float), window, mode="nearest"))


def draw_bars(
    axes: Axes,
    names: Sequence[str],
    rates: Sequence[float],
    intervals: Sequence[tuple[float, float]],
    colours: Sequence[str],
) -> None:
    """Rates in per cent with their intervals, each bar with its figure and in its colour."""
    heights = 100 * np.asarray(rates)
    low, high = 100 * np.asarray(intervals).T
    errors = np.stack([heights - low, high - heights])
    axes.bar(names, heights, color=list(colours), width=0.6, yerr=np.maximum(errors, 0), capsize=3, ecolor="#555555")
    for index, (height, top) in enumerate(zip(heights, high, strict=True)):
        inside = height > 15  # where no other line runs through the figure
        text = axes.text(index, height / 2 if inside else top, f"{height:.1f} %", ha="center", va="bottom", fontsize=8)
        if inside:
            text.set(va="center", color="white")
    axes.set_ylim(0, 108)
    axes.set_ylabel("games [%]")
    axes.grid(axis="x", visible=False)
