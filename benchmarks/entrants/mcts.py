"""Processor seconds of a decision of OpenSpiel's tree search, in games of half seconds.

    python -m benchmarks.entrants.mcts

Each simulation ends with random actions until the game is over.
"""

# pyright: reportMissingImports=false

import argparse
import importlib
import time
from statistics import median
from typing import Any

import numpy as np

EXPLORATION = 1.4


def seconds_of(simulations: int, decisions: int) -> float:
    """Return the median over some decisions after the first, which compiles."""
    import pyspiel
    from open_spiel.python.algorithms import mcts

    importlib.import_module("apollonius.envs.open_spiel")  # it registers the game
    options = {"hold": 0.5, "time_limit": 100.0}
    game = pyspiel.load_game_as_turn_based("apollonius_duel", options)
    draw: Any = np.random.RandomState(0)
    bot = mcts.MCTSBot(game, EXPLORATION, simulations, mcts.RandomRolloutEvaluator(1, draw))
    state = game.new_initial_state()
    seconds: list[float] = []
    for _ in range(1 + decisions):
        start = time.process_time()
        action = bot.step(state)
        seconds.append(time.process_time() - start)
        state.apply_action(action)
    return median(seconds[1:])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--simulations", type=int, default=100, help="(default: %(default)s)")
    parser.add_argument("--decisions", type=int, default=10, help="(default: %(default)s)")
    options = parser.parse_args()
    seconds = seconds_of(options.simulations, options.decisions)
    print(f"{options.simulations} simulations: {seconds:.2f} processor seconds a decision")


if __name__ == "__main__":
    main()
