"""How often teams of one, two and more pursuers catch an evader: what more of them are worth, with real kinematics."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from apollonius.agents.kind import Named
from apollonius.catalogue import find_player
from apollonius.errors import InvalidInput, require
from apollonius.evaluate.match import Match, MatchResult, play_match
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.presets import in_teams
from apollonius.game.types import Role
from apollonius.game.validation import MOST_ROBOTS
from apollonius.playout import Report


@dataclass(frozen=True)
class Captures:
    """How many games a team of some size won by capture, and of how many.

    Attributes:
        pursuers: how many robots the team has.
        captured, games: games that were won so, and all.
        failures: share of the pursuers that went out of play by failing.
    """

    pursuers: int
    captured: int
    games: int
    failures: float

    @property
    def rate(self) -> float:
        """The share that was won so."""
        return self.captured / self.games

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the rate."""
        return wilson_interval(self.captured, self.games)


@dataclass(frozen=True)
class TeamSizes:
    """How teams of several sizes do against one evader.

    Attributes:
        evader: what it is called.
        games: in each match.
        seconds: within which an evader is to be caught.
        teams: by the name of who plays all pursuers: those of each size that it plays in, ascending.
    """

    evader: str
    games: int
    seconds: float
    teams: dict[str, tuple[Captures, ...]]

    def to_dict(self) -> dict[str, Any]:
        """All of it, as JSON-like data."""

        def of_size(one: Captures) -> dict[str, Any]:
            told = {"pursuers": one.pursuers, "captured": one.captured, "capture_rate": one.rate}
            return {**told, "capture_interval": one.interval, "pursuer_failure_rate": one.failures}

        teams = {name: list(map(of_size, sizes)) for name, sizes in self.teams.items()}
        return {"evader": self.evader, "games": self.games, "seconds": self.seconds, "teams": teams}


Matches = dict[str, dict[int, Match]]
"""By the name of who plays all pursuers, and by how many these are."""


def matches_of_sizes(game: Game, teams: Sequence[str], evader: str, most: int, games: int, seed: int = 0) -> Matches:
    """The matches of every team of 1 to `most` pursuers against one evader; all of a size have the same starts.

    Args:
        game: of two robots; all pursuers have the limits of its pursuer.
        teams: names of players, as `find_player` takes them, each of whom plays all pursuers. One that plays beside a
            mate only begins with two.
        evader: the name of the other side's player.
        most: pursuers.
        games: in each match.
        seed: as of a `Match`.

    Raises:
        InvalidInput: for a game of teams, too many pursuers, a team that plays in none of these sizes, and as
            `find_player` and `Match`.
    """
    require(1 <= most <= MOST_ROBOTS, "pursuers", most, f"from 1 to {MOST_ROBOTS}")
    rules = {pursuers: in_teams(game, pursuers, 1) for pursuers in range(1, most + 1)}
    fleeing = {pursuers: find_player(evader, Role.EVADER, one) for pursuers, one in rules.items()}

    def match(size: int, team: Named) -> Match:
        return Match(rules[size], BySide(team, fleeing[size]), games, seed)

    return {name: {size: match(size, team) for size, team in _team(name, rules).items()} for name in teams}


def play_sizes(evader: str, matches: Matches, report: Report = lambda done, total: None) -> TeamSizes:
    """Play all of them and count.

    Args:
        evader: what it is called.
        matches: one at least, all of as many games, by the same rules but for the number of pursuers.
        report: told of the games of all matches together.

    Raises:
        InvalidInput: as `play_match`.
    """
    one, *others = (match for sizes in matches.values() for match in sizes.values())
    total, played = one.games * (1 + len(others)), itertools.count()

    def count(size: int, match: Match) -> Captures:
        before = one.games * next(played)
        result = play_match(match, report=lambda done, _: report(before + done, total))
        return Captures(size, result.outcomes["captured"], match.games, _failures(result, size))

    teams = {name: tuple(count(size, match) for size, match in sizes.items()) for name, sizes in matches.items()}
    return TeamSizes(evader, one.games, float(one.game.dt) * int(one.game.max_steps), teams)


def _team(name: str, rules: dict[int, Game]) -> dict[int, Named]:
    """The player in teams of each size that it plays in.

    Raises:
        InvalidInput: for one that plays in none of them.
    """
    found, refused = dict[int, Named](), None
    for size, game in rules.items():
        try:
            found[size] = find_player(name, Role.PURSUER, game)
        except InvalidInput as error:
            refused = error
    if refused and not found:
        raise refused
    return found


def _failures(result: MatchResult, pursuers: int) -> float:
    """The share of the pursuers that put themselves out."""
    if result.robots is not None:
        return result.robots.lost.pursuer / (result.games * pursuers)
    alone = ("pursuer_hit_obstacle", "pursuer_out_of_range", "both_failed")
    return sum(result.outcomes[name] for name in alone) / result.games
