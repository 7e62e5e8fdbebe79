"""Solve for the least time to a standing target, and draw it.

    pip install -e '.[plot]'
    python examples/solve_reach.py

It writes reach.png, a map of that time for a robot at rest that faces right, and prints:

    from (1, 1) m: 7.9 s
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import apollonius


def main(target: tuple = (6.0, 6.0), nodes: tuple = (51, 51, 9, 47), cells: int = 100) -> None:
    """Solve on a grid of x, y, speed and heading, and ask in `cells` times `cells` places."""
    game = apollonius.make_game("paper")
    grid, hold = apollonius.reference_grid(game, apollonius.Role.PURSUER)
    grid = replace(grid, counts=nodes)
    reach, _ = apollonius.solve_reach(game, grid, hold, target)

    def seconds(x, y):
        speed = jnp.zeros(())
        heading = jnp.zeros(())
        return reach.seconds(apollonius.RobotState(x, y, speed, heading))

    middles = (jnp.arange(cells) + 0.5) * 10.0 / cells
    xs, ys = jnp.meshgrid(middles, middles)
    times = jax.jit(jax.vmap(jax.vmap(seconds)))(xs, ys)
    print(f"from (1, 1) m: {seconds(jnp.float32(1.0), jnp.float32(1.0)):.1f} s")

    times = np.where(np.isfinite(times), times, np.nan)
    figure = Figure(layout="constrained")
    axes = figure.subplots()
    mesh = axes.pcolormesh(xs, ys, times, vmax=15.0)
    axes.plot(*target, "r*", markersize=12)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    figure.colorbar(mesh, label="least time to the target [s]")
    figure.savefig("reach.png")


if __name__ == "__main__":
    main()
