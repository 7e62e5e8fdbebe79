"""Everyone against everyone: a job for each pursuer, every match kept and none played twice."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from apollonius.agents.kind import Named
from apollonius.catalogue import find_player
from apollonius.evaluate.kept import kept_match, match_file
from apollonius.evaluate.match import Match
from apollonius.evaluate.tournament import Tournament, play_tournament
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.jobs import Job, ShouldStop


@dataclass(frozen=True)
class RoundRobin:
    """Who meets whom in the `paper` game. Plain data, so that any process can play a part of it.

    Attributes:
        folder: where the matches are kept.
        pursuers, evaders: by name, the agents or their files.
        games: in each match, all on the same starts.
        seed: of the starts.
    """

    folder: Path
    pursuers: Mapping[str, str]
    evaders: Mapping[str, str]
    games: int
    seed: int

    def jobs(self) -> list[Job]:
        """What is to be played yet."""
        return [
            Job(f"the matches of {name}", play_row, (self, name))
            for name in self.pursuers
            if not all(match_file(self.folder, name, evader).exists() for evader in self.evaders)
        ]

    def tournament(self) -> Tournament:
        """All matches, read where they are kept."""
        pursuers = [_named(*entrant, Role.PURSUER) for entrant in self.pursuers.items()]
        evaders = [_named(*entrant, Role.EVADER) for entrant in self.evaders.items()]
        return play_tournament(make_game("paper"), pursuers, evaders, self.games, self.seed, keep=self.folder)


def play_row(everyone: RoundRobin, pursuer: str, should_stop: ShouldStop) -> bool:
    """Play and keep the matches of one pursuer against every evader. Returns False if it was stopped."""
    chasing = _named(pursuer, everyone.pursuers[pursuer], Role.PURSUER)
    for entrant in everyone.evaders.items():
        if should_stop():
            return False
        evader = _named(*entrant, Role.EVADER)
        kept_match(everyone.folder, Match(make_game("paper"), chasing, evader, everyone.games, everyone.seed))
    return True


def _named(name: str, agent: str, role: Role) -> Named:
    return Named(name, find_player(agent, role, make_game("paper")).policy)
