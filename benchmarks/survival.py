"""Starts that the zoo's evader survives, and a planner that knows the pursuer: `python
benchmarks/survival.py OUT`.

Some held-out arenas of the suites, games against `pursuer` from the same starts for both; 1 is
survived. Robots are points in `suite-v1` and `suite-v2`, with games of 60 s, and discs of 0.2 m on
the floors of `suite-v3`, with games of 120 s. The planner follows no course of the evader that is
judged, so that its starts are the same for all. Some 20 minutes of a core for the first two.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from buildings import with_bodies

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


class SuiteRules(NamedTuple):
    """Every how many of a suite's held-out arenas are played in, for how long [s], and the robots'
    radius [m]."""

    every: int
    seconds: int
    radius: float


SETTINGS = {
    "suite-v1": SuiteRules(every=6, seconds=60, radius=0.0),
    "suite-v2": SuiteRules(every=5, seconds=60, radius=0.0),
    "suite-v3": SuiteRules(every=4, seconds=120, radius=0.2),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument(
        "--suites",
        nargs="+",
        choices=SETTINGS,
        default=["suite-v1", "suite-v2"],
        help="whose arenas are played in (default: the first two)",
    )
    parser.add_argument("--games", type=int, default=4, help="in each arena (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=11, help="of the starts (default: %(default)s)")
    options = parser.parse_args()
    places = [
        (suite, name)
        for suite in options.suites
        for name in suite_names(suite, "held-out")[:: SETTINGS[suite].every]
    ]
    arenas = [suite_arena(*place) for place in places]
    own_arenas = Scenario.of(arenas).each()  # of one shape, so that steps compile once
    survivals = dict[str, dict[str, list[int]]]()
    for place, arena, own_arena in zip(places, arenas, own_arenas, strict=True):
        suite_rules = SETTINGS[place[0]]
        rules = with_bodies(Game(arena=arena), suite_rules.radius)
        chart = with_chart(rules).chart
        rules = replace(rules, arena=own_arena, chart=chart)
        game = replace(rules, max_steps=suite_rules.seconds * 10)
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
