"""Matches kept as files, so that a tournament that was stopped goes on where it was."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from apollonius.agents.kind import fingerprint
from apollonius.arenas.record import from_dict, to_dict
from apollonius.document import parse_json, read_bytes, write_atomically
from apollonius.errors import InvalidInput, require
from apollonius.evaluate.match import Match, MatchResult, StartFilter, play_match
from apollonius.playout import Report


@dataclass(frozen=True)
class KeptMatch:
    """A match, and all that its result depends on. Players are kept by their fingerprints: two may share a name."""

    pursuer: str
    evader: str
    game: dict[str, Any]
    games: int
    seed: int
    viable: bool
    result: MatchResult | None = None


def match_file(folder: Path, pursuer: str, evader: str) -> Path:
    """Where the match of two players is kept."""
    return folder / f"{pursuer}--{evader}.json".replace("/", "-").replace(":", "-")


def kept_match(folder: Path, match: Match, report: Report = lambda done, total: None) -> MatchResult:
    """What a match comes to, as `play_match`: read from the folder if it lies there, or else played and kept there.

    Raises:
        InvalidInput: when the file is bad, or of a match of other players, rules, starts or length; as `play_match`.
    """
    path = match_file(folder, match.pursuer.name, match.evader.name)
    pursuer, evader = (fingerprint(player.policy) for player in (match.pursuer, match.evader))
    viable = match.starts is StartFilter.VIABLE
    asked = KeptMatch(pursuer, evader, to_dict(match.game), match.games, match.seed, viable)
    if path.exists():
        kept = _read(path)
        same = replace(kept, result=None) == asked
        require(same, "folder of matches", folder, f"another one: '{path.name}' is of another match")
        assert kept.result is not None
        return kept.result
    result = play_match(match, report=report)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(path, json.dumps(to_dict(replace(asked, result=result)), indent=1).encode())
    return result


def _read(path: Path) -> KeptMatch:
    remedy = f"'{path}' is no match that was kept (remove it, and it is played again)"
    content = read_bytes(path, "a match that was kept", "remove it, and it is played again")
    kept = from_dict(KeptMatch, parse_json(content, remedy), remedy)
    if kept.result is None:
        raise InvalidInput(f"{remedy}.")
    return kept
