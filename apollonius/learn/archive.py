"""Earlier versions of a side, kept in an archive, and the seats in which some of them play.

Some games of a batch belong to seats: there an earlier version of one side, frozen and greedy, plays the other side's
learner. Who sits is drawn anew at intervals, by the scheme; the games of all seats then begin anew, so an opponent
never changes within a game. Everything is part of the training state, so a resumed run draws the same opponents.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Seated
from apollonius.agents.trained import exploring, greedy
from apollonius.game.outcome import pursuer_wins
from apollonius.game.types import Role, Scalar
from apollonius.learn.opponents import OpponentConfig

FORGETTING = 0.5
"""What games before a renewal count after it: versions are judged by how today's learner fares against them."""


class Archive(eqx.Module):
    """Earlier versions of one side.

    Attributes:
        networks: leaves with a leading axis of length `versions`, of which `count` are filled.
        games, lost: games of sat versions counted lately (`counted`), and how many of them they lost.
        seats: the version in each seat.
        seated: the networks of the seats, leaves with a leading axis of length `seats`.
    """

    networks: Network
    count: Int[Array, ""]
    games: Float[Array, " versions"]
    lost: Float[Array, " versions"]
    seats: Int[Array, " seats"]
    seated: Network

    @property
    def filled(self) -> Bool[Array, " versions"]:
        """Which versions there are."""
        return jnp.arange(self.games.shape[0]) < self.count


def init(network: Network, config: OpponentConfig) -> Archive:
    """An archive of one version, which has all seats."""

    def repeated(times: int) -> Network:
        return jax.tree.map(lambda leaf: jnp.repeat(leaf[None], times, axis=0), network)

    return Archive(
        networks=repeated(config.versions),
        count=jnp.ones((), jnp.int32),
        games=jnp.zeros(config.versions, jnp.float32),
        lost=jnp.zeros(config.versions, jnp.float32),
        seats=jnp.zeros(config.seats, jnp.int32),
        seated=repeated(config.seats),
    )


def enter(archive: Archive, network: Network, due: Bool[Array, ""]) -> Archive:
    """The archive with one more version, where that is due and there is room."""
    due = due & (archive.count < archive.games.shape[0])
    place = jnp.minimum(archive.count, archive.games.shape[0] - 1)
    networks = jax.tree.map(
        lambda all_, one: all_.at[place].set(jnp.where(due, one, all_[place])), archive.networks, network
    )
    return replace(archive, networks=networks, count=archive.count + due.astype(jnp.int32))


def probabilities(archive: Archive, config: OpponentConfig) -> Float[Array, " versions"]:
    """Return how likely each version is to be given a seat."""
    weights = jnp.where(archive.filled, config.rule.weigh((archive.lost + 1) / (archive.games + 2)), 0.0)
    return weights / jnp.sum(weights)


def renew(archive: Archive, config: OpponentConfig, key: PRNGKeyArray) -> Archive:
    """Return the archive with its seats drawn again and its records aged. The key is consumed."""
    chance = probabilities(archive, config)
    seats = jax.random.choice(key, chance.shape[0], (config.seats,), p=chance).astype(jnp.int32)
    return replace(
        archive,
        games=FORGETTING * archive.games,
        lost=FORGETTING * archive.lost,
        seats=seats,
        seated=jax.tree.map(lambda leaf: leaf[seats], archive.networks),
    )


def counted(
    over: Bool[Array, "steps games"],
    played: Int[Array, " games"],
    before: Int[Array, ""],
    sitting: int,
    longest: Int[Array, ""] | int,
) -> Bool[Array, "steps games"]:
    """Where games end that say how good a version is: those that began so early that they end before seats change
    hands, however long they last.

    Of the games that begin later, the short ones would be counted and the long ones broken off; and which side wins has
    to do with how long it takes. Of those that begin before a fixed step all are counted, so that the share of them
    that a version loses is its share of all games (Wald's identity).

    Args:
        over: where games end.
        played: steps that each game under way had taken before the first of these.
        before: steps of the sitting before the first of these.
        sitting: steps between two changes of seats.
        longest: steps that a game can last.
    """
    steps = jnp.arange(over.shape[0])[:, None]
    begins = jnp.concatenate([-played[None], jnp.where(over[:-1], steps[1:], -played)])
    return over & (before + jax.lax.cummax(begins) <= sitting - longest)


def record(
    archive: Archive,
    config: OpponentConfig,
    role: Role,
    outcome: Int[Array, "steps games"],
    over: Bool[Array, "steps games"],
) -> Archive:
    """The archive with these games of its seats counted. A game that nobody won is lost by the pursuer.

    Args:
        over: where games end that are to be counted (`counted`).
    """
    first, games = config.first_game(role, outcome.shape[1]), config.seat_games(outcome.shape[1])
    theirs = slice(first, first + config.seats * games)
    lost = pursuer_wins(outcome[:, theirs]) ^ (role == Role.PURSUER)

    def by_seat(which: Bool[Array, "steps theirs"]) -> Float[Array, " seats"]:
        return jnp.sum(which.astype(jnp.float32).reshape(-1, config.seats, games), axis=(0, 2))

    return replace(
        archive,
        games=archive.games.at[archive.seats].add(by_seat(over[:, theirs])),
        lost=archive.lost.at[archive.seats].add(by_seat(over[:, theirs] & lost)),
    )


def seat(archive: Archive, config: OpponentConfig, role: Role, learner: Network, amount: Scalar, games: int) -> Seated:
    """All who play one side of a batch of games: its learner, and in the seats its earlier versions.

    Args:
        amount: how much the learner explores (`agents.trained.exploring`).
    """
    return Seated(
        at_large=exploring(learner, amount),
        seated=greedy(archive.seated),
        seats=config.seats,
        first=config.first_game(role, games),
        games=config.seat_games(games),
    )
