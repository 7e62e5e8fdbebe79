"""Whether `pursuer` hunts `evader` better than a rule, and where both lose: `python
benchmarks/hunter.py OUT`.

The rule drives along the shortest path to the evader, behind a shield: `shielded:search` in full
sight. Both play from the same starts for 60 s, in arenas in which neither agent was trained. A game
that is lost while the evader has turned about by one and a half turns more to one side than to the
other counts as a loop.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from apollonius.arenas.file import find_game
from apollonius.evaluate.match import Match, draw_starts
from apollonius.evaluate.statistics import paired_difference_interval
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS
from apollonius.game.polygon import Polygon
from apollonius.io.document import write_atomically
from apollonius.play.playout import AbstractWatcher, play_out
from apollonius.play.rollout import Transition

PURSUERS = "pursuer", "shielded:search"
ROUND = 1.5
"""Turns of an evader that runs round a loop."""


def box(x_min: float, y_min: float, x_max: float, y_max: float) -> Polygon:
    return Polygon(((x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)))


def arena(width: float, height: float, *walls: Polygon) -> Arena:
    return Arena(0.0, width, 0.0, height, polygons=walls)


ARENAS = {
    "ring_road": find_game("examples/games/ring_road.toml").arena,
    "two_halls": find_game("examples/games/two_halls.toml").arena,
    "office": find_game("office").arena,
    "blocks": find_game("blocks").arena,
    "hairpin": arena(14.0, 9.0, box(0, 2.8, 11.5, 3.1), box(2.5, 5.9, 14, 6.2)),
    "hourglass": arena(16.0, 9.0, box(7.8, 0, 8.2, 3.7), box(7.8, 5.3, 8.2, 9)),
    "comb": arena(14.0, 9.0, *(box(x, 2.5, x + 0.3, 9) for x in (3.3, 6.9, 10.5))),
    "pillars": arena(
        14.0, 10.0, *(box(x, y, x + 0.4, y + 0.4) for x in (2, 5, 8, 11) for y in (2, 5, 8))
    ),
}


class LeftTurns(AbstractWatcher):
    """How many more of the evader's actions turn left than right."""

    def init(self) -> Int[Array, ""]:
        return jnp.zeros((), jnp.int32)

    def update(self, statistic: Int[Array, ""], transition: Transition) -> Int[Array, ""]:
        return statistic + transition.sides.evader.action % 3 - 1


def play(game: Game, pursuer: str, games: int, seed: int) -> dict[str, Any]:
    """Return the games of a seed that a pursuer wins, and the kinds of the others."""
    match = Match.of_names(game, pursuer, "evader", games, seed)
    starts, key = draw_starts(match)
    results = play_out(match.rules, match.pools, starts, key, slots=64, watcher=LeftTurns())
    has_won = np.isin(results.outcome, PURSUER_WINS)
    a_turn = 2 * np.pi / (float(game.evader.u2_max) * float(game.dt))  # [steps]
    goes_round = np.abs(np.asarray(results.watched)) > ROUND * a_turn
    has_failed = np.isin(results.outcome, PURSUER_FAILS)
    return {
        "wins": int(has_won.sum()),
        "lost in a loop": int((~has_won & goes_round).sum()),
        "own failures": int(has_failed.sum()),
        "seconds of a win": round(float(results.steps[has_won].mean()) * float(game.dt), 1),
        "won": "".join(map(str, has_won.astype(int))),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--arenas", nargs="+", choices=ARENAS, default=list(ARENAS))
    parser.add_argument("--games", type=int, default=1000, help="in each (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=3, help="(default: %(default)s)")
    options = parser.parse_args()
    rows: dict[str, Any] = {}
    base = find_game("examples/games/ring_road.toml")
    for name in options.arenas:
        game = base.in_arena(ARENAS[name])
        row = {each: play(game, each, options.games, options.seed) for each in PURSUERS}
        first, second = (np.array(list(row[each].pop("won"))) == "1" for each in PURSUERS)
        interval = paired_difference_interval(first, second)
        rows[name] = row | {"points more": [round(100 * end, 1) for end in interval]}
        print(name, json.dumps(rows[name]), flush=True)
        result = {"games": options.games, "seed": options.seed, "arenas": rows}
        write_atomically(options.out, f"{json.dumps(result, indent=1)}\n".encode())


if __name__ == "__main__":
    main()
