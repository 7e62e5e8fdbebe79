"""Players by name: all kinds of players, and the shield that each can have."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import cast

import jax
import jax.numpy as jnp

from apollonius.agents.built_in import BuiltIn
from apollonius.agents.classical import Still, Uniform
from apollonius.agents.extension import Extension
from apollonius.agents.names import (
    FLANKING,
    IDENTIFYING,
    PREFIXES,
    SEARCHING,
    SHIELDED,
    prefixes_of,
)
from apollonius.agents.network import QNetwork, one_action_network
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy
from apollonius.agents.pool import Pool, single_player, stack
from apollonius.agents.source import NamedPlayer, PlayerSource, unknown_player
from apollonius.agents.trained import EpsilonGreedy, Greedy, SquashedGaussian, SquashedMean, Trained
from apollonius.agents.wrappers.clearance_penalty import ClearancePenalty
from apollonius.agents.wrappers.departure import Departing
from apollonius.agents.wrappers.flanking import Flanking
from apollonius.agents.wrappers.identification import Identifying
from apollonius.agents.wrappers.searching import Searching
from apollonius.agents.wrappers.shield import with_shield
from apollonius.game.game import Game
from apollonius.game.models import require_unicycle
from apollonius.game.types import Role
from apollonius.game.uncertainty import Uncertainty
from apollonius.io.errors import require
from apollonius.solve.solving import SolvedGame

SOURCES: tuple[PlayerSource, ...] = (BuiltIn(), SolvedGame(), Trained(), Extension())
"""All kinds of players; a name is of the first that knows it. A new kind is a file of its own and
its name here.
"""
WRAPPERS_OF_VIEWS = {SEARCHING: Searching, FLANKING: Flanking}
"""The pursuers that play as another one in a changed view, by prefix."""
TABLE = "table"
"""Instead of a player's name, where both sides are solved anyway: the player by the game solved for
that side.
"""


def find_player(name: str | AbstractPolicy, role: Role, game: Game) -> NamedPlayer:
    """Return the player of a name: built in, in the zoo, of a training run, or a file; greedy if it
    was trained. A policy is returned under the name of its class.

    Args:
        name: `identifying:` before it makes the player learn its robot's drive and limits
            (`apollonius.agents.wrappers.identification`), then `shielded:` puts the player behind a
            shield (`apollonius.agents.wrappers.shield`), then `searching:` makes a pursuer search
            (`apollonius.agents.wrappers.searching`), then `flanking:` makes one of a team flank
            (`apollonius.agents.wrappers.flanking`). `RUN/NAME` is an agent of a training run, by
            the run's folder or its name among `runs`; `zoo/NAME` is one of the zoo, `PACKAGE:NAME`
            one of another package (`apollonius.agents.extension`).

    Raises:
        InvalidInput: when nobody has it, its file is bad or of another game, it plays the other
            side only, or a shield cannot help.
    """
    if isinstance(name, AbstractPolicy):
        return NamedPlayer(type(name).__name__, name)
    require(
        isinstance(cast(object, name), str),
        "player",
        name,
        "a name, the path of a file, or an AbstractPolicy",
    )
    prefixes = prefixes_of(name)
    is_in_order = prefixes == [prefix for prefix in PREFIXES if prefix in prefixes]
    listed = ", ".join(f"'{prefix}'" for prefix in PREFIXES)
    require(is_in_order, "player", name, f"one with {listed} in this order, each once")
    if name.startswith(IDENTIFYING):
        return _identifying(name.removeprefix(IDENTIFYING), role, game)
    if name.startswith(SHIELDED):
        return _shielded(name.removeprefix(SHIELDED), role, game, is_uncertain=False)
    for prefix, wrapper in WRAPPERS_OF_VIEWS.items():
        if name.startswith(prefix):
            return _with_view_changed(prefix, wrapper, name.removeprefix(prefix), role, game)
    for kind in SOURCES:
        player = kind.find(name, role, game)
        if player:
            return player
    raise unknown_player(name, *SOURCES)


def _with_view_changed(
    prefix: str,
    wrapper: Callable[[AbstractActionValuePolicy], AbstractPolicy],
    name: str,
    role: Role,
    game: Game,
) -> NamedPlayer:
    """Return the pursuer of a name within a wrapper that changes its view.

    Args:
        prefix: the wrapper's.
        wrapper: makes the pursuer from the one inside.
        name: the name of the one inside.
        role: its side.
        game: the rules.
    """
    bare = find_player(name, role, game)
    is_pursuer = role is Role.PURSUER
    require(is_pursuer, prefix, bare.name, "left out for an evader: only pursuers do that")
    has_mates = prefix != FLANKING or len(game.bodies.pursuer) > 1
    require(has_mates, prefix, bare.name, "left out for a single pursuer, as it flanks with a mate")
    bound = (
        "followed by a player that values the nine actions and finds its way by the chart, "
        "as pursuer does"
    )
    finds_way = bare.policy.needs_chart and isinstance(bare.policy, AbstractActionValuePolicy)
    require(finds_way, prefix, bare.name, bound)
    assert isinstance(bare.policy, AbstractActionValuePolicy)
    return replace(bare, name=prefix + bare.name, policy=wrapper(bare.policy))


def _shielded(name: str, role: Role, game: Game, is_uncertain: bool) -> NamedPlayer:
    """Return the player of a name behind a shield.

    Args:
        name: its name.
        role: its side.
        game: the rules.
        is_uncertain: whether its robot is uncertain of itself.
    """
    bare = find_player(name, role, game)
    policy = with_shield(bare.policy, game, role, is_uncertain)
    return replace(bare, name=SHIELDED + bare.name, policy=policy)


def _identifying(name: str, role: Role, game: Game) -> NamedPlayer:
    """Return the player of a name that learns its robot's drive; raises InvalidInput where the
    robots of its side differ.
    """
    nominal, *mates = game.bodies[role]
    require_unicycle(nominal, role.name.lower(), IDENTIFYING)
    bound = "0 m/s: this player does not drive backwards"
    require(nominal.v_min == 0, f"{role.name.lower()}.v_min", nominal.v_min, bound)
    bound = "alike on its side, as it knows one robot's limits"
    require(all(mate == nominal for mate in mates), IDENTIFYING, "robots that differ", bound)
    if name.startswith(SHIELDED):
        player = _shielded(name.removeprefix(SHIELDED), role, game, is_uncertain=True)
    else:
        player = find_player(name, role, game)
    noise = game.uncertainty_of(role) or Uncertainty()
    policy = Identifying(player.policy, nominal, noise)
    return replace(player, name=IDENTIFYING + player.name, policy=policy)


def loss_value(player: NamedPlayer, game: Game) -> float:
    """Return about what a lost game costs in the units of a player's action values.

    It is 1 for a player without a file, the value in an agent's header, and the reward of a failure
    where that has none. Raises InvalidInput where that is 0.
    """
    if player.header is None:
        return 1.0
    if player.header.loss_value is not None:
        return player.header.loss_value
    failure = float(game.reward.failure)
    bound = f"above 0, as it is the value of a lost game to '{player.name}'"
    require(failure > 0, "failure", failure, bound)
    return failure


def player_names(role: Role, game: Game) -> list[str]:
    """Return the names of all the players of one side that need no file and that the game is one
    for.
    """
    return [name for kind in SOURCES for name in kind.names() if kind.fits(name, role, game)]


def find_pool(names: Sequence[str], role: Role, game: Game) -> Pool:
    """Return the pool of the players of these names; each game meets one.

    Several must be trained agents with networks of one shape, all symmetric or none, or `random` or
    `still` beside discrete ones.

    Raises:
        InvalidInput: as `find_player`, for no name, and for players that do not go together.
    """
    side, listed = f"{role.name.lower()}s", ", ".join(names)
    require(names, side, "none", "one player at least")
    policies = [find_player(name, role, game).policy for name in names]
    if len(policies) == 1:
        return single_player(policies[0])
    policies = [policy.policy if isinstance(policy, Departing) else policy for policy in policies]
    bare = [
        policy.policy if isinstance(policy, ClearancePenalty) else policy for policy in policies
    ]
    networks = [policy.network for policy in bare if isinstance(policy, Greedy | SquashedMean)]
    bound = (
        "one player, or trained agents with networks of one shape, and random and still beside "
        "discrete ones"
    )
    together = all(isinstance(policy, Greedy | SquashedMean | Uniform | Still) for policy in bare)
    shapes = {
        (jax.tree.structure(network), *(leaf.shape for leaf in jax.tree.leaves(network)))
        for network in networks
    }
    require(together and len(shapes) == 1, side, listed, bound)
    continuous = [policy.network for policy in bare if isinstance(policy, SquashedMean)]
    if continuous:
        require(len(continuous) == len(policies), side, listed, bound)
        no_noise = jnp.asarray(0.0)
        return stack([SquashedGaussian(network, no_noise) for network in continuous])
    network = next(policy.network for policy in bare if isinstance(policy, Greedy))
    return stack(_of_one_structure(policies, network))


def _of_one_structure(
    policies: Sequence[AbstractPolicy], network: QNetwork
) -> list[AbstractPolicy]:
    """Return players as such with networks of this shape: who explores always is random, and who
    values one action still. Each has a clearance penalty if any has, of 0 where it had none.
    """
    some_penalty = any(isinstance(policy, ClearancePenalty) for policy in policies)

    def valuing(policy: AbstractPolicy) -> AbstractActionValuePolicy:
        if isinstance(policy, Greedy | ClearancePenalty):
            return policy
        if isinstance(policy, Still):
            return Greedy(one_action_network(network, policy.action))
        return Greedy(network)

    def penalised(policy: AbstractActionValuePolicy) -> AbstractActionValuePolicy:
        if not some_penalty or isinstance(policy, ClearancePenalty):
            return policy
        return ClearancePenalty(policy, margin=0.0, loss_value=0.0)

    return [
        EpsilonGreedy(
            penalised(valuing(policy)), jnp.asarray(1.0 if isinstance(policy, Uniform) else 0.0)
        )
        for policy in policies
    ]
