"""Draw the bracket around the value of the game of two over grids, and what tables keep of what they promise.

    python benchmarks/bracket.py docs/figures/bracket.png

`docs/results/solver.json` holds the runs.
"""

import json
import sys
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from apollonius.show import palette
from apollonius.show.style import picture

RUNS = Path(__file__).parents[1] / "docs" / "results" / "solver.json"
KINDS = {
    "interpolated, hold 1 s": palette.OTHER,
    "whole cells, hold 1 s": palette.PURSUER,
    "whole cells, hold 2 s": palette.EVADER,
    "margins, interpolated, hold 1 s": palette.INK,
}
"""Kinds of runs, and their colours."""
APART = 0.18
"""Distance between the brackets of two kinds on the same grid, in nodes."""


def main() -> None:
    """Draw both panels."""
    results = json.loads(RUNS.read_text())
    with picture(Path(sys.argv[1]), columns=2) as (left, right):
        draw_brackets(left, results["bracket"])
        draw_calibration(right, results["calibration"])


def draw_brackets(axes: Axes, runs: list[dict[str, Any]]) -> None:
    """Draw each run as a line from the lower to the upper value."""
    for place, (kind, colour) in enumerate(KINDS.items()):
        some = [run for run in runs if run["kind"] == kind]
        nodes = [int(run["grid"].split("x")[0]) + APART * (place - 1) for run in some]
        low, high = ([run[side] for run in some] for side in ("lower", "upper"))
        axes.vlines(nodes, low, high, color=colour, linewidth=2.5, label=kind)
        axes.plot(nodes, low, "_", nodes, high, "_", color=colour, markersize=9)
    axes.set(title="paper, starts at rest", xlabel="nodes along a wall", ylabel="mean discounted payoff")
    axes.set_xticks(sorted({int(run["grid"].split("x")[0]) for run in runs}))
    axes.set_ylim(0, 0.42)
    axes.legend()


def draw_calibration(axes: Axes, sides: dict[str, Any]) -> None:
    """Draw, for each side, what its table's player keeps against the worst attacker of each bin of the promise."""
    axes.axline((0, 0), slope=1, color=palette.OTHER, linewidth=1)
    for side, colour in (("pursuer", palette.PURSUER), ("evader", palette.EVADER)):
        bins = sides[side]["bins"]
        worst = [min((one for one in row.values() if isinstance(one, dict)), key=itemgetter("kept")) for row in bins]
        promised, kept = [row["promised"] for row in bins], [one["kept"] for one in worst]
        ends = np.array([one["interval"] for one in worst]).T
        lengths = np.abs(ends - kept)
        axes.errorbar(promised, kept, lengths, color=colour, fmt="o-", markersize=3, label=side)
    axes.set(title="paper, moving starts", xlabel="promised payoff", ylabel="kept against the worst attacker")
    axes.legend()


if __name__ == "__main__":
    main()
