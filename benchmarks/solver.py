"""Backups a second of the solver on one core: one action at one node, of one robot's grid or of a grid of two.

    python benchmarks/solver.py
    python benchmarks/solver.py --grid 17x17x5x8

Pin it to one core (`taskset -c 0`) to measure one; medians of five runs of sweeps, in CPU time of the process.
"""

import argparse
import time
from collections.abc import Callable
from statistics import median

import jax
import jax.numpy as jnp

import apollonius
from apollonius.cli.values import nodes
from apollonius.game.types import NUM_ACTIONS, Role
from apollonius.solve.grid import lanes_of
from apollonius.solve.joint import guarantee, make_duel
from apollonius.solve.solving import joint_grids
from apollonius.solve.transition_map import make_side
from apollonius.solve.zero_sum_game import make_zero_sum_game

_RUNS = 5


def seconds(run: Callable[[], object]) -> float:
    """Median CPU time of a run [s]; the first one, which compiles, does not count."""
    jax.block_until_ready(run())
    taken = []
    for _ in range(_RUNS):
        begun = time.process_time()
        jax.block_until_ready(run())
        taken.append(time.process_time() - begun)
    return median(taken)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grid", type=nodes, default="11x11x5x8", help="of the game of two (default: %(default)s)")
    parser.add_argument("--hold", type=int, default=10)
    options = parser.parse_args()
    game = apollonius.make_game("paper")

    grid, hold = apollonius.reference_grid(game, Role.PURSUER)
    side = make_side(game, Role.PURSUER, grid, hold)
    alone, free = jnp.zeros(grid.shape, jnp.float32), side.free

    def value(index: jax.Array, action: int, later: jax.Array) -> jax.Array:
        return jnp.where(free[index, action], later, 0.0)

    sweep = jax.jit(lambda table: side.transitions.backup(table, value))
    once = seconds(lambda: sweep(alone))
    print(f"one robot on {grid.name}: {once * 1e3:.1f} ms of CPU time a sweep, ", end="")
    print(f"{grid.size * NUM_ACTIONS / once / 1e6:,.0f} M backups/s")

    grids = joint_grids(game, list(options.grid))
    duel = make_duel(make_zero_sum_game(game, grids, options.hold, Role.PURSUER))
    lanes = lanes_of(duel.first.grid)
    table = jnp.zeros((duel.first.grid.size // lanes, duel.second.grid.size, lanes), jnp.float32)
    pairs = table.size
    half = seconds(lambda: guarantee(duel, table))
    print(f"pairs of {grids[0].name}: {pairs / 1e6:,.1f} M; one side's backups of them ", end="")
    print(f"{half:.3f} s of CPU time, {pairs * NUM_ACTIONS / half / 1e6:,.0f} M backups/s")


if __name__ == "__main__":
    main()
