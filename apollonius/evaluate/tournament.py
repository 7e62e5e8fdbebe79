"""Tournaments: every pursuer against every evader on the same starts, Elo ratings, and advice for a
game.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import log
from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used
from jaxtyping import Float

from apollonius.agents.names import BUILT_IN, SHIELDED
from apollonius.agents.source import NamedPlayer
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, MatchResult, play_games, play_matches, record_game
from apollonius.evaluate.panels import PANELS
from apollonius.evaluate.statistics import Z
from apollonius.game.game import Game
from apollonius.game.types import ROLES, BySide, Outcome, Role
from apollonius.io.errors import require
from apollonius.io.workers import JobRunner
from apollonius.play.playout import Report, no_report

SCALE = 400 / log(10)
"""Elo points in a unit of log-odds: 400 points ahead wins ten games of eleven."""
MEAN = 1500.0
"""Mean rating of all players of a tournament; only differences mean anything."""
_PRIOR = 0.5
"""Wins and losses that are added to every match, so that a player who wins every game has a rating
(Haldane and Anscombe's correction of log-odds)."""
_NEWTON_STEPS = 30
STANDING = "still"
"""The evader that should always be caught."""
_SHOWN = 8
"""Greatest number of games whose ends are shown."""


@dataclass(frozen=True)
class Ratings:
    """Elo ratings of the players of one side, each with half the width of its 95 % interval
    (`half_widths`).
    """

    points: Float[np.ndarray, " players"]
    half_widths: Float[np.ndarray, " players"]


def fit_ratings(wins: Float[np.ndarray, "pursuers evaders"], games: int) -> BySide[Ratings]:
    """Fit ratings such that pursuer i beats evader j with the odds exp((r_i - s_j) / SCALE).

    The model of Bradley and Terry, "Rank analysis of incomplete block designs" (1952), for two
    sides, where every game that the pursuer does not win is the evader's win. Intervals are Wald's,
    from the curvature of the likelihood: they contain the chance of the games, but not that players
    may beat each other in circles.
    """
    pursuers, evaders = wins.shape
    trials = games + 2 * _PRIOR
    of_pursuers = np.repeat(np.eye(pursuers), evaders, axis=0)
    of_evaders = np.tile(np.eye(evaders), (pursuers, 1))
    design = np.concatenate([of_pursuers, -of_evaders], axis=1)
    wins_with_prior = wins.ravel() + _PRIOR
    strength = np.zeros(pursuers + evaders)
    covariance = np.zeros(0)
    for _ in range(_NEWTON_STEPS):  # on the log-likelihood, which is concave
        win_probability = scipy.special.expit(design @ strength)
        variance = win_probability * (1 - win_probability)
        curvature = trials * design.T @ (design * variance[:, None])
        # The pseudo-inverse leaves out the direction without meaning, all players stronger.
        covariance = scipy.linalg.pinvh(curvature)
        strength = strength + covariance @ design.T @ (wins_with_prior - trials * win_probability)
    rating = MEAN + SCALE * (strength - strength.mean())
    reach = Z * SCALE * np.sqrt(np.diag(covariance))
    return BySide(
        pursuer=Ratings(rating[:pursuers], reach[:pursuers]),
        evader=Ratings(rating[pursuers:], reach[pursuers:]),
    )


@dataclass(frozen=True)
class Tournament:
    """The names of the players of both sides and, in a row for each pursuer, its match with each
    evader.
    """

    pursuers: tuple[str, ...]
    evaders: tuple[str, ...]
    matches: tuple[tuple[MatchResult, ...], ...]

    @property
    def win_rates(self) -> Float[np.ndarray, "pursuers evaders"]:
        """The pursuer's share of wins in each match."""
        return np.array([[match.pursuer_win_rate for match in row] for row in self.matches])

    @cached_property
    def ratings(self) -> BySide[Ratings]:
        """Elo ratings of all players."""
        wins = np.array([[match.pursuer_wins for match in row] for row in self.matches], float)
        return fit_ratings(wins, self.matches[0][0].games)

    def to_dict(self) -> dict[str, Any]:
        """Return the tournament as JSON-like data; `ratings` are Elo points with 95 % intervals."""

        def rated(names: tuple[str, ...], ratings: Ratings) -> dict[str, dict[str, float]]:
            columns = zip(names, ratings.points.tolist(), ratings.half_widths.tolist(), strict=True)
            return {
                name: {"elo": elo, "low": elo - half_width, "high": elo + half_width}
                for name, elo, half_width in columns
            }

        return {
            "pursuers": self.pursuers,
            "evaders": self.evaders,
            "matches": [
                {"pursuer": pursuer, "evader": evader} | match.to_dict()
                for pursuer, row in zip(self.pursuers, self.matches, strict=True)
                for evader, match in zip(self.evaders, row, strict=True)
            ],
            "ratings": {
                "pursuers": rated(self.pursuers, self.ratings.pursuer),
                "evaders": rated(self.evaders, self.ratings.evader),
            },
        }


def play_tournament(
    game: Game,
    players: BySide[Sequence[NamedPlayer]],
    games: int,
    seed: int,
    report: Report = no_report,
    run: JobRunner | None = None,
) -> Tournament:
    """Play a match of every pursuer with every evader on the same starts.

    Args:
        game: The game.
        players: The players of either side, at least one each, with different names.
        games: Number of games of each match.
        seed: Seed of every match.
        report: Called with the games so far and in all.
        run: Runs the matches as jobs.

    Raises:
        InvalidInput: As `play_matches`, and for a side without players or with a name twice.
    """
    names = players.map(lambda side: tuple(player.name for player in side))
    for side, side_names in zip(("pursuers", "evaders"), names, strict=True):
        are_distinct = len({*side_names}) == len(side_names)
        text = ", ".join(side_names) or "none"
        require(side_names and are_distinct, side, text, "one at least, each once")
    matches = [Match(game, BySide(*pair), games, seed) for pair in itertools.product(*players)]
    results = iter(play_matches(matches, report=report, run=run))
    rows = tuple(tuple(next(results) for _ in names.evader) for _ in names.pursuer)
    return Tournament(names.pursuer, names.evader, rows)


@dataclass(frozen=True)
class Advice:
    """The players of the benchmark's panels with the best result against their most difficult
    opponent.

    `best` are their names; `least` are the pursuer's share of wins in that match and the evader's
    share of games without a loss. `stops` are the pursuer's positions [m] when the time to catch a
    standing evader ran out.
    """

    tournament: Tournament
    best: BySide[str]
    least: BySide[float]
    stops: list[tuple[float, float]]

    def to_dict(self) -> dict[str, Any]:
        """Return the advice as JSON-like data."""
        sides = ROLES.map(lambda role: {"name": self.best[role], "least": self.least[role]})
        return {
            "pursuer": sides.pursuer,
            "evader": sides.evader,
            "stops": self.stops,
            "matches": self.tournament.to_dict()["matches"],
        }


def advise(game: Game, games: int, seed: int = 0, report: Report = no_report) -> Advice:
    """Play every pursuer of the panel that fits a game against every evader.

    Rules that move are behind a shield, without which they crash.

    Args:
        game: The game.
        games: Number of games of each match.
        seed: Seed of every match.
        report: Called with the games so far and in all.

    Raises:
        InvalidInput: As `play_tournament`.
    """
    track_of_two = "lidar" if game.sensors else "full"
    panel = PANELS["team" if game.teams else track_of_two]

    def player(name: str, role: Role) -> NamedPlayer:
        moves = name in BUILT_IN and name != STANDING
        return find_player(SHIELDED * moves + name, role, game)

    players = ROLES.map(lambda role: [player(name, role) for name in panel[role.name.lower()]])
    tournament = play_tournament(game, players, games, seed, report=report)
    rates = tournament.win_rates
    least = BySide(rates.min(axis=1), 1 - rates.max(axis=0))
    first = least.map(lambda rates_by_player: int(np.argmax(rates_by_player)))
    best = ROLES.map(lambda role: players[role][first[role]])
    still_evader = find_player(STANDING, ROLES.evader, game)
    still_match = Match(game, BySide(best.pursuer, still_evader), games, seed)
    outcomes = np.asarray(play_games(still_match).outcome)
    escapes = np.flatnonzero(outcomes == Outcome.NO_RESULT)[:_SHOWN]
    ends = [record_game(still_match, index).states[-1] for index in escapes.tolist()]
    return Advice(
        tournament,
        best.map(lambda player: player.name),
        ROLES.map(lambda role: float(least[role][first[role]])),
        [(round(float(x), 1), round(float(y), 1)) for x, y, *_ in ends],
    )
