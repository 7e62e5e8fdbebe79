"""Agents in robots of all kinds: `python benchmarks/robot_kinds.py OUT`.

`pursuer` and `evader` were trained with unicycles alone. Robots of a kind have the paper's limits
and its own numbers by default; real ones are those of `examples/games`, in the paper's arena.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.evaluate.match import Match, play_games
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.game import Game
from apollonius.game.models import MODELS
from apollonius.game.outcome import EVADER_FAILS, PURSUER_FAILS
from apollonius.game.types import Outcome

ARENAS = "paper", "suite-v2/held-out"
REAL = "turtlebot4", "jackal", "f1tenth", "ridgeback"
PAIRS = (
    "pursuer still",
    "pursuer evader",
    "shielded:pursuer still",
    "shielded:pursuer shielded:evader",
)


def games() -> Iterator[tuple[str, Game]]:
    """Yield the games by their names."""
    for arena in ARENAS:
        rules = find_game(arena)
        for name, kind in MODELS.items():
            yield f"{name} in {arena}", replace(rules, pursuer=kind(), evader=kind())
    for name in REAL:
        yield name, find_game(f"examples/games/{name}.toml")


def count(outcomes: np.ndarray) -> dict[str, Any]:
    """Return the captures, and the own failures of each side with their intervals."""
    games = len(outcomes)
    captured = int(np.sum(outcomes == Outcome.CAPTURED))
    counts: dict[str, Any] = {"games": games, "captured": captured}
    counts["captured, 95 %"] = [round(end, 4) for end in wilson_interval(captured, games)]
    for side, kinds in (("pursuer", PURSUER_FAILS), ("evader", EVADER_FAILS)):
        failed = int(np.sum(np.isin(outcomes, [*kinds, Outcome.BOTH_FAILED])))
        counts[f"{side}'s own failures"] = failed
        interval = wilson_interval(failed, games)
        counts[f"{side}'s own failures, 95 %"] = [round(end, 4) for end in interval]
    return counts


def main() -> None:
    """Play, and write the counts of each game and pair."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--games", type=int, default=1000)
    parser.add_argument("--pairs", nargs="+", default=PAIRS)
    options = parser.parse_args()
    record: dict[str, Any] = {}
    for pair in options.pairs:
        for name, rules in games():
            game = with_chart(rules)
            pursuer, evader = pair.split()
            results = play_games(Match.of_names(game, pursuer, evader, options.games, seed=0))
            record[f"{name}: {pair}"] = count(np.asarray(results.outcome))
            print(name, pair, record[f"{name}: {pair}"], flush=True)
            options.out.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
