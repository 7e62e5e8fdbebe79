"""Records the golden games: `python -m tests.golden.record`, or those of some games: `... movers`.

They change when the rules do, and then only; `make page` compiles the new rules for the page. A pairing gives its first
game of every outcome that no pairing before it gave for the same game.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from apollonius.evaluate.match import Match, play_games, record_game
from apollonius.game.models import MODELS
from apollonius.game.movers import Movers
from apollonius.game.presets import make_game
from apollonius.game.timetable import Door, Shuttle
from apollonius.game.types import Outcome
from apollonius.game.walkers import Walkers
from apollonius.play.replay import save_replay

FOLDER = Path(__file__).parent
PAIRINGS = (
    ("paper", "rest", "P_scratch", "E_scratch", 1000),
    ("paper", "moving", "random", "random", 200),
    ("four-small", "moving", "random", "random", 200),
    ("one-large", "rest", "P_random", "random", 200),
    ("robot", "moving", "random", "random", 200),
    ("zero-sum", "rest", "P_random", "still", 200),
    ("territory", "rest", "random", "territory", 200),
    ("car", "moving", "random", "random", 200),
    ("wheels", "moving", "random", "random", 200),
    ("omni", "moving", "random", "random", 200),
    ("movers", "moving", "random", "random", 300),
)
"""Game, or kind of both robots, starts, pursuer, evader, time limit [steps]."""
MOVERS = Movers(
    (Shuttle(((1.0, 1.0), (5.0, 1.0), (5.0, 3.0)), hx=0.3, pause=1.0), Shuttle(((9.0, 5.0), (9.0, 1.0)), v_max=1.5)),
    (Door(4.0, 7.0, 0.8, 0.0, share_open=0.3),),
    (Walkers(5), Walkers(2, radius=0.2, v_max=0.8)),
)
GAMES = 2000


def golden_game(name):
    """Return a game by its name, or that of the robots of a kind."""
    if name == "movers":
        return replace(make_game("paper"), movers=MOVERS)
    if name not in MODELS:
        return make_game(name)
    body = MODELS[name](radius=0.2)
    return replace(make_game("robot"), pursuer=body, evader=replace(body, v_min=-0.3, v_max=0.9, u1_max=0.5))


def record(name, starts, pursuer_name, evader_name, max_steps):
    game = golden_game(name)
    game = replace(game, starts=replace(game.starts, speed=starts), max_steps=max_steps)
    match = Match.of_names(game, pursuer_name, evader_name, GAMES)
    ended = np.asarray(play_games(match).outcome)
    for outcome in Outcome:
        path = FOLDER / f"{name}-{outcome.name.lower()}.json"
        if (ended == outcome).any() and not path.exists():
            index = int(np.argmax(ended == outcome))
            save_replay(record_game(match, index), path)
            print(path.name)


if __name__ == "__main__":
    chosen = [pairing for pairing in PAIRINGS if pairing[0] in (sys.argv[1:] or pairing)]
    for name, *_ in chosen:
        for old in FOLDER.glob(f"{name}-*.json"):
            old.unlink(missing_ok=True)
    for pairing in chosen:
        record(*pairing)
