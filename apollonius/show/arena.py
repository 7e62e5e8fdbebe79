"""Plots of an arena, in metres: below other data, with the findings of a survey, or with an evader's run."""

from pathlib import Path
from textwrap import fill, shorten

import numpy as np
from jaxtyping import Int
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from apollonius.arenas.survey import Survey
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.show import palette, style
from apollonius.show.canvas import shapes
from apollonius.solve.enough import Enough


def draw_arena(axes: Axes, arena: Arena) -> None:
    """Draw walls and obstacles to scale, with axes in metres."""
    if arena.map:
        ends = (float(arena.map.x), float(arena.map.x_max), float(arena.map.y), float(arena.map.y_max))
        cells, colours = arena.map.occupied(), ListedColormap(["none", palette.OBSTACLE])
        axes.imshow(cells, cmap=colours, vmin=0, vmax=1, extent=ends, origin="lower", interpolation="nearest")
    for corners, colour, filled in shapes(arena):
        axes.add_patch(Polygon(corners, color=colour, fill=filled, linewidth=0 if filled else 1.4))
    x, y = float(arena.x_min), float(arena.y_min)
    width, height = float(arena.x_max) - x, float(arena.y_max) - y
    margin = 0.03 * max(width, height)
    axes.set_xlim(x - margin, x + width + margin)
    axes.set_ylim(y - margin, y + height + margin)
    axes.set_aspect("equal")
    axes.grid(False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


KINDS = {
    "free to both": palette.PAPER,
    "an obstacle": palette.OBSTACLE,
    "too near for the pursuer's body": palette.GRID,
    "cut off from the largest free part": palette.OTHER,
    "the evader is safe here": palette.EVADER,
}
"""Kinds of points, with their colours."""
_LONGER = 6.0
"""The arena's longer side in the picture [inches]."""
_LETTERS = 80
"""Letters in a line of the summary."""
_NOTE = 2 * _LETTERS
"""Letters of a note, which may name any number of obstacles; the command prints it whole."""


def kinds_of_places(survey: Survey) -> Int[np.ndarray, "rows columns"]:
    """Return the kind of each point as its number in `KINDS`."""
    pursuer, evader = survey.parts
    kinds = np.zeros(survey.blocked.shape, int)
    kinds[pursuer == 0] = 2
    for parts in (pursuer, evader):
        sizes = np.bincount(parts[parts > 0], minlength=1)
        kinds[(parts > 0) & (parts != np.argmax(sizes))] = 3
    kinds[survey.haven] = 4
    kinds[survey.blocked] = 1
    return kinds


def save_plan(name: str, game: Game, survey: Survey, path: Path) -> None:
    """Write the picture as PNG, with axes in metres, a key of what occurs and what the survey says in words.

    Args:
        name: what the game is called.
    """
    arena, kinds = game.arena, kinds_of_places(survey)
    ends = (float(arena.x_min), float(arena.x_max), float(arena.y_min), float(arena.y_max))
    width, height = ends[1] - ends[0], ends[3] - ends[2]
    inches = _LONGER / max(width, height)
    with style.picture(path, width=max(inches * width, 4.6), height=inches * height + 1.6) as (axes,):
        norm = BoundaryNorm(np.arange(len(KINDS) + 1) - 0.5, len(KINDS))
        # Obstacles are drawn with the arena, sharper than places can show them.
        colours = ListedColormap(["none" if colour == palette.OBSTACLE else colour for colour in KINDS.values()])
        axes.imshow(kinds, cmap=colours, norm=norm, extent=ends, origin="lower", interpolation="nearest")
        draw_arena(axes, arena)
        keys: list[Artist] = [
            Patch(facecolor=colour, edgecolor=palette.OBSTACLE, label=f"{what} ({np.mean(kinds == kind):.1%})")
            for kind, (what, colour) in enumerate(KINDS.items())
            if (kinds == kind).any()
        ]
        if arena.territory:
            ring = {"marker": "o", "markersize": 9, "markerfacecolor": "none", "linestyle": "none"}
            keys.append(Line2D([], [], color=palette.EVADER, label="the territory", **ring))
        axes.legend(handles=keys, loc="upper left", bbox_to_anchor=(0, -0.1 * _LONGER / (inches * height)), ncols=2)
        count = len(survey.wrong)
        verdict = f"{count} {'thing is' if count == 1 else 'things are'} wrong" if count else "nothing is wrong"
        radii = f"radius of the pursuer {float(game.pursuer.radius):g} m, of the evader {float(game.evader.radius):g} m"
        lines = [f"{name}, {width:g} x {height:g} m: {verdict}", radii, *(f"wrong: {line}" for line in survey.wrong)]
        lines += [shorten(f"note: {line}", _NOTE, placeholder=" ...") for line in survey.notes]
        axes.set_title("\n".join(fill(line, _LETTERS) for line in lines))


_RUN_LONGER = 5.0
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
    inches = _RUN_LONGER / max(width, height)
    with style.picture(path, width=max(inches * width, 4.2), height=inches * height + 1.3) as (axes,):
        places, kept = reading.tiling.places, np.isin(np.arange(len(reading.tiling.places)), reading.core)
        links = np.argwhere(np.triu(reading.tiling.adjacency))
        solved = kept[links].all(axis=1)
        for which, colour in ((~solved, palette.GRID), (solved, palette.OBSTACLE)):
            axes.add_collection(LineCollection(list(places[links[which]]), colors=colour, linewidths=0.5, zorder=0.5))
        draw_arena(axes, arena)
        run, starts = reading.run, reading.starts
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
        graph = f"{len(reading.tiling.places)} nodes, {len(reading.core)} in the core"
        about = f"cells of {reading.tiling.spacing:.2f} m, {graph}"
        axes.set_title("\n".join([name, enough.verdict.replace(", for", ",\nfor"), about]))
