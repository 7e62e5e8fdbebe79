"""Whom the learning sides of self-play meet: each other, and earlier versions that are kept in an archive.

Some games of a batch belong to seats: there an earlier version of one side, frozen and greedy, plays the other side's
learner. Who sits is drawn anew at intervals, by the scheme; the games of all seats then begin anew, so an opponent
never changes within a game. Everything is part of the training state, so a resumed run draws the same opponents.
In a league the last seats belong to a side's exploiter, which goes on learning while it sits.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Seated
from apollonius.agents.trained import at_best, exploring
from apollonius.game.outcome import pursuer_wins
from apollonius.game.types import Role, Scalar
from apollonius.learn.scheme import OpponentConfig
from apollonius.learn.seats import first_game, seat_games

FORGETTING = 0.5
"""What games before a renewal count after it: versions are judged by how today's learner fares against them."""
QUALITY_STEP = 0.01
"""Eta of OpenAI Five's quality scores (Berner et al., "Dota 2 with large scale deep reinforcement learning", 2019)."""


class Archive(eqx.Module):
    """Earlier versions of one side.

    Attributes:
        networks: leaves with a leading axis of length `versions`, of which `count` are filled.
        games, lost: games of sat versions counted lately (`counted`), and how many of them they lost.
        quality: scores of the scheme `latest-80-20`.
        seats: the version in each seat; where an exploiter sits, the number of versions there can be.
        seated: the networks of the seats, leaves with a leading axis of length `seats`.
    """

    networks: Network
    count: Int[Array, ""]
    games: Float[Array, " versions"]
    lost: Float[Array, " versions"]
    quality: Float[Array, " versions"]
    seats: Int[Array, " seats"]
    seated: Network


def init(network: Network, config: OpponentConfig) -> Archive:
    """An archive of one version, which has all seats."""
    nothing = jnp.zeros(config.versions, jnp.float32)

    def repeated(times: int) -> Network:
        return jax.tree.map(lambda leaf: jnp.repeat(leaf[None], times, axis=0), network)

    return Archive(
        networks=repeated(config.versions),
        count=jnp.ones((), jnp.int32),
        games=nothing,
        lost=jnp.copy(nothing),
        quality=jnp.copy(nothing),
        seats=jnp.zeros(config.seats, jnp.int32),
        seated=repeated(config.seats),
    )


def enter(archive: Archive, network: Network, due: Bool[Array, ""]) -> Archive:
    """The archive with one more version, where that is due and there is room. It begins with the best quality."""
    due = due & (archive.count < archive.games.shape[0])
    place = jnp.minimum(archive.count, archive.games.shape[0] - 1)
    networks = jax.tree.map(
        lambda all_, one: all_.at[place].set(jnp.where(due, one, all_[place])), archive.networks, network
    )
    best = jnp.max(jnp.where(_filled(archive), archive.quality, -jnp.inf))
    return Archive(
        networks=networks,
        count=archive.count + due,
        games=archive.games,
        lost=archive.lost,
        quality=archive.quality.at[place].set(jnp.where(due, best, archive.quality[place])),
        seats=archive.seats,
        seated=archive.seated,
    )


def version(archive: Archive, number: Int[Array, ""]) -> Network:
    """One of the kept networks."""
    return jax.tree.map(lambda leaf: leaf[number], archive.networks)


def withdraw(archive: Archive, due: Bool[Array, ""]) -> Archive:
    """The archive without the version that entered last, where that is due. It must not have had a seat."""
    return eqx.tree_at(lambda this: this.count, archive, archive.count - due)


def probabilities(archive: Archive, config: OpponentConfig) -> Float[Array, " versions"]:
    """How likely each version is to be given a seat, for schemes that do not ask how versions fare against each other.

    Of a version that lost a share w of its games to the learner: `uniform` and `gated` ignore w (fictitious self-play,
    Heinrich, Lanctot, Silver 2015); `prioritised-hard` and `league` weigh (1 - w)^2 and `prioritised-even` w (1 - w)
    (AlphaStar, Vinyals et al. 2019); `latest-80-20` takes the softmax of the quality scores (OpenAI Five).
    """
    filled = _filled(archive)
    w = (archive.lost + 1) / (archive.games + 2)
    if config.scheme == "latest-80-20":
        return _by_quality(archive)
    hard, even = (1 - w) ** 2, w * (1 - w)
    weighed = {"prioritised-hard": hard, "league": hard, "prioritised-even": even}
    weights = jnp.where(filled, weighed.get(config.scheme, jnp.ones_like(w)), 0.0)
    return weights / jnp.sum(weights)


