"""Compare what a solved game promises with what its player keeps, in bins of the promise.

    apollonius solve game --whole-cells --grid 17x17x5x8 --out P_table.safetensors
    apollonius solve game --whole-cells --grid 17x17x5x8 --role evader --out E_table.safetensors
    python benchmarks/calibration.py P_table.safetensors E_table.safetensors --out calibration.json

A table's value of a start is what it promises its player there. The player meets the other table and searches that
simulate the game against it for one second and for two, and then trust that table; the worst one in a bin says what it
keeps.
"""

import argparse
import json
from pathlib import Path

import jax
import numpy as np

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import solo
from apollonius.arenas.file import find_game
from apollonius.evaluate.match import keys_of, starting
from apollonius.evaluate.statistics import mean_interval
from apollonius.exploit.attack import Attack
from apollonius.exploit.attackers import Means, attackers_of
from apollonius.game.by_side import BySide
from apollonius.game.game import sample_starts
from apollonius.game.types import GameState, Role
from apollonius.play.playout import play_out
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.solving import table_player

EDGES = (-1.0, -0.6, -0.3, -0.1, -0.02, 0.02, 0.1, 0.3, 0.6, 1.0)
"""Ends of the bins of a promise, a discounted payoff."""
DRAWN_STARTS = 20_000


def chosen(promised: np.ndarray, games: int, seed: int) -> np.ndarray:
    """Return the numbers of starts, as evenly over the bins of their promises as there are enough."""
    shuffled = np.random.default_rng(seed).permutation(len(promised))
    bins = np.digitize(promised[shuffled], EDGES[1:-1])
    rank = np.empty(len(shuffled), int)
    for one in range(len(EDGES) - 1):
        rank[bins == one] = np.arange((bins == one).sum())
    return shuffled[np.argsort(rank, kind="stable")[:games]]


def kept_by(player: SaddlePolicy, attacker: AbstractPolicy, starts: GameState, seed: int) -> np.ndarray:
    """Return the discounted payoffs of the player's side from starts."""
    zero_sum_game = player.zero_sum_game
    pools = BySide.of(zero_sum_game.role, player, attacker).map(solo)
    played = play_out(zero_sum_game.game, pools, starts, keys_of(np.uint32(seed))[1])
    return np.asarray(zero_sum_game.payoff_of(played.outcome, played.steps * zero_sum_game.game.dt))


def calibrate(attack: Attack, means: Means, games: dict[str, int]) -> dict[str, object]:
    """Return, for each bin of the promise, its mean and what the player keeps against each attacker."""
    player, seed = attack.player.policy, means.seed
    assert isinstance(player, SaddlePolicy)
    game, _ = starting(attack.rules, "moving")
    starts = sample_starts(game, jax.random.key(seed), DRAWN_STARTS)
    promised = np.asarray(player.best_value(starts))
    order = chosen(promised, max(games.values()), seed)
    bins = np.digitize(promised[order], EDGES[1:-1])
    rows: list[dict[str, object]] = [{} for _ in EDGES[1:]]
    for name, count in games.items():
        (attacker,) = attackers_of(name, attack, means)
        some = order[:count]
        kept = kept_by(player, attacker.policy, jax.tree.map(lambda leaf, some=some: leaf[some], starts), seed)
        for number, row in enumerate(rows):
            here = bins[: len(some)] == number
            if here.sum() > 1:
                low, high = mean_interval(kept[here], -1.0, 1.0)
                row.setdefault("promised", round(float(promised[order][bins == number].mean()), 4))
                mean, interval = round(float(kept[here].mean()), 4), [round(low, 4), round(high, 4)]
                row[name] = {"games": int(here.sum()), "kept": mean, "interval": interval}
        print(name, json.dumps(rows), flush=True)
    return {"promised, mean over starts": round(float(promised.mean()), 4), "bins": [row for row in rows if row]}


def main() -> None:
    """Calibrate both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", type=Path, nargs=2, metavar="FILE", help="the pursuer's and the evader's")
    parser.add_argument("--game", default="paper")
    parser.add_argument("--games", type=int, default=1000, help="against table and short search (default: 1000)")
    parser.add_argument("--searched", type=int, default=200, help="against the long search (default: 200)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    game = find_game(options.game)
    tables = BySide(*(table_player(path, game) for path in options.tables))
    games = {"table": options.games, "search-1": options.games, "search-2": options.searched}
    games = {name: count for name, count in games.items() if count}
    means, files = Means(tables, Path(), seed=options.seed), BySide(*options.tables)
    found = {role.name.lower(): calibrate(Attack(role, str(files[role]), options.game), means, games) for role in Role}
    options.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
