"""A solved problem as two maps of the arena: what its table says of every place, node by node."""

from pathlib import Path

import jax
import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.show import palette, style
from apollonius.show.arena import draw_arena
from apollonius.solve.grid import Grid, make_grid
from apollonius.solve.motion import HORIZON
from apollonius.solve.store import Solution

Places = Float[np.ndarray, "x y"]
"""A number for each node's place; NaN where there is nothing to say."""
Map = tuple[str, str, Places]
"""What a map shows: its title, what its colours mean, the numbers."""


def save_solution_maps(solution: Solution, game: Game, path: Path) -> None:
    """Two maps as PNG.

    Of safety: from how many headings a crash can be avoided at full speed, and the highest speed that is safe in any
    direction. Of reach: the least time from rest, and from how many headings there is a capture at full speed. Of a
    game: the estimate of what the side is sure of while the other robot stands still in the middle, and its mean over
    all that the other one may do.
    """
    problem, role = solution.problem, Role[solution.problem.role.upper()]
    bodies = game.body(role), game.body(role.other)
    own, other = (make_grid(game.arena, body, tuple(problem.counts)) for body in bodies)
    if problem.kind == "game":
        maps = _of_a_game(solution, own, other, _room(game, other) > float(bodies[1].radius))
    else:
        table = np.asarray(solution.table, np.float32)
        maps = _of_safety(table, own) if problem.kind == "safety" else _of_reach(table, own)
    with style.picture(path, columns=2, width=4.8, height=5.4) as panels:
        for axes, (title, meaning, numbers) in zip(panels, maps, strict=True):
            _draw(axes, game, own, numbers, meaning, float(bodies[0].radius))
            axes.set_title(f"{problem.kind} of the {role.name.lower()}, {own.name} nodes\n{title}")
            if problem.target is not None:
                axes.plot(*problem.target, "*", color=palette.OTHER, markersize=10, markeredgecolor=palette.PAPER)


def _of_safety(table: Float[np.ndarray, "v heading x y"], grid: Grid) -> tuple[Map, Map]:
    safe, speeds = table >= 0, _speeds(grid)
    below = np.logical_and.accumulate(safe.all(axis=1), axis=0).sum(axis=0)
    fastest = np.where(below > 0, speeds[below - 1], np.nan)
    return (
        (f"at {speeds[-1]:g} m/s", "headings from which a crash can be avoided [%]", 100 * safe[-1].mean(axis=0)),
        ("in whatever direction it goes", "highest speed from which a crash can be avoided [m/s]", fastest),
    )


def _of_reach(table: Float[np.ndarray, "v heading x y"], grid: Grid) -> tuple[Map, Map]:
    speeds, caught = _speeds(grid), table > 0
    slowest = table[0].max(axis=0)
    seconds = np.where(slowest > 0, -HORIZON * np.log(np.maximum(slowest, 1e-30)), np.nan)
    return (
        (f"from {speeds[0]:g} m/s, the best heading", "least time to a capture at the star [s]", seconds),
        (f"from {speeds[-1]:g} m/s", "headings from which it gets there [%]", 100 * caught[-1].mean(axis=0)),
    )


def _of_a_game(solution: Solution, own: Grid, other: Grid, free: Bool[np.ndarray, "x y"]) -> tuple[Map, Map]:
    """The table lies in tiles of the nodes of the robot that has moved (see `solve.joint`).

    Args:
        free: the places where the other robot can stand.
    """
    table = np.asarray(solution.table)
    columns, rows = (np.asarray(places) for places in other.places())
    away = np.hypot((columns - columns.mean())[:, None], (rows - rows.mean())[None])
    column, row = np.unravel_index(np.argmin(np.where(free, away, np.inf)), away.shape)
    there = table[:, np.ravel_multi_index((0, 0, column, row), other.shape)].astype(np.float32).reshape(own.shape)
    x, y = columns[column], rows[row]
    over_others = table.mean(axis=1, dtype=np.float32).reshape(own.shape)
    meaning = f"estimate of what it is sure of [payoff: {solution.problem.payoff}]"
    speed, still = _speeds(own)[0], _speeds(other)[0]
    one = f"at {speed:g} m/s, the best heading; the other one at ({x:.3g}, {y:.3g}) m, {still:g} m/s"
    return (one, meaning, there[0].max(axis=0)), ("mean over all else", meaning, over_others.mean(axis=(0, 1)))


def _speeds(grid: Grid) -> Float[np.ndarray, " v"]:
    return np.linspace(float(grid.low[2]), float(grid.high[2]), grid.counts[2], dtype=np.float32)


def _room(game: Game, grid: Grid) -> Places:
    """Distance of each node's place from the nearest wall or obstacle [m]."""
    return np.asarray(jax.jit(jax.vmap(jax.vmap(game.arena.clearance, (None, 0)), (0, None)))(*grid.places()))


def _draw(axes: Axes, game: Game, grid: Grid, numbers: Places, meaning: str, radius: float) -> None:
    """Each node's place as a rectangle around it; none where the robot's body cannot be."""
    x, y = grid.places()
    shown = np.ma.masked_where((_room(game, grid) < radius) | np.isnan(numbers), numbers)
    mesh = axes.pcolormesh(np.asarray(x), np.asarray(y), shown.T, cmap="viridis", shading="nearest", rasterized=True)
    sides = float(grid.high[0] - grid.low[0]), float(grid.high[1] - grid.low[1])
    mesh.set_clip_path(Rectangle((float(grid.low[0]), float(grid.low[1])), *sides, transform=axes.transData))
    below = axes.inset_axes((0.0, -0.22, 1.0, 0.04))
    axes.figure.colorbar(mesh, cax=below, orientation="horizontal", label=meaning)
    draw_arena(axes, game.arena)