def renew(
    archive: Archive, config: OpponentConfig, key: PRNGKeyArray, mixture: Float[Array, " versions"] | None = None
) -> Archive:
    """The archive with its seats drawn anew and its records aged. The key is consumed.

    Args:
        mixture: how likely each version is to be given a seat; None leaves it to `probabilities`.
    """
    chance = probabilities(archive, config) if mixture is None else mixture
    drawn = jax.random.choice(key, chance.shape[0], (config.seats,), p=chance).astype(jnp.int32)
    seats = jnp.where(jnp.arange(config.seats) < config.version_seats, drawn, chance.shape[0])
    return Archive(
        networks=archive.networks,
        count=archive.count,
        games=FORGETTING * archive.games,
        lost=FORGETTING * archive.lost,
        quality=archive.quality,
        seats=seats,
        seated=jax.tree.map(lambda leaf: leaf[drawn], archive.networks),
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
    """The archive with these games of its seats counted. A game that nobody won is lost by the pursuer. The games of an
    exploiter are nobody's.

    A version's quality falls by eta / (N p) for each game it lost, N the number of versions and p its probability.

    Args:
        over: where games end that are to be counted (`counted`).
    """
    first, games = first_game(config, role, outcome.shape[1]), seat_games(config, outcome.shape[1])
    theirs = slice(first, first + config.seats * games)
    pursuer_won = pursuer_wins(outcome[:, theirs])
    lost = ~pursuer_won if role == Role.PURSUER else pursuer_won

    def by_seat(which: Bool[Array, "steps theirs"]) -> Float[Array, " seats"]:
        return jnp.sum(which.astype(jnp.float32).reshape(-1, config.seats, games), axis=(0, 2))

    lost_games = by_seat(over[:, theirs] & lost)
    chance = _by_quality(archive)[archive.seats]
    return eqx.tree_at(
        lambda this: (this.games, this.lost, this.quality),
        archive,
        (
            archive.games.at[archive.seats].add(by_seat(over[:, theirs]), mode="drop"),
            archive.lost.at[archive.seats].add(lost_games, mode="drop"),
            archive.quality.at[archive.seats].add(-QUALITY_STEP * lost_games / (archive.count * chance), mode="drop"),
        ),
    )


def added_up(before: Archive, after: Archive, across: str) -> Archive:
    """The records after games on several devices, each with seats of its own: what all of them have seen since.

    Args:
        across: name of the axis of devices.
    """
    names = ("games", "lost", "quality")
    seen = {name: getattr(after, name) - getattr(before, name) for name in names}
    everywhere = jax.lax.psum(seen, across)
    return replace(after, **{name: getattr(before, name) + everywhere[name] for name in names})


def seat(
    archive: Archive,
    config: OpponentConfig,
    role: Role,
    learner: Network,
    amount: Scalar,
    games: int,
    exploiter: Network | None = None,
) -> Seated:
    """All who play one side of a batch of games: its learner, and in the seats its earlier versions.

    Args:
        amount: how much the learner explores (`agents.trained.exploring`).
        exploiter: who has the last seats, exploring as much as the learner; None where there is none.
    """
    seated = at_best(archive.seated)
    if exploiter is not None:
        theirs = jnp.arange(config.seats) >= config.version_seats
        networks = jax.tree.map(lambda all_, one: all_.at[config.version_seats :].set(one), archive.seated, exploiter)
        seated = jax.vmap(exploring)(networks, jnp.where(theirs, amount, 0.0))
    return Seated(
        at_large=exploring(learner, amount),
        seated=seated,
        seats=config.seats,
        first=first_game(config, role, games),
        games=seat_games(config, games),
    )


def _by_quality(archive: Archive) -> Float[Array, " versions"]:
    return jax.nn.softmax(jnp.where(_filled(archive), archive.quality, -jnp.inf))


def _filled(archive: Archive) -> Bool[Array, " versions"]:
    return jnp.arange(archive.games.shape[0]) < archive.count
