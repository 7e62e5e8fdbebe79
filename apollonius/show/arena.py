"""An arena from above, and the trails that two robots left in it."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Circle, Polygon, Rectangle

from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.types import Outcome, RobotState
from apollonius.replay import Replay, Trajectory
from apollonius.show import palette, style

_CLOCK_SECONDS = 5.0
"""Time between two marks on a trail [s]."""
_CLOCK_LABELS = 4
"""Marks with figures: later ones would lie on top of each other in a long game."""


def draw_arena(axes: Axes, arena: Arena) -> None:
    """Walls and obstacles, to scale, axes in metres."""
    x, y = float(arena.x_min), float(arena.y_min)
    width, height = float(arena.x_max) - x, float(arena.y_max) - y
    axes.add_patch(Rectangle((x, y), width, height, fill=False, edgecolor=palette.INK, linewidth=1.4))
    for disc in arena.discs:
        axes.add_patch(
            Circle((float(disc.x), float(disc.y)), float(disc.radius), facecolor=palette.OBSTACLE, edgecolor="none")
        )
    if arena.map:
        ends = (float(arena.map.x), float(arena.map.x_max), float(arena.map.y), float(arena.map.y_max))
        cells, colours = arena.map.occupied(), ListedColormap(["none", palette.OBSTACLE])
        axes.imshow(cells, cmap=colours, vmin=0, vmax=1, extent=ends, origin="lower", interpolation="nearest")
    for polygon in arena.polygons:
        corners = [(float(corner_x), float(corner_y)) for corner_x, corner_y in polygon.vertices]
        axes.add_patch(Polygon(corners, facecolor=palette.OBSTACLE, edgecolor="none"))
    if arena.territory:
        goal = arena.territory
        ring = Circle((float(goal.x), float(goal.y)), float(goal.radius), fill=False, edgecolor=palette.EVADER)
        axes.add_patch(ring)
    margin = 0.03 * max(width, height)
    axes.set_xlim(x - margin, x + width + margin)
    axes.set_ylim(y - margin, y + height + margin)
    axes.set_aspect("equal")
    axes.grid(False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def save_picture(replay: Replay, path: Path) -> None:
    """A replay as a PNG: arena, both trails with the time along them, how it ended."""
    with style.picture(path, width=4.6, height=5.0) as (axes,):
        draw_game(axes, replay.game, replay.trajectory(), f"{replay.pursuer} against {replay.evader}")


def draw_game(axes: Axes, game: Game, trajectory: Trajectory, title: str = "") -> None:
    """One game: both trails from a ring at the start to a dot at the end, and below the title how it ended."""
    draw_arena(axes, game.arena)
    states = trajectory.states
    for robot, colour, name in (
        (states.pursuer, palette.PURSUER, "pursuer"),
        (states.evader, palette.EVADER, "evader"),
    ):
        _draw_trail(axes, robot, colour, name, every=round(_CLOCK_SECONDS / float(game.dt)))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2)
    axes.set_title(f"{title}\n{describe_end(game, trajectory)}" if title else describe_end(game, trajectory))


def describe_end(game: Game, trajectory: Trajectory) -> str:
    """How the game ended and when, as `captured after 12.3 s`."""
    steps = trajectory.states.steps.shape[0] - 1
    name = Outcome(int(trajectory.outcome)).name.lower().replace("_", " ")
    return f"{name} after {steps * float(game.dt):.1f} s"


def _draw_trail(axes: Axes, robot: RobotState, colour: str, name: str, every: int) -> None:
    x, y = np.asarray(robot.x), np.asarray(robot.y)
    axes.plot(x, y, color=colour, linewidth=1.2, alpha=0.9, label=name)
    for turn, step in enumerate(range(every, len(x) - 1, every), start=1):
        axes.plot(x[step], y[step], marker="o", markersize=2.5, color=colour)
        if turn <= _CLOCK_LABELS:
            clock = f"{turn * _CLOCK_SECONDS:.0f} s"
            axes.annotate(clock, (x[step], y[step]), (3, 3), textcoords="offset points", fontsize=6, color=colour)
    axes.plot(x[0], y[0], marker="o", markersize=6, markerfacecolor="white", markeredgecolor=colour)
    axes.plot(x[-1], y[-1], marker="o", markersize=5, color=colour)
