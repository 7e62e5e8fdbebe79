"""Values and best actions of an agent, or of a solved game, in every place of the arena.

Everything but its own position is held fixed, so the pictures are slices of a function of eight
numbers.
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


Slice = tuple[
    Float[np.ndarray, " columns"], Float[np.ndarray, " rows"], Float[np.ndarray, "rows columns 9"]
]
"""x and y of cells' centres [m], and the values of the nine actions there: a network's discounted
reward to come, in the units of its training, or a solved game's discounted payoff; NaN where the
robot's body touches an obstacle or a wall by more than a cell."""


def slice_values(
    player: AbstractActionValuePolicy,
    game: Game,
    role: Role,
    own: tuple[float, float],
    opponent: RobotState,
    cells: int,
) -> Slice:
    """Evaluate all actions over the arena.

    Args:
        player: The player.
        game: The game.
        role: The player's side.
        own: The player's speed [m/s] and heading [rad].
        opponent: State of its opponent.
        cells: Cells along each side of the arena.
    """
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
    """Save two maps of the arena as PNG: the value of a player's best action, and that action.

    For a solved game the first map also shows the barrier, the line on which its value is 0.

    Args:
        player: The player.
        role: The player's side.
        name: The player's name, for the titles.
        game: The game.
        own: The player's speed [m/s] and heading [rad].
        opponent: State of its opponent.
        path: File to write.

    Raises:
        InvalidInput: For an opponent outside the walls or inside a disc, and for impossible speeds.
    """
    own_speed = ("speed", own[0], game.body(role))
    opponent_speed = ("opponent's speed", float(opponent.v), game.body(role.other))
    for what, speed, body in (own_speed, opponent_speed):
        # as precise as the speeds themselves
        slowest, fastest = np.float32(body.v_min), np.float32(body.v_max)
        require(
            slowest <= speed <= fastest, what, f"{speed:g}", f"from {slowest:g} to {fastest:g} m/s"
        )
    place = (float(opponent.x), float(opponent.y))
    require(
        game.arena.clearance(opponent.x, opponent.y) > game.body(role.other).radius,
        "opponent",
        place,
        "a place [m] inside the walls and outside the discs",
    )
    values = slice_values(player, game, role, own, opponent, CELLS)
    with style.picture(path, columns=2, width=4.6, height=5.0) as (values_axes, actions_axes):
        _draw_values(values_axes, values, solved=isinstance(player, SaddlePolicy))
        _draw_actions(actions_axes, values)
        for axes in (values_axes, actions_axes):
            draw_arena(axes, game.arena)
            _draw_opponent(axes, role, opponent, game)
        values_axes.set_title(f"{name}: value of its best action\nat {_motion(*own)}")
        motion = _motion(float(opponent.v), float(opponent.heading))
        side = role.other.name.lower()
        situation = f"{side} at ({place[0]:g}, {place[1]:g}) m, {motion}"
        actions_axes.set_title(f"{name}: its best action\n{situation}")


def _motion(speed: float, heading: float) -> str:
    return f"{speed:.3g} m/s, heading {np.degrees(heading):.0f}°"


def _draw_values(axes: Axes, values_slice: Slice, solved: bool) -> None:
    """Draw the highest value of each cell, on a perceptually uniform scale that grows lighter
    throughout.
    """
    x, y, values = values_slice
    best = values.max(axis=-1)
    mesh = axes.pcolormesh(x, y, best, cmap="viridis", rasterized=True)
    label = "promised payoff [discounted]" if solved else "value [discounted reward to come]"
    below = axes.inset_axes((0.0, -0.24, 1.0, 0.045))
    axes.figure.colorbar(mesh, cax=below, orientation="horizontal", label=label)
    if solved and np.nanmin(best) < 0 < np.nanmax(best):
        barrier = axes.contour(x, y, best, levels=[0.0], colors=palette.PAPER, linewidths=1.4)
        axes.clabel(barrier, fmt="barrier", fontsize="small")


def _draw_actions(axes: Axes, values_slice: Slice) -> None:
    """Draw turns as colours, accelerations as signs."""
    x, y, values = values_slice
    free = ~np.isnan(values[..., 0])
    action = np.where(free, np.argmax(np.nan_to_num(values, nan=-np.inf), axis=-1), 0)
    turn = np.ma.masked_where(~free, action % 3)
    axes.pcolormesh(
        x, y, turn, cmap=ListedColormap(list(_TURNS.values())), norm=BoundaryNorm([0, 1, 2, 3], 3)
    )
    every = max(1, len(x) // _SIGNS)
    every_nth = slice(every // 2, None, every)
    columns, rows = np.meshgrid(x[every_nth], y[every_nth])
    for level, sign in enumerate(_LEVELS.values()):
        has_level = (action[every_nth, every_nth] // 3 == level) & free[every_nth, every_nth]
        axes.plot(
            columns[has_level],
            rows[has_level],
            sign,
            color=palette.INK,
            markersize=4,
            markeredgewidth=0.9,
        )
    keys = [
        Patch(facecolor=colour, edgecolor=palette.OBSTACLE, label=name)
        for name, colour in _TURNS.items()
    ]
    keys += [
        Line2D([], [], color=palette.INK, marker=sign, ls="none", label=name)
        for name, sign in _LEVELS.items()
    ]
    axes.legend(
        handles=keys,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.13),
        ncols=2,
        title="turn and acceleration",
    )


def _draw_opponent(axes: Axes, role: Role, opponent: RobotState, game: Game) -> None:
    """Draw the opponent with its heading, and how near the robots must come for a capture."""
    colour = palette.SIDES[role.other]
    reach = float(game.capture_distance)
    x = float(opponent.x)
    y = float(opponent.y)
    heading = float(opponent.heading)
    axes.add_patch(
        Circle((x, y), reach, fill=False, edgecolor=colour, linewidth=1.2, linestyle="--")
    )
    arena = game.arena
    length = _ARROW * float(max(arena.x_max - arena.x_min, arena.y_max - arena.y_min))
    dx = length * np.cos(heading)
    dy = length * np.sin(heading)
    width = length / 14
    axes.arrow(
        x, y, dx, dy, width=width, head_width=4 * width, length_includes_head=True, color=colour
    )
    axes.plot(x, y, "o", color=colour, markersize=6, markeredgecolor=palette.PAPER)
