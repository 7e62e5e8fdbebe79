"""A solved problem as two maps of the arena: its table at every node, at the lowest speed and at the highest."""

from pathlib import Path

import jax
import numpy as np
from matplotlib.patches import Rectangle

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.show import palette, style
from apollonius.show.arena import draw_arena
from apollonius.solve.grid import make_grid
from apollonius.solve.motion import HORIZON
from apollonius.solve.store import Solution

MEANINGS = {
    "safety": "clearance that can be kept [m]",
    "reach": "least time to a capture at the star [s]",
    "game": "estimate of what it is sure of, mean over all that the other one may do [discounted payoff]",
}


def save_solution_maps(solution: Solution, game: Game, path: Path) -> None:
    """Draw a table as PNG: at the lowest speed with the best heading, at the highest with the worst."""
    problem, role = solution.problem, Role[solution.problem.role.upper()]
    grid, radius = make_grid(game.arena, game.body(role), tuple(problem.counts)), float(game.body(role).radius)
    table = np.asarray(solution.table, np.float32)
    if problem.kind == "game":  # in tiles of the nodes of the robot that has moved (see `solve.joint`)
        table = table.mean(axis=1).reshape(grid.shape)
    maps = [table[0].max(axis=0), table[-1].min(axis=0)]
    if problem.kind == "reach":
        maps = [np.where(values > 0, -HORIZON * np.log(np.maximum(values, 1e-30)), np.nan) for values in maps]
    x, y = grid.places()
    clearance = np.asarray(jax.jit(jax.vmap(jax.vmap(game.arena.clearance, (None, 0)), (0, None)))(x, y))
    inside = (float(grid.low[0]), float(grid.low[1])), *(float(grid.high[axis] - grid.low[axis]) for axis in (0, 1))
    with style.picture(path, columns=2, width=4.8, height=5.4) as panels:
        titles = f"{float(grid.low[2]):g} m/s, the best heading", f"{float(grid.high[2]):g} m/s, the worst heading"
        for axes, values, title in zip(panels, maps, titles, strict=True):
            shown = np.ma.masked_where((clearance < radius) | np.isnan(values), values).T
            mesh = axes.pcolormesh(*map(np.asarray, (x, y)), shown, cmap="viridis", shading="nearest", rasterized=True)
            mesh.set_clip_path(Rectangle(*inside, transform=axes.transData))
            below = axes.inset_axes((0.0, -0.22, 1.0, 0.04))
            axes.figure.colorbar(mesh, cax=below, orientation="horizontal", label=MEANINGS[problem.kind])
            draw_arena(axes, game.arena)
            axes.set_title(f"{problem.kind} of the {role.name.lower()}, {grid.name} nodes\nat {title}")
            if problem.target is not None:
                axes.plot(*problem.target, "*", color=palette.OTHER, markersize=10, markeredgecolor=palette.PAPER)
