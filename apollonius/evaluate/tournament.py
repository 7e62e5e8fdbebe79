"""A tournament: every pursuer against every evader, on the same starts, and what comes of it as a whole."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from apollonius.agents.kind import Named
from apollonius.arenas.record import from_dict, to_dict
from apollonius.evaluate.match import Match, MatchResult, play_match
from apollonius.evaluate.ratings import Equilibrium, Ratings, equilibrium, rate
from apollonius.evaluate.start_filter import StartFilter
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.io.cache import cached, content, digest, entry
from apollonius.io.document import parse_json, read_bytes, to_json, write_atomically
from apollonius.io.errors import require
from apollonius.play.playout import Report


def cached_match(folder: Path, match: Match, report: Report = lambda done, total: None) -> MatchResult:
    """Return what a match comes to, as `play_match`: from its file in a folder, or played and kept there.

    Raises:
        InvalidInput: as `play_match`.
        OSError: when the file cannot be written.
    """
    players = match.players
    key = {
        "pursuer": content(players.pursuer.policy),  # two players may share a name
        "evader": content(players.evader.policy),
        "game": to_dict(match.game),
        "games": match.games,
        "seed": match.seed,
        "viable": match.starts is StartFilter.VIABLE,
    }
    name = f"{players.pursuer.name}--{players.evader.name}.json"

    def save(made: MatchResult, path: Path) -> None:
        data = to_dict(made)
        write_atomically(path, to_json({"key": key, "result": data, "sha256": digest(data)}, indent=1).encode())

    def load(path: Path) -> MatchResult:
        fields = parse_json(read_bytes(path, "a result that was kept", "remove it"), f"'{path}' is no such result")
        data, stated = fields.get("result"), fields.get("sha256")
        require(isinstance(data, dict) and stated == digest(data), "sha256", stated, "that of the result")
        return from_dict(MatchResult, fields["result"], str(path))

    return cached(entry(folder, name, key), lambda: play_match(match, report=report), save, load)


Points = Float[np.ndarray, " players"]


@dataclass(frozen=True)
class Tournament:
    """Who met whom, and how it ended.

    Attributes:
        pursuers, evaders: what the players are called.
        matches: a row for each pursuer, in it a match with each evader.
    """

    pursuers: tuple[str, ...]
    evaders: tuple[str, ...]
    matches: tuple[tuple[MatchResult, ...], ...]

    @property
    def win_rates(self) -> Float[np.ndarray, "pursuers evaders"]:
        """The pursuer's share of wins in each match."""
        return np.array([[match.pursuer_win_rate for match in row] for row in self.matches])

    @property
    def games(self) -> int:
        """Games in each match."""
        return self.matches[0][0].games

    @property
    def wins(self) -> Float[np.ndarray, "pursuers evaders"]:
        """Games that the pursuer won in each match."""
        return np.round(self.win_rates * self.games)

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """The broadest mixtures from which neither side gains by leaving: Nash averaging."""
        return equilibrium(self.win_rates)

    @cached_property
    def ratings(self) -> Ratings:
        """Elo ratings of all players."""
        return rate(self.wins, self.games)

    @property
    def widest_interval(self) -> float:
        """Half the width of the widest of the matches' 95 % intervals of the pursuer's win rate."""
        ends = [match.pursuer_win_interval for row in self.matches for match in row]
        return max(high - low for low, high in ends) / 2

    def to_dict(self) -> dict[str, Any]:
        """The tournament as JSON-like data.

        `equilibrium` is Nash averaging: the shares of the broadest equilibrium, and how much more than its value each
        player gets against the other side's mixture, 0 for those who have a share and negative for the rest. `ratings`
        are Elo points with 95 % intervals.
        """
        mixed, ratings = self.equilibrium, self.ratings

        def rated(names: tuple[str, ...], points: Points, reach: Points) -> dict[str, dict[str, float]]:
            columns = zip(names, points.tolist(), reach.tolist(), strict=True)
            return {name: {"elo": elo, "low": elo - half, "high": elo + half} for name, elo, half in columns}

        return {
            "pursuers": self.pursuers,
            "evaders": self.evaders,
            "matches": [
                {"pursuer": pursuer, "evader": evader} | match.to_dict()
                for pursuer, row in zip(self.pursuers, self.matches, strict=True)
                for evader, match in zip(self.evaders, row, strict=True)
            ],
            "equilibrium": {
                "value": mixed.value,
                "pursuers": _named(self.pursuers, mixed.rows),
                "evaders": _named(self.evaders, mixed.columns),
                "pursuer_skill": _named(self.pursuers, self.win_rates @ mixed.columns - mixed.value),
                "evader_skill": _named(self.evaders, mixed.value - mixed.rows @ self.win_rates),
            },
            "ratings": {
                "pursuers": rated(self.pursuers, ratings.pursuers, ratings.pursuer_reach),
                "evaders": rated(self.evaders, ratings.evaders, ratings.evader_reach),
                "misfit": ratings.misfit,
            },
        }


def _named(names: tuple[str, ...], values: Points) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def play_tournament(
    game: Game,
    pursuers: Sequence[Named],
    evaders: Sequence[Named],
    games: int,
    seed: int,
    on_match: Callable[[str, str, MatchResult], None] = lambda pursuer, evader, result: None,
    starts: StartFilter = StartFilter.ALL,
    keep: Path | None = None,
    report: Report = lambda done, total: None,
) -> Tournament:
    """Play a match of every pursuer with every evader. All matches have the same starts.

    Args:
        games: in each match.
        on_match: called after each.
        starts: as of a `Match`.
        keep: folder for the matches; those that lie there already are not played again.
        report: called with the games of all matches together, as by `play_match`.

    Raises:
        InvalidInput: unless there is a player on either side, no name twice; and as `play_match`.
    """
    for side, players in (("pursuers", pursuers), ("evaders", evaders)):
        names = [player.name for player in players]
        require(names and len(set(names)) == len(names), side, ", ".join(names) or "none", "one at least, each once")
    rows, total = [], games * len(pursuers) * len(evaders)
    for pursuer in pursuers:
        row = []
        for evader in evaders:
            before = games * (len(rows) * len(evaders) + len(row))
            report(before, total)

            def of_all(done: int, _: int, before: int = before) -> None:
                report(before + done, total)

            match = Match(game, BySide(pursuer, evader), games, seed, starts)
            row.append(cached_match(keep, match, of_all) if keep else play_match(match, report=of_all))
            on_match(pursuer.name, evader.name, row[-1])
        rows.append(tuple(row))
    return Tournament(tuple(p.name for p in pursuers), tuple(e.name for e in evaders), tuple(rows))
