"""How the kept versions of both sides fare against each other: the empirical game of policy-space response oracles."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.pool import solo
from apollonius.agents.trained import greedy
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.outcome import pursuer_wins
from apollonius.game.types import Scalar
from apollonius.learn.opponents.archive import Archive
from apollonius.playout import play_at_once

Payoffs = Float[Array, "pursuers evaders"]
"""The pursuer's share of wins, a row for each of its versions, a column for each of the evader's; nan if not played."""


def nothing_played(versions: int) -> Payoffs:
    """The payoffs before any match."""
    return jnp.full((versions, versions), jnp.nan)


def play_missing(payoffs: Payoffs, game: Game, archives: BySide[Archive], games: int, key: PRNGKeyArray) -> Payoffs:
    """The payoffs with a match for every pair of versions that has none.

    Args:
        games: in a match.
        key: of the starts, which all matches share where it is always the same one.
    """
    start_key, play_key = jax.random.split(key)
    starts = reset_batch(game, start_key, games)
    present = archives.pursuer.filled[:, None] & archives.evader.filled[None, :]
    missing = jnp.isnan(payoffs) & present

    def rate(index: Int[Array, ""]) -> Scalar:
        row, column = jnp.divmod(index, payoffs.shape[1])

        def play() -> Scalar:
            versions = BySide(archives.pursuer.version(row), archives.evader.version(column))
            results = play_at_once(game, versions.map(greedy).map(solo), starts, play_key)
            return jnp.mean(pursuer_wins(results.outcome).astype(jnp.float32))

        # One match after the other, so that pairs which are not there take no time.
        return jax.lax.cond(missing[row, column], play, lambda: payoffs[row, column])

    return jax.lax.map(rate, jnp.arange(payoffs.size)).reshape(payoffs.shape)
