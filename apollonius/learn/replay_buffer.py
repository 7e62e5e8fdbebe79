"""Experience replay: the latest transitions of one side, in the order they were played.

The ring is time-major, `[rows, games]`, so a game's next transition is one row below and n-step returns are read
off at sampling time. Adding is one contiguous slice, written in place where the ring is donated. Robots of a team, who
learn as one, have columns of their own, next to each other for every game.
"""

from typing import Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.game.types import Scalar

DISCRETE, CONTINUOUS = jax.ShapeDtypeStruct((), jnp.int32), jax.ShapeDtypeStruct((2,), jnp.float32)
"""What one action of either kind takes."""


class Row(eqx.Module):
    """Transitions of one side at one or more time steps of every game."""

    observation: Float[Array, "*steps games size"]
    action: Int[Array, "*steps games"] | Float[Array, "*steps games 2"]
    reward: Float[Array, "*steps games"]
    next_observation: Float[Array, "*steps games size"]
    terminated: Bool[Array, "*steps games"]
    truncated: Bool[Array, "*steps games"]
    active: Bool[Array, "*steps games"] | None = None
    """Of teams whether the robot was in play: what is there of one that was not is nothing to learn from."""


Rows = TypeVar("Rows")


class ReplayBuffer(eqx.Module, Generic[Rows]):
    """The ring. `head` is the row written next, `filled` how many rows hold something."""

    rows: Rows
    head: Int[Array, ""]
    filled: Int[Array, ""]


class Batch(eqx.Module):
    """n-step transitions: where they begin, what they are paid, and where they are valued.

    `reward` is the discounted sum up to the end of the window or of the game, and `discount` what the value of
    `next_observation` counts: gamma to the number of steps taken, or 0 where the rules ended the game. `active` says of
    teams which of them count.
    """

    observation: Float[Array, "batch size"]
    action: Int[Array, " batch"] | Float[Array, "batch 2"]
    reward: Float[Array, " batch"]
    next_observation: Float[Array, "batch size"]
    discount: Float[Array, " batch"]
    active: Bool[Array, " batch"] | None = None


def init(rows: int, games: int, size: int, action: jax.ShapeDtypeStruct, of_teams: bool = False) -> ReplayBuffer[Row]:
    """An empty ring for `rows` steps of `games` games with observations of `size` numbers and actions like this one.

    Args:
        of_teams: whether robots can be out of play.
    """

    def observations() -> Float[Array, "rows games size"]:
        return jnp.zeros((rows, games, size), jnp.float32)

    def flags() -> Bool[Array, "rows games"]:
        return jnp.zeros((rows, games), bool)

    empty = Row(
        observation=observations(),
        action=jnp.zeros((rows, games, *action.shape), action.dtype),
        reward=jnp.zeros((rows, games), jnp.float32),
        next_observation=observations(),
        terminated=flags(),
        truncated=flags(),
        active=flags() if of_teams else None,
    )
    return ReplayBuffer(empty, jnp.zeros((), jnp.int32), jnp.zeros((), jnp.int32))


def add(buffer: ReplayBuffer[Rows], new: Rows) -> ReplayBuffer[Rows]:
    """Return the ring with new rows over the oldest ones. Its rows must be a multiple of theirs."""
    rows, steps = (jax.tree.leaves(each)[0].shape[0] for each in (buffer.rows, new))
    written = jax.tree.map(
        lambda ring, part: jax.lax.dynamic_update_slice_in_dim(ring, part, buffer.head, axis=0), buffer.rows, new
    )
    return ReplayBuffer(written, (buffer.head + steps) % rows, jnp.minimum(buffer.filled + steps, rows))


def cut(buffer: ReplayBuffer[Row], games: Bool[Array, " games"]) -> ReplayBuffer[Row]:
    """The ring after some games were broken off: their latest transitions are truncated, unless they ended them."""
    rows, columns = buffer.rows.reward.shape
    latest, broken_off = (buffer.head - 1) % rows, jnp.repeat(games, columns // games.shape[0])
    truncated = buffer.rows.truncated[latest] | (broken_off & ~buffer.rows.terminated[latest])
    return eqx.tree_at(lambda ring: ring.rows.truncated, buffer, buffer.rows.truncated.at[latest].set(truncated))


def sample(
    buffer: ReplayBuffer[Row],
    key: PRNGKeyArray,
    batch: int,
    max_n_step: int,
    n_step: Int[Array, ""] | int,
    gamma: float,
) -> Batch:
    """Transitions drawn uniformly from the ring, each with the return of up to `n_step` steps. The key is consumed.

    At least `max_n_step` rows must be filled, and `n_step` be from 1 to `max_n_step`. A window that meets the end of
    its game stops there: a terminated game is worth nothing beyond, a truncated one what its final observation is.
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
        discount = jnp.where(going, discount * _continues(terminated, gamma), discount)
        last = jnp.where(going, row, last)
        going = going & ~terminated & ~truncated & (ahead + 1 < n_step)
    return Batch(
        observation=buffer.rows.observation[first, game],
        action=buffer.rows.action[first, game],
        reward=reward,
        next_observation=buffer.rows.next_observation[last, game],
        discount=discount,
        active=None if buffer.rows.active is None else buffer.rows.active[first, game],
    )


def _continues(terminated: Bool[Array, " batch"], gamma: float) -> Float[Array, " batch"]:
    discount: Scalar = jnp.where(terminated, 0.0, gamma)
    return discount
