"""Experience replay: the latest transitions of one side, in the order they were played.

The ring is time-major, `[rows, games]`, so a game's next transition is one row below and n-step
returns are read off at sampling time. Adding is one contiguous slice, written in place where the
ring is donated. Robots of a team, who learn as one, have columns of their own, next to each other
for every game.
"""

from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.game.types import Role
from apollonius.play.rollout import Transition


class Row(eqx.Module):
    """Transitions of one side at one or more time steps of every game."""

    observation: Float[Array, "*steps games size"]
    action: Int[Array, "*steps games"] | Float[Array, "*steps games 2"]
    reward: Float[Array, "*steps games"]
    next_observation: Float[Array, "*steps games next"]
    terminated: Bool[Array, "*steps games"]
    truncated: Bool[Array, "*steps games"]
    active: Bool[Array, "*steps games"]
    """True if the robot was in play; other transitions do not count."""


Rows = TypeVar("Rows")


class ReplayBuffer(eqx.Module, Generic[Rows]):
    """The ring. `head` is the row written next, `filled` the number of rows that hold something."""

    rows: Rows
    head: Int[Array, ""]
    filled: Int[Array, ""]


class TransitionBatch(eqx.Module):
    """n-step transitions.

    `reward` is the discounted sum up to the end of the window or of the game, and `discount` the
    weight of the value of `next_observation`: gamma to the number of steps taken, or 0 where the
    rules ended the game. `active` says which transitions count.
    """

    observation: Float[Array, "batch size"]
    action: Int[Array, " batch"] | Float[Array, "batch 2"]
    reward: Float[Array, " batch"]
    next_observation: Float[Array, "batch size"]
    discount: Float[Array, " batch"]
    active: Bool[Array, " batch"]


def init_buffer(rows: int, games: int, size: int, continuous: bool = False) -> ReplayBuffer[Row]:
    """Return an empty ring for `rows` steps of `games` games, by the size of observations and the
    kind of actions.
    """

    def zeros(shape: tuple[int, ...] = (), dtype: Any = jnp.float32) -> Array:
        return jnp.zeros((rows, games, *shape), dtype)

    empty = Row(
        observation=zeros((size,)),
        action=zeros((2,)) if continuous else zeros(dtype=jnp.int32),
        reward=zeros(),
        next_observation=zeros((size,)),
        terminated=zeros(dtype=bool),
        truncated=zeros(dtype=bool),
        active=zeros(dtype=bool),
    )
    return ReplayBuffer(empty, jnp.zeros((), jnp.int32), jnp.zeros((), jnp.int32))


def add(buffer: ReplayBuffer[Rows], new: Rows) -> ReplayBuffer[Rows]:
    """Return the ring with new rows over the oldest ones. Its rows must be a multiple of theirs."""
    rows, steps = (jax.tree.leaves(each)[0].shape[0] for each in (buffer.rows, new))
    written = jax.tree.map(
        lambda ring, part: jax.lax.dynamic_update_slice_in_dim(ring, part, buffer.head, axis=0),
        buffer.rows,
        new,
    )
    return ReplayBuffer(
        written, (buffer.head + steps) % rows, jnp.minimum(buffer.filled + steps, rows)
    )


def rows_of(played: Transition, role: Role, limit_terminates: bool = False) -> Row:
    """Return one side's transitions, of a team those of each robot, whose game is over when it is
    out of play.

    Args:
        played: the transitions of a batch of games.
        role: the side.
        limit_terminates: whether the time limit is an end by the rules, without a value beyond.
    """
    side = played.sides[role]
    terminated, truncated = played.terminated, played.truncated
    if limit_terminates:
        terminated, truncated = played.ended, jnp.zeros_like(played.ended)
    content = side.observation, side.action, side.reward, side.next_observation
    robots = side.reward.size // terminated.size

    shape = side.lost.shape

    def of_robots(flag: Array) -> Array:
        return jnp.repeat(flag, robots, axis=1).reshape(shape)

    row = Row(
        *content, of_robots(terminated) | side.lost, of_robots(truncated) & ~side.lost, side.active
    )
    steps, games = terminated.shape
    return jax.tree.map(
        lambda leaf: leaf.reshape(steps, games * robots, *leaf.shape[side.reward.ndim :]), row
    )


def sample_batch(
    buffer: ReplayBuffer[Row],
    key: PRNGKeyArray,
    batch: int,
    max_n_step: int,
    n_step: Int[Array, ""] | int,
    gamma: float,
) -> TransitionBatch:
    """Draw transitions uniformly, each with the return of up to `n_step` steps. The key is
    consumed.

    At least `max_n_step` rows must be filled, and `n_step` be from 1 to `max_n_step`. A window that
    meets the end of its game stops there: beyond it a terminated game has no value, a truncated one
    that of its final observation.
    """
    rows, games = buffer.rows.reward.shape
    age_key, game_key = jax.random.split(key)
    age = jax.random.randint(age_key, (batch,), 0, buffer.filled - max_n_step + 1)
    game = jax.random.randint(game_key, (batch,), 0, games)
    first = (buffer.head - buffer.filled + age) % rows

    reward = jnp.zeros(batch, jnp.float32)
    discount = jnp.ones(batch, jnp.float32)
    last = first
    going: Bool[Array, " batch"] = jnp.ones(batch, bool)
    for ahead in range(max_n_step):
        row = (first + ahead) % rows
        reward = reward + jnp.where(going, discount * buffer.rows.reward[row, game], 0.0)
        terminated, truncated = buffer.rows.terminated[row, game], buffer.rows.truncated[row, game]
        discount = jnp.where(going, discount * jnp.where(terminated, 0.0, gamma), discount)
        last = jnp.where(going, row, last)
        going = going & ~terminated & ~truncated & (ahead + 1 < n_step)
    return TransitionBatch(
        observation=buffer.rows.observation[first, game],
        action=buffer.rows.action[first, game],
        reward=reward,
        next_observation=buffer.rows.next_observation[last, game],
        discount=discount,
        active=buffer.rows.active[first, game],
    )
