"""Batches of games of half seconds, and the courses that players drive in them."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.game.game import Game
from apollonius.game.types import BySide, GameState, Outcome, RobotState, Role
from apollonius.solve.players import batch_actions

HOLD = 5
"""Steps for which plans are followed."""
STEPS = 60
"""Steps of a course."""
AHEAD = 7
"""The action that drives straight on."""
STRUCTURED = 9 * 44
"""Courses that are not random."""


def some_courses(seed: int, random: int) -> Int[Array, "courses steps"]:
    """Return courses of action: after each first action a turn and straight on, and random ones."""
    rows: list[list[int]] = []
    for first in range(9):
        begins = [first] * HOLD
        for turn in (0, 2):
            for acceleration in (0, 1, 2):
                for count in (5, 10, 15, 20, 30, 40, STEPS - HOLD):
                    rows.append([*begins, *[3 * acceleration + turn] * count, *[AHEAD] * STEPS])
        rows.append(begins + [AHEAD] * STEPS)
        rows.append(begins + [4] * STEPS)
    draw = np.random.default_rng(seed)
    for _ in range(random):
        row: list[int] = []
        while len(row) < STEPS:
            action = draw.integers(9) if draw.random() < 0.5 else draw.choice([6, 7, 8])
            row += [int(action)] * int(draw.choice([5, 10, 15, 20]))
        row[:HOLD] = [row[0]] * HOLD
        rows.append(row)
    return jnp.asarray(np.array([row[:STEPS] for row in rows], np.int32))


HALF_SECONDS = np.array([[a] * 2 + [b] * 3 for a in range(9) for b in range(9)], np.int32)
"""Ways to act for half a second: one action, then another."""


def rows_of(tree: Any, numbers: Any) -> Any:
    """Return some rows of a batch."""
    return jax.tree.map(lambda leaf: leaf[jnp.asarray(numbers)], tree)


def repeated(tree: Any, count: int) -> Any:
    """Return a batch of one row's copies."""
    return jax.tree.map(lambda leaf: jnp.repeat(leaf[None], count, axis=0), tree)


def filled(numbers: np.ndarray, count: int) -> np.ndarray:
    """Return numbers of rows, filled with the first one up to a count."""
    return np.r_[numbers, np.full(max(count - len(numbers), 0), numbers[0])]


class Played(NamedTuple):
    """A batch of games after some steps, and the memories of the policy that answers."""

    robots: tuple[RobotState, RobotState]
    outcome: Int[Array, " games"]
    memories: Memory


def play(
    game: Game,
    played: Played,
    actions: Int[Array, "games steps"],
    answer: AbstractPolicy | Int[Array, "games steps"],
    role: Role = Role.PURSUER,
) -> Played:
    """Play actions of a side against a policy or actions of the other one."""
    states = jax.vmap(GameState.of_two)(*played.robots, steps=jnp.zeros_like(played.outcome))
    bits = jnp.zeros(len(actions), jnp.uint32)

    def one_step(carry: tuple[GameState, Array, Memory], step: tuple[Array, Array]) -> Any:
        states, outcome, memories = carry
        action, number = step
        if isinstance(answer, AbstractPolicy):
            answers, memories = batch_actions(answer, game, states, role.other, memories, bits)
        else:
            answers = answer[:, number]
        after = jax.vmap(game.step)(states, *BySide.of(role, action, answers))
        is_on = outcome == Outcome.ONGOING
        states = jax.tree.map(lambda new, old: jnp.where(is_on, new, old), after.state, states)
        return (states, jnp.where(is_on, after.outcome, outcome), memories), None

    steps = actions.T, jnp.arange(actions.shape[1])
    first = states, played.outcome, played.memories
    (states, outcome, memories), _ = jax.lax.scan(one_step, first, steps)
    return Played((states.pursuer, states.evader), outcome, memories)


play_courses = eqx.filter_jit(play)
