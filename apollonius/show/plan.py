"""A survey of an arena as a picture: where robots can be, what is cut off from the rest, what is wrong."""

from pathlib import Path
from textwrap import fill, shorten

import numpy as np
from jaxtyping import Int
from matplotlib.artist import Artist
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from apollonius.arenas.survey import Survey
from apollonius.game.game import Game
from apollonius.show import palette, style
from apollonius.show.arena import draw_arena

KINDS = {
    "free to both": palette.PAPER,
    "an obstacle": palette.OBSTACLE,
    "too near for the pursuer's body": palette.GRID,
    "cut off from the largest free part": palette.OTHER,
    "the evader is safe here": palette.EVADER,
}
"""What a place is, and its colour."""
_LONGER = 6.0
"""The arena's longer side in the picture [inches]."""
_LETTERS = 80
"""Letters in a line of the summary."""
_NOTE = 2 * _LETTERS
"""Letters of a note, which may name any number of obstacles; the command prints all of them."""


def kinds_of_places(survey: Survey) -> Int[np.ndarray, "rows columns"]:
    """Which of `KINDS` each place is, by its number."""
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
