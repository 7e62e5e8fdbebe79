"""Everyone against everyone: a job for each pursuer, every match kept and none played twice."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from apollonius.agents.kind import Named
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match
from apollonius.evaluate.match_cache import cached_match, match_file
from apollonius.evaluate.tournament import Tournament
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import ROLES, Role
from apollonius.jobs import Job, ShouldStop


@dataclass(frozen=True)
class RoundRobin:
    """Who meets whom. Plain data, so that any process can play a part of it.

    Attributes:
        folder: where the matches are kept.
        entrants: of either side by name, the agents or their files.
        games: in each match, all on the same starts.
        seed: of the starts.
        game: by whose rules.
        play: plays a match and keeps it, or reads what was kept; called as `cached_match` is.
        apart: names on both sides whose players, among themselves, meet only the one of their own name.
    """

    folder: Path
    entrants: BySide[dict[str, str]]
    games: int
    seed: int
    game: Game = field(default_factory=lambda: make_game("paper"))
    play: Callable[[Path, Match], Any] = cached_match
    apart: tuple[str, ...] = ()

    def jobs(self) -> list[Job]:
        """What is to be played yet."""
        return [
            Job(f"the matches of {name}", play_row, (self, name))
            for name in self.entrants.pursuer
            if not all(match_file(self.folder, name, evader).exists() for evader in self.row(name))
        ]

    def row(self, pursuer: str) -> list[str]:
        """Whom a pursuer meets."""
        return [name for name in self.entrants.evader if name == pursuer or not {name, pursuer} <= set(self.apart)]

    @cached_property
    def players(self) -> BySide[dict[str, Named]]:
        """Who plays, by name."""

        def of_side(role: Role) -> dict[str, Named]:
            found = {name: find_player(agent, role, self.game) for name, agent in self.entrants[role].items()}
            return {name: replace(player, name=name) for name, player in found.items()}

        return ROLES.map(of_side)

    def result(self, pursuer: str, evader: str) -> Any:
        """What a match comes to, read where it is kept or else played."""
        both = self.players.pursuer[pursuer], self.players.evader[evader]
        return self.play(self.folder, Match(self.game, BySide(*both), self.games, self.seed))

    def results(self) -> dict[tuple[str, str], Any]:
        """All matches, by pursuer and evader."""
        pairs = [(pursuer, evader) for pursuer in self.entrants.pursuer for evader in self.row(pursuer)]
        return {pair: self.result(*pair) for pair in pairs}

    def tournament(self) -> Tournament:
        """All matches of `cached_match`, where everyone meets everyone."""
        pursuers, evaders = (tuple(names) for names in self.entrants)
        rows = tuple(tuple(self.result(name, evader) for evader in evaders) for name in pursuers)
        return Tournament(pursuers, evaders, rows)


def play_row(everyone: RoundRobin, pursuer: str, should_stop: ShouldStop) -> bool:
    """Play and keep the matches of one pursuer. Returns False if it was stopped."""
    for evader in everyone.row(pursuer):
        if should_stop():
            return False
        everyone.result(pursuer, evader)
    return True
