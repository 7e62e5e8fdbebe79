"""Matches kept as files, so that what was stopped goes on where it was."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from apollonius.arenas.record import from_dict, to_dict
from apollonius.cache import content, digest, entry, kept
from apollonius.document import parse_json, read_bytes, to_json, write_atomically
from apollonius.errors import require
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.result import MatchResult
from apollonius.evaluate.start_filter import StartFilter
from apollonius.playout import Report

T = TypeVar("T")


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

    def check(result: MatchResult) -> None:
        result.require_possible(name)
        require(result.games == match.games, f"{name}: games", result.games, "those of the match")
        parts = (result.arenas is not None, result.robots is not None)
        fit = parts == (match.game.scenario is not None, bool(match.game.teams))
        require(fit, f"{name}: arenas and robots", parts, "given as the game has them")

    return kept_record(folder, name, key, MatchResult, lambda: play_match(match, report=report), check)


def kept_record(
    folder: Path,
    name: str,
    key: dict[str, Any],
    kind: type[T],
    make: Callable[[], T],
    check: Callable[[T], None] = lambda made: None,
) -> T:
    """Return a dataclass from a JSON file, or make it and write it there, beside its key; as `entry` and `kept`.

    Args:
        check: raises InvalidInput for what the file cannot truly hold, which is then made again.
    """

    def save(made: T, path: Path) -> None:
        data = to_dict(made)
        write_atomically(path, to_json({"key": key, "result": data, "sha256": digest(data)}, indent=1).encode())

    def load(path: Path) -> T:
        fields = parse_json(read_bytes(path, "a result that was kept", "remove it"), f"'{path}' is no such result")
        data, told = fields.get("result"), fields.get("sha256")
        require(isinstance(data, dict) and told == digest(data), "sha256", told, "that of the result")
        made = from_dict(kind, fields["result"], str(path))
        check(made)
        return made

    return kept(entry(folder, name, key), make, save, load)
