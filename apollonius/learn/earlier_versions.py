"""Earlier versions of a side, of which the other side meets one in a share of its games.

A game draws its opponent when it begins and keeps it to its end. Every so often another version is
drawn by the scheme: new games meet that one, and games under way end with the one before.
"""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import Pool, stack
from apollonius.game.outcome import pursuer_wins
from apollonius.game.types import Flag, Real, Role
from apollonius.play.rollout import Transition

SCHEMES: dict[str, Callable[[Array], Array] | None] = {
    "latest": None,
    "uniform": jnp.ones_like,
    "prioritised-hard": lambda lost: (1 - lost) ** 2,
}
"""Weights of the earlier versions of the other side, from the share of its recent games that each
lost to the learner.

`latest`: only each other, Algorithm 2 of the paper. `uniform`: fictitious self-play (Heinrich,
Lanctot, Silver, 2015). `prioritised-hard`: the more likely, the harder to beat, AlphaStar's f_hard
(Vinyals et al., 2019).
"""
FORGETTING = 0.5
"""Weight that games keep at a draw: versions are judged by their games against recent learners."""


class EarlierVersions(eqx.Module):
    """Earlier versions of one side, of which the first `count` are filled.

    Attributes:
        networks: their weights, leaves `[versions, ...]`.
        count: number of versions.
        games: recent games of each against the learner of the other side.
        lost: those that it lost.
        drawn: the two versions that play, the latest draw at `turn % 2`.
        turn: number of draws so far.
    """

    networks: Network
    count: Int[Array, ""]
    games: Float[Array, " versions"]
    lost: Float[Array, " versions"]
    drawn: Int[Array, "2"]
    turn: Int[Array, ""]


def init_versions(network: Network, versions: int) -> EarlierVersions:
    """Return a record of one version, with room for more."""
    return EarlierVersions(
        networks=jax.tree.map(lambda leaf: jnp.repeat(leaf[None], versions, axis=0), network),
        count=jnp.ones((), jnp.int32),
        games=jnp.zeros(versions, jnp.float32),
        lost=jnp.zeros(versions, jnp.float32),
        drawn=jnp.zeros(2, jnp.int32),
        turn=jnp.zeros((), jnp.int32),
    )


def add_version(earlier: EarlierVersions, network: Network, is_due: Flag) -> EarlierVersions:
    """Add a version, where that is due and there is room."""
    room = earlier.games.shape[0]
    index = jnp.where(is_due, earlier.count, room)  # writing beyond the last one does nothing

    def with_new(all_versions: Array, new: Array) -> Array:
        return all_versions.at[index].set(new, mode="drop")

    return replace(
        earlier,
        networks=jax.tree.map(with_new, earlier.networks, network),
        count=jnp.minimum(earlier.count + is_due.astype(jnp.int32), room),
    )


def draw_version(earlier: EarlierVersions, scheme: str, key: PRNGKeyArray) -> EarlierVersions:
    """Draw the version that new games meet, and discount the records of all. The key is consumed.

    It takes the place of the version before the last, whose games must be over.
    """
    weigh = SCHEMES[scheme]
    assert weigh is not None, "the scheme has earlier versions"
    versions = earlier.games.shape[0]
    share_lost = (earlier.lost + 1) / (earlier.games + 2)
    weights = jnp.where(jnp.arange(versions) < earlier.count, weigh(share_lost), 0.0)
    version = jax.random.choice(key, versions, p=weights / jnp.sum(weights)).astype(jnp.int32)
    turn = earlier.turn + 1
    return replace(
        earlier,
        games=FORGETTING * earlier.games,
        lost=FORGETTING * earlier.lost,
        drawn=earlier.drawn.at[turn % 2].set(version),
        turn=turn,
    )


def learner_and_earlier(
    learner: AbstractPolicy,
    player: Callable[[Network], AbstractPolicy],
    earlier: EarlierVersions,
    share: Real,
) -> Pool:
    """Return the players of a side: member 0 is the learner, 1 and 2 the versions that were drawn.

    Args:
        learner: the player that learns.
        player: makes the player of an earlier version.
        earlier: the versions.
        share: share of new games that meet the version drawn last.
    """
    drawn = [
        player(jax.tree.map(lambda leaf, version=version: leaf[version], earlier.networks))
        for version in earlier.drawn
    ]
    latest = jnp.arange(2) == earlier.turn % 2
    weights = jnp.concatenate([jnp.array([1 - share]), jnp.where(latest, share, 0.0)])
    return replace(stack([learner, *drawn]), weights=weights)


def record_results(earlier: EarlierVersions, role: Role, played: Transition) -> EarlierVersions:
    """Count the games of a side's earlier versions that end against the learner of the other side.

    Every game that begins is counted when it ends, so short games weigh no more than long ones. A
    game without a winner is lost by the pursuer.
    """
    member = played.sides[role].member
    meets_learner = played.sides[role.other].member == 0
    is_over = played.ended & (member > 0) & meets_learner
    has_lost = pursuer_wins(played.outcome) ^ (role == Role.PURSUER)
    version = earlier.drawn[jnp.maximum(member - 1, 0)]

    def counts(games: Array) -> Array:
        return games.astype(jnp.float32)

    return replace(
        earlier,
        games=earlier.games.at[version].add(counts(is_over)),
        lost=earlier.lost.at[version].add(counts(is_over & has_lost)),
    )
