"""Games that begin where others were lost."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.game.game import Game
from apollonius.game.outcome import evader_wins, pursuer_wins
from apollonius.game.types import GameState, Outcome, Role, tree_where
from apollonius.learn.replay_buffer import ReplayBuffer
from apollonius.play.rollout import Games

_KEPT = 4096
"""States that are kept."""
_TOO_LATE = 1.5
"""Time [s] before the end of a lost game from which on it is not begun again."""


class GamesAndLosses(eqx.Module):
    """The running games of a task, and states from which the learner lost within a round."""

    games: Games
    lost_states: ReplayBuffer[GameState]


def empty_restarts(states: GameState) -> ReplayBuffer[GameState]:
    """Return an empty ring for states like these, leaves `[games]`."""
    rows = jax.tree.map(lambda leaf: jnp.zeros((_KEPT, *leaf.shape[1:]), leaf.dtype), states)
    return ReplayBuffer(rows, jnp.zeros((), jnp.int32), jnp.zeros((), jnp.int32))


def add_losses(
    lost: ReplayBuffer[GameState],
    game: Game,
    states: GameState,
    outcome: Int[Array, "steps games"],
    role: Role,
) -> ReplayBuffer[GameState]:
    """Return the ring with those of some states, leaves `[games]`, from which one side lost in the
    steps that followed, but not at once.
    """
    end, rows = jnp.argmax(outcome != Outcome.ONGOING, axis=0), len(lost.rows.steps)
    first = jnp.take_along_axis(outcome, end[None], axis=0)[0]
    won = (
        pursuer_wins(first)
        if role == Role.EVADER
        else evader_wins(first, game.reward.time_limit_wins)
    )
    new = won & (end >= _TOO_LATE / game.dt)
    row = jnp.where(new, (lost.head + jnp.cumsum(new) - 1) % rows, rows)
    starts = eqx.tree_at(lambda batch: batch.steps, states, jnp.zeros_like(states.steps))
    updated_rows = jax.tree.map(
        lambda ring, leaf: ring.at[row].set(leaf, mode="drop"), lost.rows, starts
    )
    return ReplayBuffer(
        updated_rows,
        (lost.head + jnp.sum(new)) % rows,
        jnp.minimum(lost.filled + jnp.sum(new), rows),
    )


def mix_in_restarts(
    share: float, drawn: GameState, lost: ReplayBuffer[GameState], key: PRNGKeyArray
) -> GameState:
    """Return starts, a share of which are states of lost games as soon as there are some. The key
    is consumed.
    """
    which, row = jax.random.split(key)
    count = len(drawn.steps)
    again = jax.random.bernoulli(which, share, (count,)) & (lost.filled > 0)
    index = jax.random.randint(row, (count,), 0, jnp.maximum(lost.filled, 1))
    return jax.vmap(tree_where)(again, jax.tree.map(lambda leaf: leaf[index], lost.rows), drawn)
