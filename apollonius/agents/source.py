"""Players with their names, and the interface of the sources in which they are found by name."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from apollonius.agents.names import BUILT_IN, LISTED
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.store import AgentHeader
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput, closest_names, unknown_name


@dataclass(frozen=True)
class NamedPlayer:
    """A player with its name and, if it is from a file, the header of that."""

    name: str
    policy: AbstractPolicy
    header: AgentHeader | None = None


class PlayerSource(ABC):
    """Players of one kind, by name. It is registered in `apollonius.catalogue.SOURCES`."""

    syntax: str = ""
    """Syntax of names that `names()` does not list, for messages."""

    def names(self) -> Sequence[str]:
        """Return the names of those that need no file of a person's own."""
        return ()

    def fits(self, name: str, role: Role, game: Game) -> bool:
        """Check whether one of `names` plays a side of a game."""
        return True

    @abstractmethod
    def find(self, name: str, role: Role, game: Game) -> NamedPlayer | None:
        """Return the player of this name, None where this kind does not know it; raises
        InvalidInput for the others.
        """


def unknown_player(name: str, *kinds: PlayerSource) -> InvalidInput:
    """Return the refusal of a name that these kinds do not know."""
    syntax = ", or ".join(kind.syntax for kind in kinds if kind.syntax)
    listed = [name for kind in kinds for name in kind.names()]
    meant = (
        None
        if name in BUILT_IN or any(mark in name for mark in "/:")
        else closest_names(name, listed)
    )
    return InvalidInput(unknown_name("agent", name, f"{LISTED}; or give {syntax}", meant))
