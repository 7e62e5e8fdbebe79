"""Games that begin again when they end, from starts that are drawn beforehand."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.game.dynamics import as_action
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import BySide, GameState, T, Timestep, tree_where
from apollonius.game.validation import require_key
from apollonius.io.errors import require
from apollonius.io.limits import PARALLEL_GAMES, CountLimit

STARTS = 16
"""Starts that are drawn for each game of a batch, unless others are asked for."""


class RunningBatch(eqx.Module):
    """Games under way: their states, leaves `[games]`, and how many steps the batch has made."""

    state: GameState
    turn: Int[Array, ""]


BothActions = BySide[Any] | Sequence[Any] | Array
"""The pursuers' and the evaders' actions in every game."""
Step = Callable[[RunningBatch, BothActions], tuple[RunningBatch, Timestep]]
"""One step of every game of a batch."""


def autoreset(
    game: Game, key: PRNGKeyArray, games: int, starts: int = STARTS
) -> tuple[RunningBatch, Step]:
    """Make a batch of games that begin again when they end, and its step function.

    Returns the batch at its starts, and `step(batch, actions) -> (batch, timestep)`, which is pure:
    `jit` and `scan` take it as it stands. `batch.state` has leaves `[games]`. `timestep.state` is
    the state that a step led to, also in a game that ended; the next batch has a new start there.

    The actions are a pair, the pursuers' and the evaders': `[games]` of 0 to 8, `[games, 2]` of
    numbers in [-1, 1], or one number for all games; of a team a tuple of these, one for each robot.

    Args:
        game: the rules.
        key: draws the starts; consumed.
        games: the number of games.
        starts: the number of starts of each game. A game takes them in turn, then the first again:
            drawing one for every game at every step would cost far more than the step. The `step`
            of another call, with another key, takes the same batch and has other starts.

    Raises:
        InvalidInput: for no games, no starts, and actions of another number of games.
    """
    require_key(key)
    PARALLEL_GAMES.require("games", games)
    CountLimit(0).require("starts", starts)
    pool = _draw(game, key, games, starts)

    def per_game(action: Any) -> Array:
        array = as_action(action) if jnp.ndim(action) == 0 else jnp.asarray(action)
        actions_of_games = jnp.broadcast_to(array, (games,)) if array.ndim == 0 else array
        require(
            len(actions_of_games) == games,
            "actions",
            f"of shape {array.shape}",
            f"one number, or of {games} games",
        )
        return actions_of_games

    def step(batch: RunningBatch, actions: BothActions) -> tuple[RunningBatch, Timestep]:
        pursuers, evaders = actions
        batch_actions = jax.tree.map(per_game, (pursuers, evaders))
        after = jax.vmap(game.step)(batch.state, *batch_actions)
        has_ended = after.terminated | after.truncated
        state = jax.vmap(tree_where)(has_ended, row_at_turn(pool, batch.turn), after.state)
        return RunningBatch(state, batch.turn + 1), after

    return RunningBatch(row_at_turn(pool, jnp.int32(0)), jnp.int32(1)), step


@partial(jax.jit, static_argnums=(2, 3))
def _draw(game: Game, key: PRNGKeyArray, games: int, starts: int) -> GameState:
    states = reset_batch(game, key, starts * games)
    return jax.tree.map(lambda leaf: leaf.reshape(starts, games, *leaf.shape[1:]), states)


def row_at_turn(rows: T, turn: Int[Array, ""]) -> T:
    """Return the row of a pytree, leaves `[rows, ...]`, whose turn it is; after the last row the
    first follows.
    """
    count = len(jax.tree.leaves(rows)[0])
    return jax.tree.map(
        lambda leaf: jax.lax.dynamic_index_in_dim(leaf, turn % count, keepdims=False), rows
    )
