"""How long a game on a large ROS occupancy map takes to load, and how fast it is then.

    python benchmarks/occupancy_map.py --cells 4000

writes a map of rooms with doors and pillars, loads the game of it (reading, hashing, the field of distances, the check
that there is room to start) and steps 4,096 games on it.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from PIL import Image

import apollonius

CELL, GAMES, ROUNDS = 0.05, 4096, 20
LOADS = 5


def write_floor(folder: Path, cells: int, seed: int) -> Path:
    """A square floor: walls every 200 cells, a door in each, pillars, unknown cells outside the walls."""
    pixels = np.full((cells, cells), 254, np.uint8)
    rng = np.random.default_rng(seed)
    for wall in range(0, cells, 200):
        pixels[wall : wall + 4], pixels[:, wall : wall + 4] = 0, 0
    for wall, room in np.ndindex(cells // 200, cells // 200):
        door = room * 200 + int(rng.integers(20, 140))
        pixels[wall * 200 : wall * 200 + 4, door : door + 40] = 254
        pixels[door : door + 40, wall * 200 : wall * 200 + 4] = 254
    for row, column in rng.integers(0, cells - 20, size=(cells // 10, 2)):
        pixels[row : row + 8, column : column + 8] = 0
    pixels[:40] = pixels[-40:] = 205
    pixels[:, :40] = pixels[:, -40:] = 205
    Image.fromarray(pixels).save(folder / "floor.pgm")
    (folder / "floor.yaml").write_text(
        f"image: floor.pgm\nresolution: {CELL}\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    (folder / "floor.toml").write_text('[arena]\nmap = "floor.yaml"\n')
    return folder / "floor.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=4000, help="along each side")
    options = parser.parse_args()
    apollonius.find_game("paper").reset(jax.random.key(0))  # what starts only once is not the map's
    seconds: list[float] = []
    games: list[apollonius.Game] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(LOADS):  # another map each time, as the last ones are remembered
            path = write_floor(Path(folder), options.cells, seed)
            begun = time.perf_counter()
            games.append(apollonius.find_game(str(path)))
            seconds.append(time.perf_counter() - begun)
    print(f"{options.cells} x {options.cells} cells loaded in {statistics.median(seconds):.2f} s, median of {LOADS}")
    print("each: " + ", ".join(f"{one:.2f}" for one in seconds) + " s; the first one compiles")

    game = games[-1]
    starts = jax.jit(apollonius.reset_batch, static_argnames="games")(game, jax.random.key(0), games=GAMES)
    step = jax.jit(jax.vmap(type(game).step, in_axes=(None, 0, 0, 0)))
    actions = jnp.full(GAMES, 8)
    jax.block_until_ready(step(game, starts, actions, actions))
    rates = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        jax.block_until_ready(step(game, starts, actions, actions))
        rates.append(GAMES / (time.perf_counter() - begun))
    print(f"{statistics.median(rates):,.0f} env steps per second at {GAMES} games, median of {ROUNDS}")


if __name__ == "__main__":
    main()
