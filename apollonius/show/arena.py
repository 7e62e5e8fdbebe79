"""An arena from above, and the trails that robots left in it."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Circle, Polygon

from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.replay import Replay, Trajectory
from apollonius.show import palette, style
from apollonius.show.robots import Drawn, in_play, robots_of, side_name
from apollonius.show.shapes import Round, shapes
from apollonius.show.words import describe_end

_CLOCK_SECONDS = 5.0
"""Time between two marks on a trail [s]."""
_CLOCK_LABELS = 4
"""Marks with figures: later ones would lie on top of each other in a long game."""


def draw_arena(axes: Axes, arena: Arena) -> None:
    """Walls and obstacles, to scale, axes in metres."""
    if arena.map:
        ends = (float(arena.map.x), float(arena.map.x_max), float(arena.map.y), float(arena.map.y_max))
        cells, colours = arena.map.occupied(), ListedColormap(["none", palette.OBSTACLE])
        axes.imshow(cells, cmap=colours, vmin=0, vmax=1, extent=ends, origin="lower", interpolation="nearest")
    for shape in shapes(arena):
        paint: dict[str, Any] = {"facecolor" if shape.filled else "edgecolor": shape.colour, "fill": shape.filled}
        paint["linewidth"] = 0 if shape.filled else 1.4
        if isinstance(shape, Round):
            axes.add_patch(Circle((shape.x, shape.y), shape.radius, **paint))
        else:
            axes.add_patch(Polygon(shape.corners, **paint))
    x, y = float(arena.x_min), float(arena.y_min)
    width, height = float(arena.x_max) - x, float(arena.y_max) - y
    margin = 0.03 * max(width, height)
    axes.set_xlim(x - margin, x + width + margin)
    axes.set_ylim(y - margin, y + height + margin)
    axes.set_aspect("equal")
    axes.grid(False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def save_picture(replay: Replay, path: Path) -> None:
    """A replay as a PNG: arena, trails with the time along them, how it ended."""
    with style.picture(path, width=4.6, height=5.0) as (axes,):
        draw_game(axes, replay.game, replay.trajectory(), f"{replay.pursuer} against {replay.evader}")


def draw_game(axes: Axes, game: Game, trajectory: Trajectory, title: str = "") -> None:
    """One game, and below the title how it ended.

    Each trail leads from a cross at the start to the robot at the end: a pursuer a full disc, within the reach of a
    capture, with a solid trail; an evader a ring with a dashed one. Robots of a team have their numbers; those that
    are out of play at the end are squares, and the reach of none is shown.
    """
    draw_arena(axes, game.arena)
    states, every = trajectory.states, round(_CLOCK_SECONDS / float(game.dt))
    plays, robots = in_play(game, trajectory), robots_of(game)
    for column, robot, state in zip(plays.T, robots, [*states.robots.pursuer, *states.robots.evader], strict=True):
        way = np.stack([np.asarray(state.x), np.asarray(state.y)])[:, : column.sum() + 1]  # and where it went out
        _draw_trail(axes, game, robot, way, every, in_play=bool(column[-1]))
        if robot.role == Role.PURSUER and column[-1]:
            centre, reach = (float(way[0, -1]), float(way[1, -1])), float(game.capture_distance)
            axes.add_patch(Circle(centre, reach, fill=False, edgecolor=robot.colour, linestyle=":"))
    axes.plot([], [], "x", color=palette.INK, markersize=5, label="start")
    if not plays[-1].all():
        axes.plot([], [], "s", color=palette.INK, markersize=5, label="out of play")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=4)
    axes.set_title("\n".join(filter(None, (title, describe_end(game, trajectory)))))


def _draw_trail(
    axes: Axes, game: Game, robot: Drawn, way: Float[np.ndarray, "2 rows"], every: int, in_play: bool
) -> None:
    """One robot's way, with its time; of a team the first one's trail alone is in the legend and has figures."""
    first, colour, (x, y) = robot.mark in ("", "1"), robot.colour, way
    filling, dashes = (palette.PAPER, "--") if robot.role else (colour, "-")
    end = {"color": colour, "markersize": 6, "markerfacecolor": filling, "markeredgewidth": 1.6}
    label, marks = side_name(game, robot.role) if first else None, [-1] if in_play else []
    axes.plot(x, y, linestyle=dashes, linewidth=1.2, label=label, marker="o", markevery=marks, **end)
    if not in_play:
        axes.plot(x[-1], y[-1], marker="s", **end)
    for turn, step in enumerate(range(every, len(x) - 1, every), start=1):
        axes.plot(x[step], y[step], marker="o", markersize=2.5, color=colour)
        if turn <= _CLOCK_LABELS and first:
            clock = f"{turn * _CLOCK_SECONDS:.0f} s"
            axes.annotate(clock, (x[step], y[step]), (3, 3), textcoords="offset points", fontsize=6, color=colour)
    axes.plot(x[0], y[0], marker="x", markersize=5, color=colour)
    for place in (0, -1) if robot.mark else ():
        beside = {"xytext": (-5, 3), "textcoords": "offset points", "ha": "right"}
        axes.annotate(robot.mark, (x[place], y[place]), fontsize=7, color=colour, **beside)
