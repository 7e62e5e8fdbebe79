"""How the kept versions of both sides fare against each other: the empirical game of policy-space response oracles."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.agents.pool import solo
from apollonius.agents.trained import at_best
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.outcome import pursuer_wins
from apollonius.game.types import Scalar
from apollonius.learn.opponents import Archive, version
from apollonius.learn.scheme import OpponentConfig
from apollonius.matrix_game import equilibrium, hedge
from apollonius.playout import play_at_once

Payoffs = Float[Array, "pursuers evaders"]
"""The pursuer's share of wins, a row for each of its versions, a column for each of the evader's; nan if not played."""
Mixture = Float[np.ndarray, " versions"]


def nothing_played(versions: int) -> Payoffs:
    """The payoffs before any match."""
    return jnp.full((versions, versions), jnp.nan)


def play_missing(
    payoffs: Payoffs, game: Game, pursuers: Archive, evaders: Archive, games: int, key: PRNGKeyArray
) -> Payoffs:
    """The payoffs with a match for every pair of versions that has none.

    Args:
        games: in a match.
        key: of the starts, which all matches share where it is always the same one.
    """
    start_key, play_key = jax.random.split(key)
    starts = reset_batch(game, start_key, games)
    missing = jnp.isnan(payoffs) & present(pursuers, evaders)

    def rate(index: Int[Array, ""]) -> Scalar:
        row, column = jnp.divmod(index, payoffs.shape[1])

        def play() -> Scalar:
            chasing, fleeing = at_best(version(pursuers, row)), at_best(version(evaders, column))
            results = play_at_once(game, BySide(solo(chasing), solo(fleeing)), starts, play_key)
            return jnp.mean(pursuer_wins(results.outcome).astype(jnp.float32))

        # One match after the other, so that pairs which are not there take no time.
        return jax.lax.cond(missing[row, column], play, lambda: payoffs[row, column])

    return jax.lax.map(rate, jnp.arange(payoffs.size)).reshape(payoffs.shape)


def present(pursuers: Archive, evaders: Archive) -> Bool[Array, "pursuers evaders"]:
    """Which pairs there are versions for."""
    here, there = (jnp.arange(archive.games.shape[0]) < archive.count for archive in (pursuers, evaders))
    return here[:, None] & there[None, :]


def improvement(payoffs: Float[Array, "own others"], newest: Int[Array, ""], others: Int[Array, ""]) -> Scalar:
    """By how much more a version wins than the one before it, on average over the others' first `others` versions."""
    gain = payoffs[newest] - payoffs[newest - 1]
    return jnp.mean(gain, where=jnp.arange(payoffs.shape[1]) < others)


def meta_strategies(config: OpponentConfig, payoffs: Payoffs, pursuers: int, evaders: int) -> tuple[Mixture, Mixture]:
    """How likely either side's versions are to play, by the solution of the matrix game of those that there are.

    `psro` takes the equilibrium (Lanctot et al., "A unified game-theoretic approach to multiagent reinforcement
    learning", 2017, with the Nash solver), `psro-hedge` what Hedge plays on average.
    """
    known = np.asarray(payoffs, np.float64)[:pursuers, :evaders]
    mixed = equilibrium(known) if config.scheme == "psro" else hedge(known)
    chasing, fleeing = np.zeros(payoffs.shape[0], np.float32), np.zeros(payoffs.shape[1], np.float32)
    chasing[:pursuers], fleeing[:evaders] = mixed.rows, mixed.columns
    return chasing, fleeing
