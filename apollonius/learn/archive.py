"""Archives of earlier versions of a side, and the slots in which some play.

Some games of a batch belong to slots: there an earlier version of one side, frozen and greedy,
plays the other side's learner. The versions in the slots are drawn again at intervals, by the
scheme.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.game.outcome import pursuer_wins
from apollonius.game.types import Flag, Role
from apollonius.learn.opponents import SCHEMES, OpponentConfig

FORGETTING = 0.5
"""Weight that games keep at a renewal: versions are judged by their games against recent learners.
"""


class Archive(eqx.Module):
    """Earlier versions of one side, of which the first `count` are filled, and the version in each
    slot.

    The `games` are recent ones of each version that count (`unbiased_endings`), and those that it
    `lost`.
    """

    networks: Network
    count: Int[Array, ""]
    games: Float[Array, " versions"]
    lost: Float[Array, " versions"]
    slots: Int[Array, " slots"]
    in_slots: Network


def init_archive(network: Network, config: OpponentConfig) -> Archive:
    """Return an archive of one version, which has all slots."""

    def repeated(times: int) -> Network:
        return jax.tree.map(lambda leaf: jnp.repeat(leaf[None], times, axis=0), network)

    return Archive(
        networks=repeated(config.versions),
        count=jnp.ones((), jnp.int32),
        games=jnp.zeros(config.versions, jnp.float32),
        lost=jnp.zeros(config.versions, jnp.float32),
        slots=jnp.zeros(config.slots, jnp.int32),
        in_slots=repeated(config.slots),
    )


def add_version(archive: Archive, network: Network, due: Flag) -> Archive:
    """Return the archive with one more version, where that is due and it is not full."""
    versions = archive.games.shape[0]
    index = jnp.where(
        due, archive.count, versions
    )  # writing there, beyond the last one, does nothing
    networks = jax.tree.map(
        lambda versions_, new: versions_.at[index].set(new, mode="drop"), archive.networks, network
    )
    return replace(
        archive,
        networks=networks,
        count=jnp.minimum(archive.count + due.astype(jnp.int32), versions),
    )


def resample_opponents(archive: Archive, config: OpponentConfig, key: PRNGKeyArray) -> Archive:
    """Return the archive with its slots drawn again and its records discounted. The key is
    consumed.
    """
    versions, weigh = archive.games.shape[0], SCHEMES[config.scheme]
    assert weigh is not None
    weights = jnp.where(
        jnp.arange(versions) < archive.count, weigh((archive.lost + 1) / (archive.games + 2)), 0.0
    )
    slots = jax.random.choice(key, versions, (config.slots,), p=weights / jnp.sum(weights)).astype(
        jnp.int32
    )
    return replace(
        archive,
        games=FORGETTING * archive.games,
        lost=FORGETTING * archive.lost,
        slots=slots,
        in_slots=jax.tree.map(lambda leaf: leaf[slots], archive.networks),
    )


def unbiased_endings(
    over: Bool[Array, "steps games"],
    played: Int[Array, " games"],
    before: Int[Array, ""],
    duration: int,
    longest: Int[Array, ""] | int,
) -> Bool[Array, "steps games"]:
    """Mask the endings of games that started early enough to finish before the next draw of
    opponents.

    Of games that start later the short ones would be counted and the long ones broken off, and the
    winner depends on the length. All games that start before a fixed step are counted, so that the
    win rate is unbiased (Wald's identity).

    Args:
        over: whether a game ends, in each of the steps of an iteration.
        played: steps that each game had made before the iteration.
        before: steps since the last draw of opponents.
        duration: steps between two draws.
        longest: time limit of a game [steps].
    """
    steps = jnp.arange(over.shape[0])[:, None]
    begins = jnp.concatenate([-played[None], jnp.where(over[:-1], steps[1:], -played)])
    return over & (before + jax.lax.cummax(begins) <= duration - longest)


def record_results(
    archive: Archive,
    config: OpponentConfig,
    role: Role,
    outcome: Int[Array, "steps games"],
    over: Bool[Array, "steps games"],
) -> Archive:
    """Return the archive with the games of its slots that end and count (`unbiased_endings`)
    recorded.

    A game without a winner is lost by the pursuer.
    """
    first, games = config.first_game(role, outcome.shape[1]), config.slot_games(outcome.shape[1])
    games_of_slots = slice(first, first + config.slots * games)
    lost = pursuer_wins(outcome[:, games_of_slots]) ^ (role == Role.PURSUER)

    def by_slot(which: Bool[Array, "steps theirs"]) -> Float[Array, " slots"]:
        return jnp.sum(which.astype(jnp.float32).reshape(-1, config.slots, games), axis=(0, 2))

    return replace(
        archive,
        games=archive.games.at[archive.slots].add(by_slot(over[:, games_of_slots])),
        lost=archive.lost.at[archive.slots].add(by_slot(over[:, games_of_slots] & lost)),
    )
