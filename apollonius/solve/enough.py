"""How many pursuers are enough in an arena, for idealised robots: equally fast, without inertia, turn by turn.

The arena is a graph of hexagonal cells, a step leads from one to the next. Three pursuers are always enough there, as
the graph is planar (Aigner and Fromme, 1984), and in the arena itself (Bhadauria, Klein, Isler and Suri, 2012). Whether
one or two are is computed on graphs of growing fineness, each turned against the one before by half the angle between
sides.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from apollonius.arenas.free_space import FreeSpace, Tiling, tile
from apollonius.solve.cop_number import core, evade, solve_chase

SIZES = (250, 500, 1000, 2000)
"""Cells that the free space is cut into, if all were whole, until enough graphs in a row agree."""
AGREEING = 3
"""Graphs in a row that must agree: with cells near the lengths that decide, two agree by chance."""
MOST_NODES = 1000
"""Most nodes of a graph's core: two pursuers there take 1 GB and some minutes."""
_TURN = np.pi / 6
"""Cells turned by this are least like those that are not."""
ALWAYS = 3
"""This many are enough in every arena."""


@dataclass(frozen=True)
class Reading:
    """A graph and its verdict.

    Attributes:
        tiling: the graph.
        core: those of its nodes on which the game is solved.
        pursuers: how many are enough on it.
        run: where an evader runs for ever that one pursuer fewer does not catch [m]; empty where one is enough.
        starts: where those pursuers start meanwhile [m].
    """

    tiling: Tiling
    core: Int[np.ndarray, " kept"]
    pursuers: int
    run: Float[np.ndarray, "steps 2"]
    starts: Float[np.ndarray, "fewer 2"]


@dataclass(frozen=True)
class Enough:
    """The number of pursuers that are enough in an arena.

    Attributes:
        space: the arena.
        readings: of graphs from coarse to fine.
    """

    space: FreeSpace
    readings: tuple[Reading, ...]

    @property
    def agree(self) -> bool:
        """True where the finest graphs have one verdict."""
        finest = self.readings[-AGREEING:]
        return len(finest) == AGREEING and len({reading.pursuers for reading in finest}) == 1

    @property
    def pursuers(self) -> int | None:
        """Number of pursuers that are enough; None where the graphs do not agree."""
        return self.readings[-1].pursuers if self.agree else None

    @property
    def verdict(self) -> str:
        """The number of pursuers in words."""
        if self.pursuers is None:
            said = sorted({reading.pursuers for reading in self.readings[-AGREEING:]})
            return f"the graphs do not agree or are too few: {' or '.join(map(str, said))}"
        enough = ("1 pursuer is enough", "2 pursuers are enough, 1 is not", "3 pursuers are enough, 2 are not")
        return f"{enough[self.pursuers - 1]}, for idealised robots on this graph"


def how_many(space: FreeSpace, report: Callable[[float], None]) -> Enough:
    """Judge an arena on graphs from coarse to fine, until three in a row see every island and agree.

    Args:
        space: where robots can be.
        report: called before each graph with the spacing of its cells [m].
    """
    readings: list[Reading] = []
    for number, size in enumerate(SIZES):
        spacing = float(np.sqrt(2 * space.area / np.sqrt(3) / size))
        report(spacing)
        tiling = tile(space, spacing, (number + 1) % 2 * _TURN)
        kept = core(tiling.adjacency)
        if len(kept) > MOST_NODES:
            break
        readings.append(_read(tiling, kept))
        found = Enough(space, tuple(readings))
        if found.agree and all(reading.tiling.holes == space.islands for reading in readings[-AGREEING:]):
            break
    return Enough(space, tuple(readings))


def _read(tiling: Tiling, kept: Int[np.ndarray, " kept"]) -> Reading:
    inner, places = tiling.adjacency[np.ix_(kept, kept)], tiling.places[kept]
    pursuers, run, starts = 1, np.zeros((0, 2)), np.zeros((0, 2))
    while len(kept) > 1 and pursuers < ALWAYS:
        chase = solve_chase(inner, pursuers)
        if chase.always:
            break
        evasion = evade(inner, chase)
        pursuers, run, starts = pursuers + 1, places[list(evasion.evader)], places[list(evasion.pursuers)]
    return Reading(tiling, kept, pursuers, run, starts)
