"""Random arenas in which every robot can go everywhere."""

from dataclasses import replace

import numpy as np

from apollonius.errors import InvalidInput, require
from apollonius.game.arena import Arena, Disc
from apollonius.game.game import Game
from apollonius.limits import DISCS, SEED

_TRIES = 2000
"""Places tried for each disc."""


def random_arena(
    discs: int,
    seed: int,
    *,
    gap: float = 1.0,
    width: float = 10.0,
    height: float = 10.0,
    radius: tuple[float, float] = (0.3, 0.8),
) -> Arena:
    """An arena with discs of random places and sizes, at least a gap from each other and from the walls.

    Every robot of a diameter below the gap can go from any free place to any other: discs grown by its radius touch
    neither each other nor the walls, and separate round obstacles do not cut a rectangle in parts.

    Args:
        discs: how many.
        seed: of the random numbers; one seed, one arena.
        gap: least width of all passages [m].
        width, height: of the arena [m].
        radius: smallest and largest radius of a disc [m]; uniform between.

    Raises:
        InvalidInput: for impossible numbers, and where so many discs find no room.
    """
    least, most = radius
    DISCS.require("discs", discs)
    SEED.require("seed", seed)
    require(gap >= 0, "gap", gap, "0 m or more")
    require(0 < least <= most, "radius", radius, "more than 0 m, the smallest first")
    require(
        2 * (most + gap) < min(width, height), "width, height", (width, height),
        f"more than {2 * (most + gap):g} m each, the largest disc with a gap on either side",
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    placed: list[Disc] = []
    for index in range(discs):
        for _ in range(_TRIES):
            size = rng.uniform(least, most)
            x, y = rng.uniform(size + gap, np.array([width, height]) - size - gap)
            if all(np.hypot(x - disc.x, y - disc.y) >= size + disc.radius + gap for disc in placed):
                placed.append(Disc(float(x), float(y), float(size)))
                break
        else:
            raise InvalidInput(
                f"discs = {discs} find no room: after {index} the next fits in none of {_TRIES:,} places; ask for "
                "fewer or smaller discs, a smaller gap, or a larger arena."
            )
    return Arena(x_max=float(width), y_max=float(height), discs=tuple(placed))


def in_random_arena(game: Game, discs: int, seed: int, gap: float, size: tuple[float, float]) -> Game:
    """A game in a random arena of a width and height [m] in which both of its robots can go everywhere.

    Arguments and errors are those of `random_arena`; the gap must also let the robots through.
    """
    for name, body in (("pursuer", game.pursuer), ("evader", game.evader)):
        bound = f"more than 2 {name}.radius = {2 * body.radius:g} m, or it does not fit through"
        require(gap > 2 * body.radius, "gap", gap, bound)
    width, height = size
    return replace(game, arena=random_arena(discs, seed, gap=gap, width=width, height=height))
