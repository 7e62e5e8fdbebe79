"""Experience replay: the latest transitions of one side, in the order they were played.

The ring is time-major, `[rows, games]`, so a game's next transition is one row below and n-step returns are read
off at sampling time. Adding is one contiguous slice, written in place where the ring is donated.
"""

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


class Replay(eqx.Module):
    """The ring. `head` is the row written next, `filled` how many rows hold transitions."""

    rows: Row
    head: Int[Array, ""]
    filled: Int[Array, ""]


class Batch(eqx.Module):
    """n-step transitions: where they begin, what they are paid, and where they are valued.

    `reward` is the discounted sum up to the end of the window or of the game, and `discount` what the value of
    `next_observation` counts: gamma to the number of steps taken, or 0 where the rules ended the game.
    """

    observation: Float[Array, "batch size"]
    action: Int[Array, " batch"] | Float[Array, "batch 2"]
    reward: Float[Array, " batch"]
    next_observation: Float[Array, "batch size"]
    discount: Float[Array, " batch"]


def init(rows: int, games: int, size: int, action: jax.ShapeDtypeStruct) -> Replay:
    """An empty ring for `rows` steps of `games` games with observations of `size` numbers and actions like this one."""

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
    )
    return Replay(empty, jnp.zeros((), jnp.int32), jnp.zeros((), jnp.int32))


def add(replay: Replay, new: Row) -> Replay:
    """The ring with new rows `[steps, games]`, over the oldest ones. Its rows must be a multiple of `steps`."""
    rows, steps = replay.rows.reward.shape[0], new.reward.shape[0]
    written = jax.tree.map(
        lambda ring, part: jax.lax.dynamic_update_slice_in_dim(ring, part, replay.head, axis=0), replay.rows, new
    )
    return Replay(written, (replay.head + steps) % rows, jnp.minimum(replay.filled + steps, rows))


def cut(replay: Replay, games: Bool[Array, " games"]) -> Replay:
    """The ring after some games were broken off: their latest transitions are truncated, unless they ended them."""
    latest = (replay.head - 1) % replay.rows.reward.shape[0]
    truncated = replay.rows.truncated[latest] | (games & ~replay.rows.terminated[latest])
    return eqx.tree_at(lambda ring: ring.rows.truncated, replay, replay.rows.truncated.at[latest].set(truncated))


def sample(
    replay: Replay,
    key: PRNGKeyArray,
    batch: int,
    max_n_step: int,
    n_step: Int[Array, ""] | int,
    gamma: float,
    among: tuple[int, int] | None = None,
) -> Batch:
    """Transitions drawn uniformly from the ring, each with the return of up to `n_step` steps. The key is consumed.

    At least `max_n_step` rows must be filled, and `n_step` be from 1 to `max_n_step`. A window that meets the end of
    its game stops there: a terminated game is worth nothing beyond, a truncated one what its final observation is.

    Args:
        among: draw from these games only: the first and how many follow, after the last the first again; None: all.
    """
    rows, games = replay.rows.reward.shape
    age_key, game_key = jax.random.split(key)
    age = jax.random.randint(age_key, (batch,), 0, replay.filled - max_n_step + 1)
    first_game, count = among or (0, games)
    game = (first_game + jax.random.randint(game_key, (batch,), 0, count)) % games
    first = (replay.head - replay.filled + age) % rows

    reward = jnp.zeros(batch, jnp.float32)
    discount = jnp.ones(batch, jnp.float32)
    last = first
    going: Bool[Array, " batch"] = jnp.ones(batch, bool)
    for ahead in range(max_n_step):
        row = (first + ahead) % rows
        reward = reward + jnp.where(going, discount * replay.rows.reward[row, game], 0.0)
        terminated, truncated = replay.rows.terminated[row, game], replay.rows.truncated[row, game]
        discount = jnp.where(going, discount * _continues(terminated, gamma), discount)
        last = jnp.where(going, row, last)
        going = going & ~terminated & ~truncated & (ahead + 1 < n_step)
    return Batch(
        observation=replay.rows.observation[first, game],
        action=replay.rows.action[first, game],
        reward=reward,
        next_observation=replay.rows.next_observation[last, game],
        discount=discount,
    )


def _continues(terminated: Bool[Array, " batch"], gamma: float) -> Float[Array, " batch"]:
    discount: Scalar = jnp.where(terminated, 0.0, gamma)
    return discount
