"""Results kept as files beside all that they depend on, so that what was stopped goes on where it was."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from apollonius.agents.kind import fingerprint
from apollonius.arenas.record import from_dict, to_dict
from apollonius.document import parse_json, read_bytes, write_atomically
from apollonius.errors import InvalidInput
from apollonius.evaluate.match import Match, MatchResult, StartFilter, play_match
from apollonius.playout import Report

T = TypeVar("T")


def cached_result(path: Path, asked: Mapping[str, Any], kind: type[T], make: Callable[[], T]) -> T:
    """A result that lies in a file, or else is made and kept there.

    Args:
        path: of the file.
        asked: all that the result depends on, as JSON-like data; players by their fingerprints: two may share a name.
        kind: class of the result.
        make: makes it.

    Raises:
        InvalidInput: when the file is bad, or of something else than what is asked for.
    """
    if path.exists():
        remedy = "remove it, and it is made again"
        bad = f"'{path}' is no result that was kept ({remedy})"
        kept = parse_json(read_bytes(path, "a result that was kept", remedy), bad)
        if set(kept) != {*asked, "result"}:
            raise InvalidInput(f"{bad}.")
        if {name: kept[name] for name in asked} != json.loads(json.dumps(asked)):
            raise InvalidInput(f"'{path}' is of other players, rules, games or starts: choose another folder.")
        return from_dict(kind, kept["result"], bad)
    result = make()
    write_atomically(path, json.dumps({**asked, "result": to_dict(result)}, indent=1).encode())
    return result


def match_file(folder: Path, pursuer: str, evader: str) -> Path:
    """Where the match of two players is kept."""
    return folder / f"{pursuer}--{evader}.json".replace("/", "-").replace(":", "-")


def cached_match(folder: Path, match: Match, report: Report = lambda done, total: None) -> MatchResult:
    """What a match comes to, as `play_match`: read from the folder if it lies there, or else played and kept there.

    Raises:
        InvalidInput: as `cached_result` and `play_match`.
    """
    path = match_file(folder, match.players.pursuer.name, match.players.evader.name)
    return cached_result(path, facts_of(match), MatchResult, lambda: play_match(match, report=report))


def facts_of(match: Match) -> dict[str, Any]:
    """All that the result of a match depends on, as JSON-like data."""
    return {
        "pursuer": fingerprint(match.players.pursuer.policy),
        "evader": fingerprint(match.players.evader.policy),
        "game": to_dict(match.game),
        "games": match.games,
        "seed": match.seed,
        "viable": match.starts is StartFilter.VIABLE,
    }
