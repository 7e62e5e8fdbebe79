"""How an evader gets away from one pursuer too few: the graph of an arena, the starts, the way that it runs."""

from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection

from apollonius.game.game import Game
from apollonius.show import palette, style
from apollonius.show.arena import draw_arena
from apollonius.solve.enough import Enough

_LONGER = 5.0
"""The arena's longer side in the picture [inches]."""
_ARROWS = 4
"""Signs along the run that say which way it goes."""


def save_evasion(name: str, game: Game, enough: Enough, path: Path) -> None:
    """Write the picture as PNG.

    The finest graph is drawn faintly, and darker where the game was solved on it: elsewhere an evader is driven out or
    caught. The run is the evader's, dashed; a ring is where it starts, discs are where the pursuers start.

    Args:
        name: what the game is called.
        enough: with one graph at least.
    """
    arena, reading = game.arena, enough.readings[-1]
    width, height = float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min)
    inches = _LONGER / max(width, height)
    with style.picture(path, width=max(inches * width, 4.2), height=inches * height + 1.3) as (axes,):
        places, kept = reading.tiling.places, np.isin(np.arange(len(reading.tiling.places)), reading.core)
        links = np.argwhere(np.triu(reading.tiling.adjacency))
        solved = kept[links].all(axis=1)
        for which, colour in ((~solved, palette.GRID), (solved, palette.OBSTACLE)):
            axes.add_collection(LineCollection(list(places[links[which]]), colors=colour, linewidths=0.5, zorder=0.5))
        draw_arena(axes, arena)
        run, starts = enough.run, enough.starts
        if len(run):
            axes.plot(*np.append(run, run[:1], axis=0).T, color=palette.EVADER, linestyle="--", label="its run")
            for step in range(len(run) // (2 * _ARROWS), len(run), max(1, len(run) // _ARROWS)):
                here, there = run[step], run[(step + 1) % len(run)]
                arrow = {"arrowstyle": "-|>", "color": palette.EVADER}
                axes.annotate("", (here + there) / 2 + 0.01 * (there - here), (here + there) / 2, arrowprops=arrow)
            ring = {"marker": "o", "markersize": 8, "linestyle": "none", "markeredgewidth": 1.8}
            axes.plot(*run[0], color=palette.EVADER, markerfacecolor=palette.PAPER, label="evader", **ring)
            axes.plot(*starts.T, color=palette.PURSUER, label="pursuer" if len(starts) == 1 else "pursuers", **ring)
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.5 / (inches * height)), ncols=3)
        axes.set_title("\n".join([name, enough.verdict, _about(enough)]))


def _about(enough: Enough) -> str:
    reading = enough.readings[-1]
    return (
        f"cells of {reading.tiling.spacing:.2f} m, {len(reading.tiling.places)} nodes, {len(reading.core)} in the core"
    )
