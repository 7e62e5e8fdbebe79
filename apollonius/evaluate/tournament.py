"""A tournament: every pursuer against every evader, on the same starts, and the Elo ratings that follow."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import log
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used
from jaxtyping import Float

from apollonius.agents.kind import Named
from apollonius.evaluate.match import Match, MatchResult, StartFilter, play_match, play_matches
from apollonius.evaluate.result import read_result
from apollonius.evaluate.statistics import Z
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.io.document import parse_json, to_json, write_atomically
from apollonius.io.errors import require
from apollonius.io.workers import Job, run_jobs
from apollonius.play.playout import Report

SCALE = 400 / log(10)
"""Elo points in a unit of log-odds: 400 points ahead wins ten games of eleven."""
MEAN = 1500.0
"""Mean rating of all players of a tournament; only differences mean anything."""
_PRIOR = 0.5
"""Wins and losses that are added to every match, or a player who wins every game would have no rating (Haldane and
Anscombe's correction of log-odds)."""
_NEWTON_STEPS = 30


@dataclass(frozen=True)
class Ratings:
    """Elo ratings of the players of one side, each with half the width of its 95 % interval (`reach`)."""

    points: Float[np.ndarray, " players"]
    reach: Float[np.ndarray, " players"]


def rate(wins: Float[np.ndarray, "pursuers evaders"], games: int) -> BySide[Ratings]:
    """Return the most likely ratings where pursuer i beats evader j with the odds exp((r_i - s_j) / SCALE).

    The model of Bradley and Terry, "Rank analysis of incomplete block designs" (1952), of two sides that never meet
    their own; the evader wins what the pursuer does not. Intervals are Wald's, from the curvature of the likelihood: of
    the games' chance alone, as if players did not beat each other in circles.
    """
    pursuers, evaders = wins.shape
    trials = games + 2 * _PRIOR
    design = np.concatenate(
        [np.repeat(np.eye(pursuers), evaders, axis=0), -np.tile(np.eye(evaders), (pursuers, 1))], axis=1
    )
    won, strength, covariance = wins.ravel() + _PRIOR, np.zeros(pursuers + evaders), np.zeros(0)
    for _ in range(_NEWTON_STEPS):  # on the log-likelihood, which is concave
        expected = scipy.special.expit(design @ strength)
        curvature = trials * design.T @ (design * (expected * (1 - expected))[:, None])
        # The pseudo-inverse leaves out the one direction that means nothing, all players stronger together.
        covariance = scipy.linalg.pinvh(curvature)
        strength = strength + covariance @ design.T @ (won - trials * expected)
    rating, reach = MEAN + SCALE * (strength - strength.mean()), Z * SCALE * np.sqrt(np.diag(covariance))
    return BySide(Ratings(rating[:pursuers], reach[:pursuers]), Ratings(rating[pursuers:], reach[pursuers:]))


@dataclass(frozen=True)
class Tournament:
    """The names of the players of both sides and, in a row for each pursuer, its match with each evader."""

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
        return rate(wins, self.matches[0][0].games)

    def to_dict(self) -> dict[str, Any]:
        """Return the tournament as JSON-like data; `ratings` are Elo points with 95 % intervals."""

        def rated(names: tuple[str, ...], ratings: Ratings) -> dict[str, dict[str, float]]:
            columns = zip(names, ratings.points.tolist(), ratings.reach.tolist(), strict=True)
            return {name: {"elo": elo, "low": elo - half, "high": elo + half} for name, elo, half in columns}

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
    pursuers: Sequence[Named],
    evaders: Sequence[Named],
    games: int,
    seed: int,
    on_match: Callable[[Match, MatchResult], None] = lambda match, result: None,
    starts: StartFilter = StartFilter.ALL,
    report: Report = lambda done, total: None,
) -> Tournament:
    """Play a match of every pursuer with every evader, as `play_matches`. All matches have the same starts.

    Raises:
        InvalidInput: unless there is a player on either side, no name twice; and as `play_match`.
    """
    names = _each_once(*([player.name for player in players] for players in (pursuers, evaders)))
    matches = [Match(game, BySide(*pair), games, seed, starts) for pair in itertools.product(pursuers, evaders)]
    return _in_rows(names, play_matches(matches, on_match, report))


def play_tournament_on(
    workers: str,
    names: BySide[Sequence[str]],
    settings: tuple[str, int, int, str | None],
    report: Callable[[str], None],
) -> Tournament:
    """Play a tournament of players by name as `play_tournament` does, each match as a job.

    Args:
        workers: one of `apollonius.io.workers.WORKERS`.
        settings: the game's name, the number of games in a match, their seed, and which starts, as of `starting`.
        report: called with a line whenever a match ends.

    Raises:
        InvalidInput: as `play_tournament` and `run_jobs`.
        KeyboardInterrupt: when the jobs were stopped; what has been played is lost.
    """
    names, (game, *rest) = _each_once(*names), settings
    with TemporaryDirectory(prefix=".apollonius-", dir=Path.cwd()) as folder:  # where workers elsewhere find it, too
        files = {pair: Path(folder) / f"{i}.json" for i, pair in enumerate(itertools.product(*names))}
        jobs = [Job(" against ".join(pair), play_to_file, (file, game, *pair, *rest)) for pair, file in files.items()]
        run_jobs(jobs, report, workers, Path(folder))
        results = [read_result(parse_json(file.read_bytes(), str(file)), str(file)) for file in files.values()]
    return _in_rows(names, results)


def play_to_file(file: Path, *rest: Any) -> bool:
    """Play a match as a job that writes its result; arguments as those of `Match.of_names`."""
    *of, _ = rest  # a match is too short to be stopped
    write_atomically(file, to_json(play_match(Match.of_names(*of)).to_dict()).encode())
    return True


def _each_once(pursuers: Sequence[str], evaders: Sequence[str]) -> BySide[Sequence[str]]:
    for side, names in (("pursuers", pursuers), ("evaders", evaders)):
        require(names and len(set(names)) == len(names), side, ", ".join(names) or "none", "one at least, each once")
    return BySide(pursuers, evaders)


def _in_rows(names: BySide[Sequence[str]], results: Sequence[MatchResult]) -> Tournament:
    count = len(names.evader)
    rows = tuple(tuple(results[first : first + count]) for first in range(0, len(results), count))
    return Tournament(tuple(names.pursuer), tuple(names.evader), rows)
