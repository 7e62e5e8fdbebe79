"""Why a near-optimal evader survives, in three pictures: the starts it loses, the barrier, a chase round a disc."""

from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Int
from matplotlib.axes import Axes

from apollonius.game.game import Game
from apollonius.game.types import GameState, RobotState, Role
from apollonius.replay import Trajectory
from apollonius.show import palette, style
from apollonius.show.arena import draw_arena, draw_game
from apollonius.show.slices import slice_values
from apollonius.solve.motion import HORIZON
from apollonius.solve.players import SaddlePolicy

_DRAWN = 40
"""Most lost starts in the picture."""
_CAUGHT_WITHIN = (5.0, 10.0, 20.0)
"""Seconds whose barriers are drawn."""
_PURSUER = (5.0, 4.6, np.pi)
"""Place [m] and heading [rad] of the pursuer that the barrier is drawn for."""

Counts = Int[np.ndarray, " games"]
"""By game, to how many opponents it is lost."""


@dataclass(frozen=True)
class LostStarts:
    """The starts of several matches, leaves `[games]`, and to how many opponents an agent and the table lose each."""

    starts: GameState
    by_agent: Counts
    by_table: Counts


def save_survival(
    game: Game, solved: SaddlePolicy, agent: str, lost: LostStarts, chase: tuple[str, Trajectory], path: Path
) -> None:
    """The three pictures side by side, as PNG.

    Args:
        solved: the player by the table, for the evader.
        agent: what the evader is called.
        lost: the starts that are drawn.
        chase: what the chase is called, and its course.
    """
    with style.picture(path, columns=3, width=4.4, height=5.0) as (left, middle, right):
        draw_arena(left, game.arena)
        _draw_starts(left, lost)
        left.set_title(f"Starts that {agent} loses most often\n(pursuer at the cross, evader at the ring)")
        _draw_barrier(middle, game, solved)
        draw_game(right, game, chase[1], chase[0])


def _draw_barrier(axes: Axes, game: Game, solved: SaddlePolicy) -> None:
    """Whence an evader at rest is sure to be caught soon by a pursuer at full speed."""
    x, y, heading = _PURSUER
    pursuer = RobotState(*(jnp.float32(number) for number in (x, y, game.pursuer.v_max, heading)))
    found = slice_values(solved, game, Role.EVADER, (0.0, np.pi), pursuer)
    best = found.values.max(axis=-1)
    axes.pcolormesh(found.x, found.y, best, cmap="viridis", vmin=-1, vmax=0, rasterized=True)
    levels = [-float(np.exp(-seconds / HORIZON)) for seconds in _CAUGHT_WITHIN]
    lines = axes.contour(found.x, found.y, best, levels=levels, colors=palette.PAPER, linewidths=1.2)
    named = dict(zip(levels, _CAUGHT_WITHIN, strict=True))
    axes.clabel(lines, fmt=lambda level: f"{named[level]:.0f} s", fontsize="small")
    draw_arena(axes, game.arena)
    axes.plot(x, y, "<", color=palette.PURSUER, markersize=9, markeredgecolor=palette.PAPER)
    axes.set_title(
        "The barrier: an evader at rest inside a line\nis caught within so long by this pursuer, which goes west"
    )


def _draw_starts(axes: Axes, lost: LostStarts) -> None:
    """The starts lost most often: which of them the table loses too."""
    worst = [index for index in np.argsort(-lost.by_agent, kind="stable")[:_DRAWN] if lost.by_agent[index] > 0]
    for index in worst:
        (x, y), (other_x, other_y) = (
            (float(robot.x[index]), float(robot.y[index])) for robot in (lost.starts.pursuer, lost.starts.evader)
        )
        colour = palette.OTHER if lost.by_table[index] else palette.EVADER
        axes.plot([x, other_x], [y, other_y], color=colour, linewidth=0.7)
        axes.plot(x, y, "x", color=colour, markersize=5)
        axes.plot(other_x, other_y, "o", color=colour, markersize=4, markerfacecolor=palette.PAPER)
    axes.plot([], [], color=palette.OTHER, label="the table loses it too")
    axes.plot([], [], color=palette.EVADER, label="the table holds it")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2)
