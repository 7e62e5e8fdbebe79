"""The matches by which the agents at the end of a training run are judged."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from apollonius.agents.store import load_header
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, MatchResult, play_match
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS, names_of
from apollonius.game.types import ROLES
from apollonius.io.document import to_json, write_atomically
from apollonius.io.errors import require
from apollonius.play.playout import Report

MOST_MATCHES = 32
"""Most matches between the agents of one run; those that training leaves there meet in three."""


def last_agents(run: Path) -> dict[str, Path]:
    """Files of the agents at the end of a run's stages by name; those kept on the way are left out."""
    return {path.stem: path for path in sorted(run.glob("agents/*.safetensors")) if "-" not in path.stem}


def pairings(agents: Mapping[str, Path]) -> list[tuple[str, str]]:
    """Pursuer and evader of every match between these agents and the players that need no training.

    The pursuer of stage 1 meets an evader that stays, as in its training; any other the random evader and all evaders.
    """
    roles = {name: load_header(file).role for name, file in agents.items()}
    evaders = ["random", *[name for name, role in roles.items() if role == "evader"]]
    return [
        (name, opponent)
        for name, role in roles.items()
        if role == "pursuer"
        for opponent in (["still"] if name == "P_stage1" else evaders)
    ]


def last_matches(run: Path, game: Game, games: int, seed: int) -> dict[tuple[str, str], Match]:
    """Return the matches of a run's last agents, by the names that they have in it.

    Raises:
        InvalidInput: for more than `MOST_MATCHES`.
    """
    agents, found = last_agents(run), {}
    pairs = pairings(agents)
    require(len(pairs) <= MOST_MATCHES, f"matches of the agents in '{run}'", len(pairs), f"at most {MOST_MATCHES}")
    for pair in pairs:
        files = BySide(*pair).map(lambda name: str(agents.get(name, name)))
        players = ROLES.map(lambda role, files=files: find_player(files[role], role, game))
        found[pair] = Match(game, players, games, seed)
    return found


def evaluate_run(
    run: Path,
    game: Game,
    games: int,
    on_match: Callable[[Match, MatchResult], None],
    report: Report = lambda done, total: None,
) -> None:
    """Play the matches of a run's last agents, and keep what they come to in its `evaluation.json`.

    Args:
        games: in each match.
        on_match: called after each.
        report: called with the games of all matches together, as by `play_match`.
    """
    matches = last_matches(run, game, games, seed=1)
    record: dict[str, Any] = {}

    def of_all(before: int, done: int, total: int) -> None:
        report(before + done, total * len(matches))

    for number, ((pursuer, evader), match) in enumerate(matches.items()):
        result = play_match(match, report=partial(of_all, number * games))
        record[f"{pursuer} against {evader}"] = result.to_dict()
        on_match(match, result)
    write_atomically(run / "evaluation.json", to_json(record, indent=2).encode())


_MUCH = 0.1
"""A fall of the pursuer's wins that wants a word."""


def self_play_trend(looks: Sequence[tuple[int, Mapping[str, int]]]) -> str:
    """Compare how greedy games ended at the first look at self-play and at the last, and say where wins went.

    Args:
        looks: env steps before each greedy evaluation, and its games by outcome.

    Returns:
        Some sentences; empty where there are fewer than two looks.
    """
    if len(looks) < 2:
        return ""
    first, last = (_shares(outcomes) for _, outcomes in (looks[0], looks[-1]))
    parts = [f"{what} from {first[what]:.0%} to {last[what]:.0%}" for what in list(first)[1:]]
    said = (
        f"Self-play, greedy games, from {looks[0][0]:,} to {looks[-1][0]:,} env steps: "
        f"the pursuer's wins went from {first['wins']:.0%} to {last['wins']:.0%}: {', '.join(parts)}."
    )
    fallen, given = (first[what] - last[what] for what in ("wins", "the evader's own failures"))
    if fallen >= _MUCH and given >= fallen / 2:
        said += (
            " So most of the early wins were the evader's own mistakes, which it has learned to avoid; catching one "
            "that makes none is the harder task, and what the pursuer still wins is the measure of it."
        )
    return said


def _shares(outcomes: Mapping[str, int]) -> dict[str, float]:
    games = max(1, sum(outcomes.values()))
    wins = sum(outcomes.get(name, 0) for name in names_of(PURSUER_WINS)) / games
    captured = outcomes.get("captured", 0) / games
    return {
        "wins": wins,
        "captures": captured,
        "the evader's own failures": wins - captured,
        "games without result": outcomes.get("no_result", 0) / games,
    }
