"""How many pursuers are enough: how an evader gets away from one too few, and how often teams of each size catch it."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from apollonius.evaluate.team_sizes import TeamSizes
from apollonius.game.game import Game
from apollonius.show import palette, style
from apollonius.show.arena import draw_arena
from apollonius.solve.enough import Enough

_LONGER = 5.0
"""The arena's longer side in the picture [inches]."""
_ARROWS = 4
"""Signs along the run that say which way it goes."""


_SIGNS = "osD^v"
"""Of the teams, in turn."""


def save_evasion(name: str, game: Game, enough: Enough, path: Path, sizes: TeamSizes | None = None) -> None:
    """Write the picture as PNG.

    The finest graph is drawn faintly, and darker where the game was solved on it: elsewhere an evader is driven out or
    caught. The run is the evader's, dashed; a ring is where it starts, discs are where the pursuers start.

    Args:
        name: what the game is called.
        enough: with one graph at least.
        sizes: teams that were played, drawn beside it.
    """
    arena, reading = game.arena, enough.readings[-1]
    width, height = float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min)
    inches = _LONGER / max(width, height)
    columns, (wide, high) = 1 if sizes is None else 2, (max(inches * width, 4.2), inches * height + 1.3)
    with style.picture(path, columns, width=wide, height=high) as (axes, *beside):
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
        axes.set_title("\n".join([name, enough.verdict.replace(", for", ",\nfor"), _about(enough)]))
        if sizes is not None:
            _draw_sizes(beside[0], sizes, enough)


def _draw_sizes(axes: Axes, sizes: TeamSizes, enough: Enough) -> None:
    """How often teams of each size catch the evader, with 95 % intervals; teams stand a little apart, to be told."""
    shift = 0.06
    for number, (team, found) in enumerate(sizes.teams.items()):
        x = np.array([one.pursuers for one in found]) + shift * (number - (len(sizes.teams) - 1) / 2)
        rates, ends = np.array([one.rate for one in found]), np.array([one.interval for one in found]).T
        colour = palette.PURSUER if number == 0 else palette.INK
        axes.errorbar(
            x, 100 * rates, yerr=100 * np.abs(ends - rates), color=colour, label=team, capsize=2, markersize=5,
            marker=_SIGNS[number % len(_SIGNS)], linestyle="-" if number == 0 else (0, (1 + number, 2)),
        )  # fmt: skip
    if enough.pursuers is not None:
        axes.axvline(
            enough.pursuers, color=palette.EVADER, linewidth=6, alpha=0.25, label="enough, idealised", zorder=0
        )
    axes.set_xticks(sorted({one.pursuers for found in sizes.teams.values() for one in found}))
    axes.set_xlabel("pursuers")
    axes.set_ylabel("captured [%]")
    axes.set_ylim(-3, 103)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)
    axes.set_title(
        f"With the game's robots, within {sizes.seconds:g} s,\nagainst {sizes.evader}, {sizes.games:,} games each"
    )


def _about(enough: Enough) -> str:
    reading = enough.readings[-1]
    return (
        f"cells of {reading.tiling.spacing:.2f} m, {len(reading.tiling.places)} nodes, {len(reading.core)} in the core"
    )
