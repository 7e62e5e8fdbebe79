"""Plots of an arena, in metres: below other data, or with the findings of a survey."""

from pathlib import Path

import numpy as np
from jaxtyping import Int
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch, Polygon

from apollonius.arenas.survey import Survey
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.show import palette, style
from apollonius.show.canvas import shapes


def draw_arena(axes: Axes, arena: Arena) -> None:
    """Draw walls and obstacles to scale, with axes in metres."""
    if arena.map:
        ends = (
            float(arena.map.x),
            float(arena.map.x_max),
            float(arena.map.y),
            float(arena.map.y_max),
        )
        cells, colours = arena.map.occupied(), ListedColormap(["none", palette.OBSTACLE])
        axes.imshow(
            cells,
            cmap=colours,
            vmin=0,
            vmax=1,
            extent=ends,
            origin="lower",
            interpolation="nearest",
        )
    for corners, colour, is_filled in shapes(arena):
        axes.add_patch(
            Polygon(corners, color=colour, fill=is_filled, linewidth=0 if is_filled else 1.4)
        )
    x, y = float(arena.x_min), float(arena.y_min)
    width, height = float(arena.x_max) - x, float(arena.y_max) - y
    margin = 0.03 * max(width, height)
    axes.set(
        xlim=(x - margin, x + width + margin),
        ylim=(y - margin, y + height + margin),
        aspect="equal",
    )
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.grid(False)


KINDS = {
    "free to both": palette.PAPER,
    "an obstacle": palette.OBSTACLE,
    "too near for {} body": palette.GRID,
    "cut off from the largest free part": palette.OTHER,
    "the evader is safe here": palette.EVADER,
}
"""Kinds of points, with their colours."""
_LONGER = 6.0
"""The arena's longer side in the picture [inches]."""


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
    """Write the plan of a game as PNG: axes in metres, a legend, and the number of faults.

    Args:
        name: Name of the game, for the title.
        game: The game.
        survey: The survey of its arena.
        path: File to write.
    """
    arena, kinds = game.arena, kinds_of_places(survey)
    ends = (float(arena.x_min), float(arena.x_max), float(arena.y_min), float(arena.y_max))
    width, height = ends[1] - ends[0], ends[3] - ends[2]
    inches = _LONGER / max(width, height)
    with style.picture(path, width=max(inches * width, 4.6), height=inches * height + 1.6) as (
        axes,
    ):
        norm = BoundaryNorm(np.arange(len(KINDS) + 1) - 0.5, len(KINDS))
        # Obstacles are drawn with the arena, sharper than places can show them.
        colours = ListedColormap(
            ["none" if colour == palette.OBSTACLE else colour for colour in KINDS.values()]
        )
        axes.imshow(
            kinds, cmap=colours, norm=norm, extent=ends, origin="lower", interpolation="nearest"
        )
        draw_arena(axes, arena)
        body = "a robot's" if game.pursuer.radius == game.evader.radius else "the pursuer's"
        keys = [
            Patch(
                facecolor=colour,
                edgecolor=palette.OBSTACLE,
                label=f"{what.format(body)} ({np.mean(kinds == kind):.1%})",
            )
            for kind, (what, colour) in enumerate(KINDS.items())
            if (kinds == kind).any()
        ]
        axes.legend(
            handles=keys,
            loc="upper left",
            bbox_to_anchor=(0, -0.1 * _LONGER / (inches * height)),
            ncols=2,
        )
        verdict = "nothing is wrong"
        if survey.wrong:
            count = len(survey.wrong)
            verdict = f"{count} {'thing is' if count == 1 else 'things are'} wrong"
        axes.set_title(f"{name}, {width:g} x {height:g} m: {verdict}")
