"""What a player does in real games: the states it decides in, and its actions."""

import functools
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int, PRNGKeyArray

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import Pool, solo
from apollonius.agents.uniform import Uniform
from apollonius.errors import require
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, Actions, Role
from apollonius.rollout import Games, begin, collect

_GAMES = 100
_SPACING = 5
"""Steps between two states that are kept: the ones between are much like them."""


@dataclass(frozen=True)
class Decisions:
    """States, actions and what was seen, of one side.

    Attributes:
        states: x [m], y [m], v [m/s], heading [rad] of the side's own robot, then of its opponent.
        observations: the same in the player's profile.
        actions: what the player did: 0..8, or two gears.
    """

    states: Float32[np.ndarray, "count 8"]
    observations: Float32[np.ndarray, "count size"]
    actions: Int[np.ndarray, " count"] | Float32[np.ndarray, "count 2"]


def decisions(game: Game, player: AbstractPolicy, role: Role, count: int, seed: int = 0) -> Decisions:
    """Decisions in games against a random opponent, 100 of them at a time; a finished one begins again.

    Args:
        count: how many.
        seed: of starts and of everything random in the games.

    Raises:
        InvalidInput: unless `count` is at least 1.
    """
    require(count >= 1, "count", count, "at least 1")
    states, seen, actions = _play(game, solo(player), role, jax.random.key(seed), rows=-(-count // _GAMES))
    return Decisions(*(np.asarray(part)[:count] for part in (states, seen, actions)))


@functools.partial(jax.jit, static_argnames=("role", "rows"))
def _play(
    game: Game, player: Pool, role: Role, key: PRNGKeyArray, rows: int
) -> tuple[Float[Array, "decisions 8"], Float[Array, "decisions size"], Actions]:
    start_key, word_key, play_key = jax.random.split(key, 3)
    players = ROLES.map(lambda side: player if side == role else solo(Uniform()))
    starts = jax.tree.map(lambda leaf: leaf.reshape(rows, _GAMES), reset_batch(game, start_key, rows * _GAMES))
    first = jax.tree.map(lambda leaf: leaf[0], starts)
    games = begin(first, players, jax.random.bits(word_key, (2, _GAMES), jnp.uint32))

    def step(games: Games, row: Int[Array, ""]) -> tuple[Games, tuple[Array, Array, Array]]:
        fresh = jax.tree.map(lambda leaf: leaf[row][None], starts)
        after, moves = collect(game, players, games, fresh, jax.random.fold_in(play_key, row), _SPACING)
        robots, side = games.state.robots, moves.sides[role]
        own_first = jax.tree.leaves((robots[role], robots[role.other]))
        return after, (jnp.stack(own_first, axis=-1), side.observation[0], side.action[0])

    kept = jax.lax.scan(step, games, jnp.arange(rows))[1]
    states, seen, actions = (leaf.reshape(rows * _GAMES, *leaf.shape[2:]) for leaf in kept)
    return states, seen, actions
