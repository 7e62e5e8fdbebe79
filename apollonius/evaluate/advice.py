"""Advice for one arena: the players of the benchmark's panels that do best in it, and where the pursuer stops short."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_games, record_game
from apollonius.evaluate.names import PANELS
from apollonius.evaluate.tournament import Tournament, play_tournament
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import ROLES, Outcome
from apollonius.play.playout import Report

STANDING = "still"
"""The evader that should always be caught."""
_SHOWN = 8
"""Greatest number of games whose ends are shown."""


@dataclass(frozen=True)
class Advice:
    """The players that did best against the opponent that was worst for them.

    Attributes:
        tournament: every pursuer of the panel against every evader.
        best: that pursuer and that evader.
        least: in how many of its games this pursuer won, and this evader was not beaten, against that opponent.
        stops: where [m] that pursuer was when the time to catch a standing evader ran out, in some such games.
    """

    tournament: Tournament
    best: BySide[str]
    least: BySide[float]
    stops: list[tuple[float, float]]

    def to_dict(self) -> dict[str, Any]:
        """Return the advice as JSON-like data."""
        sides = {role.name.lower(): {"name": self.best[role], "least": self.least[role]} for role in ROLES}
        return sides | {"stops": self.stops, "matches": self.tournament.to_dict()["matches"]}


def advise(game: Game, games: int, seed: int = 0, report: Report = lambda done, total: None) -> Advice:
    """Play every pursuer against every evader of the panel that fits a game.

    Args:
        games: in each match.

    Raises:
        InvalidInput: as `play_match`.
    """
    panel = PANELS["team" if game.teams else "lidar" if game.sensors else "full"]
    players = ROLES.map(lambda role: [find_player(name, role, game) for name in panel[role.name.lower()]])
    tournament = play_tournament(game, players, games, seed, report=report)
    rates = tournament.win_rates
    least = BySide(rates.min(axis=1), 1 - rates.max(axis=0))
    first = least.map(lambda each: int(np.argmax(each)))
    best = players.pursuer[first.pursuer]
    standing = Match(game, BySide(best, find_player(STANDING, ROLES.evader, game)), games, seed)
    return Advice(
        tournament,
        BySide(best.name, players.evader[first.evader].name),
        BySide(*(float(each[place]) for each, place in zip(least, first, strict=True))),
        _stops(standing, _SHOWN),
    )


def _stops(match: Match, games: int) -> list[tuple[float, float]]:
    results = play_games(match)
    open_ended = np.flatnonzero(np.asarray(results.outcome) == Outcome.NO_RESULT)[:games]
    ends = [np.asarray(record_game(match, index).states)[-1] for index in open_ended.tolist()]
    return [(round(float(end[0]), 1), round(float(end[1]), 1)) for end in ends]
