"""What an agent or a solved game says of every place in the arena: the value of the best action, and which it is.

Everything but its own position is held fixed, so the pictures are slices of a function of eight numbers.
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.game.game import Game
from apollonius.game.types import BySide, GameState, RobotState, Role
from apollonius.io.errors import require
from apollonius.observe.view import look
from apollonius.show import palette, style
from apollonius.show.arena import draw_arena
from apollonius.solve.players import SaddlePolicy

CELLS = 200
"""Cells of a slice along each side of the arena."""
_SIGNS = 16
"""Signs for the acceleration along each side of the arena."""
_ARROW = 0.07
"""Length of the opponent's arrow, as a share of the arena's longer side."""
_TURNS = {"right": "#f6d68a", "straight": "#f4f4ef", "left": "#c9bfe6"}
"""Pale colours of the three turns, by action level: neither side's."""
_LEVELS = {"brake": "_", "hold": ".", "speed up": "+"}
"""Signs of the three accelerations, by action level."""


Slice = tuple[Float[np.ndarray, " columns"], Float[np.ndarray, " rows"], Float[np.ndarray, "rows columns 9"]]
"""x and y of cells' centres [m], and the values of the nine actions there: a network's discounted reward to come, in
the units of its training, or a solved game's discounted payoff; NaN where the robot's body touches an obstacle or a
wall by more than a cell."""


def slice_values(
    player: AbstractActionValuePolicy,
    game: Game,
    role: Role,
    own: tuple[float, float],
    opponent: RobotState,
    cells: int,
) -> Slice:
    """Return the values of all actions over the arena, at the player's own speed [m/s] and heading [rad]."""
    arena = game.arena
    x, y = (
        float(low) + float(high - low) * (np.arange(cells, dtype=np.float32) + 0.5) / cells
        for low, high in ((arena.x_min, arena.x_max), (arena.y_min, arena.y_max))
    )
    speed, heading = (jnp.float32(number) for number in own)
    cell_size = max(arena.x_max - arena.x_min, arena.y_max - arena.y_min) / cells
    body = game.body(role)

    @jax.jit
    @jax.vmap
    @jax.vmap
    def cell(own_x: Float[Array, ""], own_y: Float[Array, ""]) -> Float[Array, "9"]:
        robots = BySide.of(role, RobotState(own_x, own_y, speed, heading), opponent)
        state = GameState.of_two(*robots, steps=jnp.int32(0))
        values = player.values(player.observation(look(game, state, role)))
        return jnp.where(arena.clearance(own_x, own_y) > body.radius - cell_size, values, jnp.nan)

    return x, y, np.asarray(cell(*jnp.meshgrid(x, y)))


def save_slice(
    player: AbstractActionValuePolicy,
    role: Role,
    name: str,
    game: Game,
    own: tuple[float, float],
    opponent: RobotState,
    path: Path,
) -> None:
    """Save two maps of the arena as PNG: the value of a player's best action, and that action; raises InvalidInput for
    an opponent outside the walls or inside a disc, or speeds that the robots cannot have.

    Of a solved game the first one shows the barrier too: the line where the payoff that it promises its side is
    neither a win nor a loss. The player's `own` speed [m/s] and heading [rad] are given.
    """
    other = ("opponent's speed", float(opponent.v), game.body(role.other))
    for what, speed, body in (("speed", own[0], game.body(role)), other):
        slowest, fastest = np.float32(body.v_min), np.float32(body.v_max)  # as precise as the speeds themselves
        require(slowest <= speed <= fastest, what, f"{speed:g}", f"from {slowest:g} to {fastest:g} m/s")
    place = (float(opponent.x), float(opponent.y))
    require(
        game.arena.clearance(opponent.x, opponent.y) > game.body(role.other).radius, "opponent", place,
        "a place [m] inside the walls and outside the discs",
    )  # fmt: skip
    found = slice_values(player, game, role, own, opponent, CELLS)
    with style.picture(path, columns=2, width=4.6, height=5.0) as (left, right):
        _draw_values(left, found, solved=isinstance(player, SaddlePolicy))
        _draw_actions(right, found)
        for axes in (left, right):
            draw_arena(axes, game.arena)
            _draw_opponent(axes, role, opponent, game)
        left.set_title(f"{name}: value of its best action\nat {_motion(*own)}")
        motion = _motion(float(opponent.v), float(opponent.heading))
        other = role.other.name.lower()
        right.set_title(f"{name}: its best action\n{other} at ({place[0]:g}, {place[1]:g}) m, {motion}")


def _motion(speed: float, heading: float) -> str:
    return f"{speed:.3g} m/s, heading {np.degrees(heading):.0f}°"


def _draw_values(axes: Axes, found: Slice, solved: bool) -> None:
    """Draw the highest value of each cell, on a perceptually uniform scale that grows lighter throughout."""
    x, y, values = found
    best = values.max(axis=-1)
    mesh = axes.pcolormesh(x, y, best, cmap="viridis", rasterized=True)
    label = "promised payoff [discounted]" if solved else "value [discounted reward to come]"
    below = axes.inset_axes((0.0, -0.24, 1.0, 0.045))
    axes.figure.colorbar(mesh, cax=below, orientation="horizontal", label=label)
    if solved and np.nanmin(best) < 0 < np.nanmax(best):
        barrier = axes.contour(x, y, best, levels=[0.0], colors=palette.PAPER, linewidths=1.4)
        axes.clabel(barrier, fmt="barrier", fontsize="small")


def _draw_actions(axes: Axes, found: Slice) -> None:
    """Draw turns as colours, accelerations as signs."""
    x, y, values = found
    free = ~np.isnan(values[..., 0])
    action = np.where(free, np.argmax(np.nan_to_num(values, nan=-np.inf), axis=-1), 0)
    turn = np.ma.masked_where(~free, action % 3)
    axes.pcolormesh(x, y, turn, cmap=ListedColormap(list(_TURNS.values())), norm=BoundaryNorm([0, 1, 2, 3], 3))
    every = max(1, len(x) // _SIGNS)
    chosen = slice(every // 2, None, every)
    columns, rows = np.meshgrid(x[chosen], y[chosen])
    for level, sign in enumerate(_LEVELS.values()):
        here = (action[chosen, chosen] // 3 == level) & free[chosen, chosen]
        axes.plot(columns[here], rows[here], sign, color=palette.INK, markersize=4, markeredgewidth=0.9)
    keys = [Patch(facecolor=colour, edgecolor=palette.OBSTACLE, label=name) for name, colour in _TURNS.items()]
    keys += [Line2D([], [], color=palette.INK, marker=sign, ls="none", label=name) for name, sign in _LEVELS.items()]
    axes.legend(handles=keys, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, title="turn and acceleration")


def _draw_opponent(axes: Axes, role: Role, opponent: RobotState, game: Game) -> None:
    """Draw the opponent with its heading, and how near the robots must come for a capture."""
    colour, reach = palette.SIDES[role.other], float(game.capture_distance)
    x, y, heading = float(opponent.x), float(opponent.y), float(opponent.heading)
    axes.add_patch(Circle((x, y), reach, fill=False, edgecolor=colour, linewidth=1.2, linestyle="--"))
    length = _ARROW * float(max(game.arena.x_max - game.arena.x_min, game.arena.y_max - game.arena.y_min))
    dx, dy, width = length * np.cos(heading), length * np.sin(heading), length / 14
    axes.arrow(x, y, dx, dy, width=width, head_width=4 * width, length_includes_head=True, color=colour)
    axes.plot(x, y, "o", color=colour, markersize=6, markeredgecolor=palette.PAPER)
