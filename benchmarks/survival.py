"""Starts that the zoo's evader survives, and a planner that knows the pursuer: `python
benchmarks/survival.py OUT`.

Every sixth held-out arena of `suite-v1` and every fifth of `suite-v2`, points, games of 60 s
against `pursuer`, from the same starts for both; 1 is survived. The planner follows no course of
the evader that is judged, so that its starts are the same for all. Some 20 minutes of a core.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from apollonius.agents.source import NamedPlayer
from apollonius.arenas.charting import with_chart
from apollonius.arenas.suite import suite_arena, suite_names
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_games
from apollonius.exploit.attackers import PLANNER, planner_against
from apollonius.game.game import Game
from apollonius.game.outcome import evader_winning
from apollonius.game.scenario import Scenario
from apollonius.game.types import BySide, Role

FOLLOWED = "flee", "flee-aware", "E_curriculum"
"""Players by whose courses the planner plans."""
SECONDS, EVERY = 60, {"suite-v1": 6, "suite-v2": 5}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--games", type=int, default=4, help="in each arena (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=11, help="of the starts (default: %(default)s)")
    options = parser.parse_args()
    places = [
        (suite, name)
        for suite, every in EVERY.items()
        for name in suite_names(suite, "held-out")[::every]
    ]
    arenas = [suite_arena(*place) for place in places]
    own_arenas = Scenario.of(arenas).each()  # of one shape, so that steps compile once
    survivals = dict[str, dict[str, list[int]]]()
    for place, arena, own_arena in zip(places, arenas, own_arenas, strict=True):
        chart = with_chart(Game(arena=arena)).chart
        game = replace(Game(arena=own_arena, chart=chart), max_steps=SECONDS * 10)
        pursuer = find_player("pursuer", Role.PURSUER, game)
        planner = NamedPlayer(PLANNER, planner_against(pursuer, Role.PURSUER, game, FOLLOWED))
        for evader in (planner, find_player("evader", Role.EVADER, game)):
            match = Match(game, BySide(pursuer, evader), options.games, options.seed)
            outcome = np.asarray(play_games(match, slots=options.games).outcome)
            survived = np.isin(outcome, evader_winning(time_limit_wins=True)).astype(int).tolist()
            survivals.setdefault("/".join(place), {})[evader.name] = survived
        print("/".join(place), survivals["/".join(place)], flush=True)
    options.out.write_text(json.dumps(survivals, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
