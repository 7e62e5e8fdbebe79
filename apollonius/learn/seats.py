"""Which games of a batch belong to the seats of earlier versions: first earlier pursuers, then earlier evaders."""

import jax.numpy as jnp
from jaxtyping import Array, Bool

from apollonius.game.types import Role
from apollonius.learn.scheme import OpponentConfig


def has_seat(config: OpponentConfig, games: int) -> Bool[Array, " games"]:
    """Which games of a batch belong to a seat of either side."""
    return jnp.arange(games) < 2 * config.seats * seat_games(config, games)


def seat_games(config: OpponentConfig, games: int) -> int:
    """Games that belong to one seat."""
    return int(config.share * games) // (2 * config.seats)


def first_game(config: OpponentConfig, role: Role, games: int) -> int:
    """Earlier pursuers have the first games of a batch, earlier evaders the next."""
    return 0 if role == Role.PURSUER else config.seats * seat_games(config, games)


def against_learner(config: OpponentConfig, role: Role, games: int) -> tuple[int, int]:
    """The games of a batch in which one side meets the other side's learner: the first of them and how many follow, at
    the end of the batch going on from its beginning.
    """
    other = Role.EVADER if role == Role.PURSUER else Role.PURSUER
    seated = config.seats * seat_games(config, games)
    return first_game(config, other, games) + seated, games - seated
