"""The players of other packages, by their entry points."""

from collections.abc import Sequence
from typing import Any

from apollonius.agents.classical import AbstractClassical
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.source import NamedPlayer, PlayerSource
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.io.extensions import PLAYERS, extension_names, load_extension, unfit_extension

_KIND = "an AbstractPolicy, its class, or a function of game and role that returns one"


class Extension(PlayerSource):
    """The policies of the entry points `apollonius.players`.

    Each is a policy, a class of policies that needs no arguments, or a function of a game and a
    role that returns one and raises InvalidInput for a side that it does not play.
    """

    syntax = "PACKAGE:NAME for a player of an installed package"

    def names(self) -> Sequence[str]:
        return extension_names(PLAYERS)

    def fits(self, name: str, role: Role, game: Game) -> bool:
        part = load_extension(PLAYERS, name, _KIND)
        try:
            _policy_of(part, name, role, game)
        except InvalidInput:
            return False
        return True

    def find(self, name: str, role: Role, game: Game) -> NamedPlayer | None:
        if ":" not in name:
            return None
        part = load_extension(PLAYERS, name, _KIND)
        return None if part is None else NamedPlayer(name, _policy_of(part, name, role, game))


def _policy_of(part: Any, name: str, role: Role, game: Game) -> AbstractPolicy:
    """Make a policy from the object of an entry point; raises InvalidInput for an unfit object."""
    try:
        if isinstance(part, type) and issubclass(part, AbstractClassical):
            policy = part.for_side(game, role)
        elif isinstance(part, type) and issubclass(part, AbstractPolicy):
            policy = part()
        else:
            policy = (
                part if isinstance(part, AbstractPolicy) or not callable(part) else part(game, role)
            )
    except InvalidInput:
        raise
    except Exception as error:
        raise unfit_extension(PLAYERS, name, _KIND, f"{type(error).__name__}: {error}") from error
    if not isinstance(policy, AbstractPolicy):
        raise unfit_extension(PLAYERS, name, _KIND, policy)
    return policy
