"""CPU time of a decision of the players of a solved game, in batches: by the table, and knowing the opponent.

    apollonius solve game --grid 9x9x5x8 --out P_table.npz
    python benchmarks/table_players.py P_table.npz E_curriculum

Medians of five runs, in CPU time of the process, from moving starts.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

import jax

import apollonius
from apollonius.agents.policy import AbstractPolicy
from apollonius.game.game import reset_batch
from apollonius.game.types import Role
from apollonius.observe.view import Views
from apollonius.solve.foresight import ResponsePolicy
from apollonius.solve.solved import table_player

_RUNS = 5


def microseconds(game: apollonius.Game, player: AbstractPolicy, role: Role, games: int) -> float:
    """Median CPU time of one decision among so many [us]; the first run, which compiles, does not count."""
    states = reset_batch(game, jax.random.key(0), games)
    views = Views(game, states, role)
    words = jax.random.bits(jax.random.key(1), (games,))
    decide = jax.jit(player.together)
    jax.block_until_ready(decide(views, words))
    taken = []
    for _ in range(_RUNS):
        begun = time.process_time()
        jax.block_until_ready(decide(views, words))
        taken.append(time.process_time() - begun)
    return median(taken) / games * 1e6


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, help="file of the solved game")
    parser.add_argument("agent", help="an agent of the other side")
    options = parser.parse_args()
    game = apollonius.make_game("paper")
    table = table_player(options.table, game)
    role = table.zero_sum_game.role
    agent = apollonius.find_player(options.agent, role.other, game).policy
    moving = replace(game, starts=replace(game.starts, speed="moving"))
    players = {"by the table": table, "knowing the agent": ResponsePolicy(table.zero_sum_game, table.table, agent)}
    for name, player in players.items():
        for games in (64, 512):
            print(f"{name}, {games} games: {microseconds(moving, player, role, games):.1f} us a decision", flush=True)


if __name__ == "__main__":
    main()
