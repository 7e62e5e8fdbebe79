"""How good a run's players are while they learn: greedy games, always from the same starts."""

from collections.abc import Mapping

import jax
import numpy as np

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool, solo
from apollonius.agents.trained import greedy
from apollonius.game.game import Game, sample_starts
from apollonius.game.outcome import counts_by_name
from apollonius.game.types import ROLES, Outcome, Role
from apollonius.playout import play_out

_SEED = 20_200
"""Of the games, the same for all runs; the judge uses others."""


def greedy_outcomes(game: Game, networks: Mapping[Role, Network], fixed: Pool, games: int) -> dict[str, int]:
    """How many games ended how.

    Args:
        networks: who plays at its best.
        fixed: who plays for a side that has no network.
    """
    start_key, play_key = jax.random.split(jax.random.key(_SEED))
    starts = sample_starts(game, start_key, games)
    players = ROLES.map(lambda role: solo(greedy(networks[role])) if role in networks else fixed)
    results = play_out(game, players, starts, play_key)
    return counts_by_name(np.bincount(np.asarray(results.outcome), minlength=len(Outcome)))
