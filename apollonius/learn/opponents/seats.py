"""Which games of a batch belong to the seats of earlier versions: first earlier pursuers, then earlier evaders."""

import jax.numpy as jnp
from jaxtyping import Array, Bool

from apollonius.game.types import Role
from apollonius.learn.opponents.opponent_config import OpponentConfig


def has_seat(config: OpponentConfig, games: int) -> Bool[Array, " games"]:
    """Which games of a batch belong to a seat of either side."""
    return jnp.arange(games) < 2 * config.seats * seat_games(config, games)


def seat_games(config: OpponentConfig, games: int) -> int:
    """Games that belong to one seat."""
    return int(config.share * games) // (2 * config.seats)


def first_game(config: OpponentConfig, role: Role, games: int) -> int:
    """The first game that belongs to a seat of this side."""
    return role * config.seats * seat_games(config, games)
