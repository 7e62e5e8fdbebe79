"""`pursuer` and `evader` on floors of buildings that they have never seen:
`python benchmarks/buildings.py FILE` plays in each held-out arena of `suite-v3` and counts.

Robots have the paper's limits and radii from 0.15 to 0.3 m, other ones on each floor, and 0.3 m
between their bodies at a capture.
"""

import argparse
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.arenas.suite import (
    BUILDINGS,
    RADIUS_IN_BUILDINGS,
    scenario_game,
    single_arena_games,
    suite_names,
)
from apollonius.evaluate.match import Match, play_match
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game

PAIRS = (
    ("shielded:pursuer", "still"),
    ("pursuer", "still"),
    ("shielded:pursuer", "shielded:evader"),
)
"""Pursuers and evaders that play."""


def with_bodies(game: Game, radius: float) -> Game:
    """Return a game of robots of a radius [m]."""
    body = Unicycle(radius=radius)
    capture_distance = game.capture_distance + 2 * radius
    return replace(game, pursuer=body, evader=body, capture_distance=capture_distance)


def main() -> None:
    """Play, and write the counts of each pair and floor after each floor."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument(
        "--games", type=int, default=50, help="of a pair on each floor (default: %(default)s)"
    )
    options = parser.parse_args()
    names = suite_names(BUILDINGS, "held-out")
    games = single_arena_games(scenario_game(f"{BUILDINGS}/{','.join(names)}"))
    radii = np.linspace(*RADIUS_IN_BUILDINGS, len(names)).round(3).tolist()
    floors = list[dict[str, Any]]()
    for name, game, radius in zip(names, games, radii, strict=True):
        outcomes = dict[str, dict[str, int]]()
        for pair in PAIRS:
            match = Match.of_names(with_bodies(game, radius), *pair, options.games)
            outcomes[" v ".join(pair)] = play_match(match).outcomes
        floors.append({"floor": name, "radius": radius, "outcomes": outcomes})
        totals = {
            pair: dict(sum((Counter(floor["outcomes"][pair]) for floor in floors), Counter()))
            for pair in outcomes
        }
        print(name, radius, totals, flush=True)
        record = {"games of a pair on a floor": options.games, "totals": totals, "floors": floors}
        options.out.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
