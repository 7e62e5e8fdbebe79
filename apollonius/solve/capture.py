"""Captures while actions are held: which of a robot's actions decide the game by one, whatever the
other robot does.
"""

from math import ceil

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, UInt8, UInt16

from apollonius.game.outcome import come_within
from apollonius.game.types import NUM_ACTIONS, RobotState, Role, Scalar
from apollonius.io.limits import JOINT_HOLD
from apollonius.solve.grid import lanes_of
from apollonius.solve.motion import NEVER, ZeroSumGame, step_ends
from apollonius.solve.transition_map import Side

ForcingActions = UInt16[Array, "tiles first lanes"]
"""Nine bits, the first action's lowest, that say which actions decide the game; above them, in how
many steps.
"""


def forcing_actions(zero_sum_game: ZeroSumGame, first: Side, second: Side) -> ForcingActions:
    """Return the actions of the first side after which a capture decides the game within the hold.

    Courses are judged step by step, as the rules do: what ends the game first counts, in one step a
    capture before a failure. An action that would crash later has captured, or is captured, all the
    same. For the pursuer an action decides that wins whatever the evader does, some of it by a
    capture, in as many steps as the best such action takes at most. For the evader an action
    decides to which the pursuer has an answer that captures, in as many steps as the evader can
    hold out.

    For robots that hold their actions, from node to node, the best action that decides is worth
    exactly this. Every other action counts for no more than it is worth to the side that moves
    first:

    - One that this side does not survive is lost at once, although the failure comes some steps
      later, and although the other robot may fail as early whatever it answers. So what the evader
      concedes by it is an upper bound, and what the pursuer gets by it a lower one.
    - After one that it survives, an answer that the other robot does not survive is won at the end
      of the hold only.
    - The pursuer's continues as if the answers that it would have caught had escaped. The evader's
      has no such answers.

    So the pursuer's values are lower bounds on its payoff, and the evader's, their sign turned,
    upper bounds on the pursuer's. Interpolation between nodes can break both.
    """
    farthest = zero_sum_game.game.capture_distance + first.motion.farthest + second.motion.farthest
    dx, dy, _, _ = first.grid.spacing
    return _forcing_actions(
        zero_sum_game, first, second, (ceil(farthest / dx), ceil(farthest / dy))
    )


@eqx.filter_jit
def _forcing_actions(
    zero_sum_game: ZeroSumGame, first: Side, second: Side, reach: tuple[int, int]
) -> ForcingActions:
    """Return the decisive actions by windows of `reach` cells along x and y, beyond which nobody
    can be captured.
    """
    slices, (columns, rows) = second.free.shape[0], first.grid.shape[2:]
    window = (slices, 2 * reach[0] + 1, 2 * reach[1] + 1)
    inside = (slice(None), slice(reach[0], reach[0] + columns), slice(reach[1], reach[1] + rows))
    padding = ((0, 0), *((cells, cells) for cells in reach), (0, 0))
    failures = jnp.pad(jnp.moveaxis(second.failure, 1, -1), padding)
    lanes = lanes_of(second.grid)

    def by_node(index: Int[Array, ""]) -> UInt16[Array, "places tiles lanes"]:
        steps = _steps_to_capture(zero_sum_game, first, second, index, reach)

        def at_place(place: Int[Array, ""]) -> UInt16[Array, "tiles lanes"]:
            x, y = place // rows, place % rows
            their_failures = jax.lax.dynamic_slice(failures, (0, x, y, 0), (*window, NUM_ACTIONS))
            own_failures = first.failure[index, :, x, y]
            window_values = _pack(zero_sum_game.role, steps, own_failures, their_failures)
            by_cell = jnp.zeros(failures.shape[:3], jnp.uint16)
            by_cell = jax.lax.dynamic_update_slice(by_cell, window_values, (0, x, y))
            return by_cell[inside].reshape(-1, lanes)

        return jax.lax.map(at_place, jnp.arange(columns * rows))

    nodes = jax.lax.map(by_node, jnp.arange(first.free.shape[0]))
    return jnp.swapaxes(nodes.reshape(first.grid.size, -1, lanes), 0, 1)


def _steps_to_capture(
    zero_sum_game: ZeroSumGame,
    first: Side,
    second: Side,
    index: Int[Array, ""],
    reach: tuple[int, int],
) -> UInt8[Array, "slices wide high 9 9"]:
    """Return the steps until a capture, by the second robot's relative position and both actions.

    Args:
        zero_sum_game: the game.
        first, second: the two robots.
        index: slice of the first robot.
        reach: cells along x and y within which captures are possible.
    """
    dx, dy, _, _ = first.grid.spacing
    along_x, along_y = (
        (jnp.arange(2 * cells + 1) - cells).astype(jnp.float32) * size
        for cells, size in zip(reach, (dx, dy), strict=True)
    )
    own: RobotState = jax.tree.map(lambda leaf: leaf[index], first.transitions.course)

    captures = jax.vmap(come_within, (0, 0, None))

    def steps(
        own_course: RobotState, their_course: RobotState, x: Scalar, y: Scalar
    ) -> UInt8[Array, ""]:
        place = (their_course.x + x, their_course.y + y)
        moved_course = eqx.tree_at(lambda robot: (robot.x, robot.y), their_course, place)
        distance = zero_sum_game.game.capture_distance
        hits = captures(step_ends(own_course), step_ends(moved_course), distance)
        return jnp.where(jnp.any(hits), jnp.argmax(hits) + 1, NEVER).astype(jnp.uint8)

    by_answer = jax.vmap(steps, (None, 0, None, None))
    by_action = jax.vmap(by_answer, (0, None, None, None))
    by_place = jax.vmap(jax.vmap(by_action, (None, None, None, 0)), (None, None, 0, None))
    return jax.lax.map(
        lambda their_course: by_place(own, their_course, along_x, along_y),
        second.transitions.course,
    )


def _pack(
    role: Role,
    steps: UInt8[Array, "slices wide high 9 9"],
    own: UInt8[Array, "9"],
    opponent_steps: UInt8[Array, "slices wide high 9"],
) -> UInt16[Array, "slices wide high"]:
    """Find the actions that decide, and their times, packed as `ForcingActions`.

    Args:
        role: the side that moves first.
        steps: steps until a capture, by position and both actions.
        own, opponent_steps: the step in which each action of the two robots fails.
    """
    own_failures = own[None, None, None, :, None]
    their_failures = opponent_steps[..., None, :]
    captured = (steps < NEVER) & (steps <= own_failures) & (steps <= their_failures)
    if role == Role.PURSUER:
        other_fails = jnp.where(their_failures < own_failures, their_failures, NEVER)
        won_in = jnp.where(captured, steps, other_fails)
        latest = jnp.max(won_in, axis=-1)
        decides = jnp.any(captured, axis=-1) & (latest < NEVER)
        steps_taken = jnp.min(jnp.where(decides, latest, JOINT_HOLD.most), axis=-1)
    else:
        soonest = jnp.min(jnp.where(captured, steps, NEVER), axis=-1)
        decides = soonest < NEVER
        steps_taken = jnp.max(jnp.where(decides, soonest, 0), axis=-1)
    bits = jnp.array([1 << action for action in range(NUM_ACTIONS)], jnp.uint16)
    actions = jnp.sum(jnp.where(decides, bits[None, None, None], 0), axis=-1, dtype=jnp.uint16)
    return jnp.where(
        actions > 0, actions | (steps_taken.astype(jnp.uint16) << NUM_ACTIONS), 0
    ).astype(jnp.uint16)
