"""The players that need no file: those without a rule, and the classical ones."""

from collections.abc import Sequence

from apollonius.agents.classical import AbstractClassical, AbstractOpenLoop, Still, Uniform
from apollonius.agents.guidance import Flee, FleeAware, Intercept, PurePursuit, Territory
from apollonius.agents.names import BUILT_IN
from apollonius.agents.path_following import Hide, Search
from apollonius.agents.source import NamedPlayer, PlayerSource
from apollonius.agents.surrounding import Encirclement, VoronoiPursuit
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.errors import require

_POLICIES: dict[str, type[AbstractOpenLoop] | type[AbstractClassical]] = {
    "random": Uniform,
    "still": Still,
    "pure-pursuit": PurePursuit,
    "intercept": Intercept,
    "voronoi-pursuit": VoronoiPursuit,
    "encirclement": Encirclement,
    "flee": Flee,
    "flee-aware": FleeAware,
    "search": Search,
    "hide": Hide,
    "territory": Territory,
}
PLAYERS = {
    name: (_POLICIES[name], tuple(Role[side.upper()] for side in sides))
    for name, (sides, _) in BUILT_IN.items()
}
"""By name, and the sides that they can play. Classical ones have to know the game."""

BY_CHART = "search", "hide"
"""Players that find their way by the arena's chart in games of two, too."""


class BuiltIn(PlayerSource):
    """The players of `PLAYERS`."""

    def names(self) -> Sequence[str]:
        return list(PLAYERS)

    def fits(self, name: str, role: Role, game: Game) -> bool:
        policy, sides = PLAYERS[name]
        return role in sides and (not issubclass(policy, AbstractClassical) or policy.fits(game))

    def find(self, name: str, role: Role, game: Game) -> NamedPlayer | None:
        if name not in PLAYERS:
            return None
        policy, sides = PLAYERS[name]
        side, only = role.name.lower(), sides[0].name.lower()
        require(
            role in sides, side, f"'{name}'", f"another player, as this one plays the {only} only"
        )
        return NamedPlayer(name, policy.for_side(game, role))
