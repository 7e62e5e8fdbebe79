"""Rates of own failures of robots: sensors, drives, bodies, teams and shields, each with each.

    python benchmarks/combinations.py OUT --game office --game floor.toml

Pursuers with a lidar search; the evader stands, or is `evader` with the same sensors, drive, body
and shield. A cell counts the robots of each side that hit an obstacle or left the arena, and the
games that end in a capture.
"""

import argparse
import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.agents.names import SHIELDED
from apollonius.arenas.file import find_game
from apollonius.evaluate.match import Match, play_games
from apollonius.game.drive import Drive, Drives
from apollonius.game.game import Game
from apollonius.game.presets import in_teams, make_game
from apollonius.game.types import Outcome, RobotStatus, Role

SENSORS = {"all": None, "lidar": make_game("lidar").sensors}
DRIVES = {"at once": None, "lag 1, turn time 0.4 s": (1, 0.4), "lag 5, turn time 0.9 s": (5, 0.9)}
RADII = 0.0, 0.2
PURSUERS = 1, 2
SHIELDS = "", SHIELDED
EVADERS = "still", "evader"
_FAILURES = RobotStatus.HIT_OBSTACLE, RobotStatus.OUT_OF_RANGE


def game_of(place: Game, sensors: str, drive: str, radius: float, pursuers: int) -> Game:
    """Return the game of a cell in the arena of a game."""
    body = replace(place.pursuer, radius=radius)
    limits = DRIVES[drive]
    drives = None if limits is None else Drives(Drive(*limits), Drive(*limits))
    game = replace(place, pursuer=body, evader=body, sensors=SENSORS[sensors], drives=drives)
    return in_teams(replace(game, capture_distance=0.5), pursuers, 1)


def cell(match: Match) -> dict[str, Any]:
    """Play a match; return its captures and, by side, the robots that failed by themselves and all
    robots.
    """
    results = play_games(match)
    outcome = np.asarray(results.outcome)

    def failures(role: Role) -> list[int]:
        status = np.concatenate([np.asarray(status_row) for status_row in results.status[role]])
        return [int(np.isin(status, _FAILURES).sum()), len(status)]

    captures = [int(np.sum(outcome == Outcome.CAPTURED)), len(outcome)]
    return {
        "captured": captures,
        "pursuers fail": failures(Role.PURSUER),
        "evaders fail": failures(Role.EVADER),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument(
        "--game", action="append", help="where to play; may be repeated (default: office)"
    )
    parser.add_argument(
        "--games", type=int, default=200, help="of each cell (default: %(default)s)"
    )
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    names = options.game or ["office"]
    for name, sensors, pursuers, shield, evader, drive, radius in itertools.product(
        names, SENSORS, PURSUERS, SHIELDS, EVADERS, DRIVES, RADII
    ):
        game = game_of(find_game(name), sensors, drive, radius, pursuers)
        pursuer = f"{shield}{'searching:' if game.sensors else ''}pursuer"
        players = pursuer, evader if evader == "still" else shield + evader
        about = {
            "game": Path(name).stem,
            "sensors": sensors,
            "drive": drive,
            "radius": radius,
            "pursuers": pursuers,
        }
        row = (
            about | {"players": players} | cell(Match.of_names(game, *players, games=options.games))
        )
        rows.append(row)
        print(json.dumps(row), flush=True)
        lines = ",\n ".join(json.dumps(row) for row in rows)
        options.out.write_text(f'{{"games of a cell": {options.games}, "cells": [\n {lines}\n]}}\n')


if __name__ == "__main__":
    main()
