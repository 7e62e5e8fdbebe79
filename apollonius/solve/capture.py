"""Captures while actions are held: which of a robot's actions decide the game by one, whatever the other robot does."""

from dataclasses import replace
from math import ceil

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int, UInt8, UInt16

from apollonius.game.outcome import is_captured
from apollonius.game.types import NUM_ACTIONS, GameState, RobotState, Role, Scalar
from apollonius.limits import JOINT_HOLD
from apollonius.solve.joint import lanes_of
from apollonius.solve.motion import ends
from apollonius.solve.side import Side
from apollonius.solve.zero_sum_game import ZeroSumGame

_NEVER = 255
"""Steps to a capture that does not come."""
_MOST = JOINT_HOLD.most
"""Steps that fit above nine bits; no hold is longer."""
Answers = UInt8[Array, "first second draws"]
"""The actions that a known robot takes at each pair of nodes: one, or as many as were drawn where it acts by chance."""
Decided = UInt16[Array, "tiles first lanes"]
"""Nine bits, the first action's lowest, that say which actions decide the game; above them, in how many steps."""


def decisive(zero_sum_game: ZeroSumGame, first: Side, second: Side, answers: Answers | None = None) -> Decided:
    """The actions of the side that moves first after which a capture within the hold is certain.

    Of those that it survives: for the pursuer, the ones that capture whatever the evader does, of what that survives,
    in as many steps as the best of them takes; for the evader, the ones to which the pursuer has an answer that
    captures, in as many as it can hold out. Courses are judged step by step, as the rules do.

    Args:
        zero_sum_game: the game, as the side sees it that moves first.
        first, second: the robots in the order in which they move.
        answers: what the second robot does at each pair of nodes, if it is known; it then has no other answers.
    """
    farthest = zero_sum_game.game.capture_distance + first.farthest + second.farthest
    dx, dy, _, _ = first.grid.spacing
    return _decisive(zero_sum_game, first, second, answers, (ceil(farthest / dx), ceil(farthest / dy)))


@eqx.filter_jit
def _decisive(
    zero_sum_game: ZeroSumGame, first: Side, second: Side, answers: Answers | None, reach: tuple[int, int]
) -> Decided:
    """The same, where `reach` is how far away a robot can be captured, in cells along x and y."""
    slices, (columns, rows) = second.free.shape[0], first.grid.shape[2:]
    window = (slices, 2 * reach[0] + 1, 2 * reach[1] + 1)
    inside = (slice(None), slice(reach[0], reach[0] + columns), slice(reach[1], reach[1] + rows))
    around = ((0, 0), *((cells, cells) for cells in reach), (0, 0))
    survived = jnp.pad(jnp.moveaxis(second.free, 1, -1), around)
    lanes = lanes_of(second.grid)

    def by_node(index: Int[Array, ""]) -> UInt16[Array, "places tiles lanes"]:
        steps = _steps_to_capture(zero_sum_game, first, second, index, reach)

        def at(place: Int[Array, ""]) -> UInt16[Array, "tiles lanes"]:
            x, y = place // rows, place % rows
            possible = survived
            if answers is not None:
                row = answers[index * columns * rows + place].reshape(slices, columns, rows, 1, -1)
                taken = row == jnp.arange(NUM_ACTIONS, dtype=jnp.uint8)[None, None, None, :, None]
                possible = survived & jnp.pad(jnp.any(taken, axis=-1), around)
            possible = jax.lax.dynamic_slice(possible, (0, x, y, 0), (*window, NUM_ACTIONS))
            near = _pack(zero_sum_game.role, steps, first.free[index, :, x, y], possible)
            everywhere = jnp.zeros(survived.shape[:3], jnp.uint16)
            everywhere = jax.lax.dynamic_update_slice(everywhere, near, (0, x, y))
            return everywhere[inside].reshape(-1, lanes)

        return jax.lax.map(at, jnp.arange(columns * rows))

    nodes = jax.lax.map(by_node, jnp.arange(first.free.shape[0]))
    return jnp.swapaxes(nodes.reshape(first.grid.size, -1, lanes), 0, 1)


def _steps_to_capture(
    zero_sum_game: ZeroSumGame, first: Side, second: Side, index: Int[Array, ""], reach: tuple[int, int]
) -> UInt8[Array, "slices wide high 9 9"]:
    """For a slice of the first robot, by where from it the other one is, and by both their actions."""
    dx, dy, _, _ = first.grid.spacing
    along_x, along_y = (
        (jnp.arange(2 * cells + 1) - cells).astype(jnp.float32) * size
        for cells, size in zip(reach, (dx, dy), strict=True)
    )
    own: RobotState = jax.tree.map(lambda leaf: leaf[index], first.transitions.course)

    def steps(mine: RobotState, theirs: RobotState, x: Scalar, y: Scalar) -> UInt8[Array, ""]:
        def captured(before: tuple[RobotState, RobotState], after: tuple[RobotState, RobotState]) -> Bool[Array, ""]:
            start, end = (
                GameState.of_two(*zero_sum_game.pair(one, replace(other, x=other.x + x, y=other.y + y)), nothing)
                for one, other in (before, after)
            )
            return is_captured(start, end, zero_sum_game.game.capture_distance)

        nothing = jnp.zeros((), jnp.int32)
        hits = jax.vmap(captured)(*zip(ends(mine), ends(theirs), strict=True))
        return jnp.where(jnp.any(hits), jnp.argmax(hits) + 1, _NEVER).astype(jnp.uint8)

    by_answer = jax.vmap(steps, (None, 0, None, None))
    by_action = jax.vmap(by_answer, (0, None, None, None))
    by_place = jax.vmap(jax.vmap(by_action, (None, None, None, 0)), (None, None, 0, None))
    return jax.lax.map(lambda theirs: by_place(own, theirs, along_x, along_y), second.transitions.course)


def _pack(
    role: Role,
    steps: UInt8[Array, "slices wide high 9 9"],
    survives: Bool[Array, "9"],
    possible: Bool[Array, "slices wide high 9"],
) -> UInt16[Array, "slices wide high"]:
    """Which actions decide, and when."""
    answers, own = possible[..., None, :], jnp.broadcast_to(survives, (*steps.shape[:3], NUM_ACTIONS))
    if role == Role.PURSUER:
        latest = jnp.max(jnp.where(answers, steps, 0), axis=-1)
        decides = own & jnp.any(answers, axis=-1) & (latest < _NEVER)
        when = jnp.min(jnp.where(decides, latest, _MOST), axis=-1)
    else:
        soonest = jnp.min(jnp.where(answers, steps, _NEVER), axis=-1)
        decides = own & (soonest < _NEVER)
        when = jnp.max(jnp.where(decides, soonest, 0), axis=-1)
    bits = jnp.array([1 << action for action in range(NUM_ACTIONS)], jnp.uint16)
    which = jnp.sum(jnp.where(decides, bits[None, None, None], 0), axis=-1, dtype=jnp.uint16)
    return jnp.where(which > 0, which | (when.astype(jnp.uint16) << NUM_ACTIONS), 0).astype(jnp.uint16)
