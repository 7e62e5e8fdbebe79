"""Robots of other makes as a picture: who wins where, over speed ratio, turn ratio and radius."""

from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.lines import Line2D

from apollonius.evaluate.makes import MakeTable
from apollonius.show import palette, style

WHO_WINS = LinearSegmentedColormap.from_list("who wins", [palette.EVADER, palette.LIGHT["panel"], palette.PURSUER])
"""From makes with which the pursuer wins no game to those with which it wins all."""
_ACROSS = 3
"""Most panels in a row."""
_CELL = (0.72, 0.6)
"""Width and height of a cell [inches]."""
_AROUND = (0.5, 1.4)
"""Width and height of what is around a panel's cells [inches]."""
_LEAST = (2.9, 3.0)
"""Least width and height of a panel [inches]."""
_OWN: dict[str, Any] = {
    "marker": "D", "markersize": 7, "markerfacecolor": palette.PAPER, "markeredgecolor": palette.OTHER,
    "markeredgewidth": 2.0, "linestyle": "none",
}  # fmt: skip
"""The sign of the game's own robots."""
_MOST_NUMBERED = 12
"""Cells along a side of a panel, up to which there is room for numbers in them."""


def draw_makes(table: MakeTable, path: Path) -> None:
    """Save a panel for each radius: how often the pursuer wins, over speed ratio and turn ratio.

    Below each share stands its 95 % interval. A line parts the makes with which the pursuer wins more than half of the
    games from the others, and a diamond is where the game's own robots are.
    """
    columns = min(len(table.radii), _ACROSS)
    counts = len(table.speed_ratios), len(table.turn_ratios)
    sizes = zip(counts, _CELL, _AROUND, _LEAST, strict=True)
    width, height = (max(least, cells * cell + around) for cells, cell, around, least in sizes)
    with style.picture(path, columns, width, height, rows=ceil(len(table.radii) / columns)) as axes:
        panels, unused = axes[: len(table.radii)], axes[len(table.radii) :]
        meshes = [draw_radius(panel, table, index) for index, panel in enumerate(panels)]
        for panel in unused:
            panel.set_axis_off()
        figure = panels[0].get_figure(root=True)
        assert figure is not None, "a panel of a picture"
        for panel in panels[::columns]:
            panel.set_ylabel("pursuer's largest turn rate\nover the evader's")
        label = f"the pursuer wins [% of {table.own_match.games:,} games with each make], with 95 % intervals"
        figure.colorbar(meshes[0], ax=axes, location="bottom", label=label, fraction=0.05, aspect=50, shrink=0.7)
        title = f"{table.pursuer} (pursuer) against {table.evader} (evader): who wins where"
        figure.suptitle(title, x=0.02, ha="left", fontsize=10.5)
        figure.legend(handles=_key(table), loc="outside lower center", ncols=2)


def draw_radius(axes: Axes, table: MakeTable, index: int) -> QuadMesh:
    """The makes of one radius, a cell each; returns the cells.

    Args:
        index: of the radius among the table's.
    """
    rates, radius = 100 * table.win_rates[index], table.radii[index]
    mesh = axes.pcolormesh(rates, cmap=WHO_WINS, vmin=0, vmax=100, edgecolors=palette.PAPER, linewidth=0.8)
    for (row, column), rate in np.ndenumerate(rates):
        if max(rates.shape) <= _MOST_NUMBERED:
            colour = _legible(WHO_WINS(rate / 100))
            low, high = table.matches[index][row][column].pursuer_win_interval
            numbers = f"{100 * low:.0f} to {100 * high:.0f}"
            for text, above, size in ((f"{rate:.0f}", 4, 10), (numbers, -8, 6)):
                axes.annotate(
                    text, (column + 0.5, row + 0.5), xytext=(0, above), textcoords="offset points", ha="center",
                    va="center", fontsize=size, color=colour,
                )  # fmt: skip
    border = LineCollection(parting(rates > 50), colors=palette.INK, linewidths=2.0, capstyle="round")
    axes.add_collection(border, autolim=False)
    if place := _place(table, index):
        axes.plot(*place, **_OWN)
    for axis, ratios in ((axes.xaxis, table.speed_ratios), (axes.yaxis, table.turn_ratios)):
        axis.set_ticks(np.arange(len(ratios)) + 0.5, [f"{ratio:.3g}" for ratio in ratios])
        axis.set_tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("pursuer's top speed over the evader's")
    axes.set_title(f"radius {radius:g} m, caught within {table.capture_distances[index]:g} m")
    return mesh


def _legible(ground: tuple[float, ...]) -> str:
    """The colour of letters on a ground (red, green, blue, ...): ink or paper, whichever contrasts more."""
    here, ink, paper = (_luminance(colour) for colour in (ground[:3], to_rgb(palette.INK), to_rgb(palette.PAPER)))
    return palette.INK if here / ink > paper / here else palette.PAPER


def _luminance(colour: tuple[float, ...]) -> float:
    """How light a colour is, as WCAG 2 counts it for contrasts."""
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in colour]
    return 0.05 + 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def parting(wins: Bool[np.ndarray, "rows columns"]) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The edges between cells that differ, each from one corner to the other (column, row)."""
    beside, above = np.argwhere(wins[:, 1:] != wins[:, :-1]).tolist(), np.argwhere(wins[1:] != wins[:-1]).tolist()
    upright = [((column + 1, row), (column + 1, row + 1)) for row, column in beside]
    return [*upright, *(((column, row + 1), (column + 1, row + 1)) for row, column in above)]


def _place(table: MakeTable, index: int) -> tuple[float, float] | None:
    """Where the sign of the game's own robots is in the panel of one radius; None: it is not there.

    It is between cells where their ratios are, and in the upper right corner of the cell that is theirs.
    """
    own, here = table.own, table.radii[index]
    if own.radius is None or not replace(own, radius=here).is_like(own):
        return None
    axes = ((own.speed_ratio, table.speed_ratios), (own.turn_ratio, table.turn_ratios))
    if any(not ratios[0] <= ratio <= ratios[-1] for ratio, ratios in axes):
        return None
    x, y = (float(np.interp(ratio, ratios, np.arange(len(ratios)) + 0.5)) for ratio, ratios in axes)
    return (x + 0.36, y + 0.32) if x % 1 == y % 1 == 0.5 else (x, y)


def _key(table: MakeTable) -> list[Line2D]:
    """What the line is, if there is one, and the sign; where that is in no panel, of what make the own robots are."""
    rate = f"{table.own_match.pursuer_win_rate:.0%}"
    line = Line2D([], [], color=palette.INK, linewidth=2.0, label="half of the games")
    if any(_place(table, index) for index in range(len(table.radii))):
        own = Line2D([], [], **_OWN, label=f"the game's own robots: {rate}")
    else:
        own = Line2D([], [], linestyle="none", label=f"the game's own robots ({table.own}): {rate}")
    return [line, own] if any(parting(part > 0.5) for part in table.win_rates) else [own]
