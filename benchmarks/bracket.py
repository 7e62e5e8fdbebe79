"""Draw the bracket around the value of the game of two, over grids, for each way to solve it.

    python benchmarks/bracket.py docs/figures/bracket.png

`docs/results/solver.json` holds the runs.
"""

import json
import sys
from pathlib import Path

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
    """Draw each run as a line from the lower to the upper value."""
    runs = json.loads(RUNS.read_text())["bracket"]
    with picture(Path(sys.argv[1]), width=5.6) as (axes,):
        for place, (kind, colour) in enumerate(KINDS.items()):
            some = [run for run in runs if run["kind"] == kind]
            nodes = [int(run["grid"].split("x")[0]) + APART * (place - 1) for run in some]
            low, high = ([run[side] for run in some] for side in ("lower", "upper"))
            axes.vlines(nodes, low, high, color=colour, linewidth=2.5, label=kind)
            axes.plot(nodes, low, "_", nodes, high, "_", color=colour, markersize=9)
        axes.set(title="paper, starts at rest", xlabel="nodes along a wall", ylabel="mean discounted payoff")
        axes.set_xticks(sorted({int(run["grid"].split("x")[0]) for run in runs}))
        axes.set_ylim(0, 0.4)
        axes.legend(ncols=2)


if __name__ == "__main__":
    main()
