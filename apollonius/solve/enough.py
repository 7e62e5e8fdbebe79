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

from apollonius.arenas.free_space import FreeSpace, Island, Tiling, tile
from apollonius.solve.cop_number import Evasion, core, evade, solve_chase

SIZES = (250, 500, 1000, 2000)
"""Cells that the free space is cut into, if all were whole, until enough graphs in a row agree."""
AGREEING = 3
"""Graphs in a row that must agree: with cells near the lengths that decide, two agree by chance."""
MOST_NODES = 1000
"""Most nodes of a graph's core: two pursuers there take 125 MB and a minute or two."""
_TURN = np.pi / 6
"""Cells turned by this are least like those that are not."""
_FOR = "for idealised robots on this graph"
ALWAYS = 3
"""This many are enough in every arena."""


@dataclass(frozen=True)
class Reading:
    """What one graph says.

    Attributes:
        tiling: the graph.
        core: those of its nodes on which the game is solved.
        islands: how many of the arena's islands it sees.
        pursuers: how many are enough on it.
    """

    tiling: Tiling
    core: Int[np.ndarray, " kept"]
    islands: int
    pursuers: int


@dataclass(frozen=True)
class Enough:
    """How many pursuers are enough in an arena.

    Attributes:
        space: the arena.
        readings: of graphs from coarse to fine.
        evasion: on the nodes of the last one, of the evader that one pursuer fewer never catches; None where one is
            enough.
    """

    space: FreeSpace
    readings: tuple[Reading, ...]
    evasion: Evasion | None

    @property
    def agree(self) -> bool:
        """Whether the finest graphs say the same."""
        finest = self.readings[-AGREEING:]
        return len(finest) == AGREEING and len({reading.pursuers for reading in finest}) == 1

    @property
    def pursuers(self) -> int | None:
        """How many are enough; None where the graphs do not agree."""
        return self.readings[-1].pursuers if self.agree else None

    @property
    def unseen(self) -> int:
        """Islands that are smaller than the cells of the finest graph: there it is as if they were not there."""
        return len(self.space.islands) - self.readings[-1].islands

    @property
    def verdict(self) -> str:
        """How many are enough, in words."""
        if self.pursuers is None:
            said = sorted({reading.pursuers for reading in self.readings[-AGREEING:]})
            return f"the graphs do not agree or are too few: {' or '.join(map(str, said))}"
        if self.pursuers == 1:
            return f"1 pursuer is enough, {_FOR}"
        fewer = f"{self.pursuers - 1} {'is' if self.pursuers == 2 else 'are'} not"
        return f"{self.pursuers} pursuers are enough, {fewer}, {_FOR}"

    @property
    def run(self) -> Float[np.ndarray, "steps 2"]:
        """Where the evader runs that one pursuer fewer does not catch [m]."""
        return self._places(self.evasion.evader if self.evasion else ())

    @property
    def starts(self) -> Float[np.ndarray, "pursuers 2"]:
        """Where those pursuers start meanwhile [m]."""
        return self._places(self.evasion.pursuers if self.evasion else ())

    @property
    def circled(self) -> tuple[Island, ...]:
        """The islands that it runs round."""
        return tuple(island for island in self.space.islands if _winds(self.run, island))

    def _places(self, nodes: tuple[int, ...]) -> Float[np.ndarray, "nodes 2"]:
        """Of nodes of the last graph [m]."""
        return self.readings[-1].tiling.places[list(nodes)] if nodes else np.zeros((0, 2))


def how_many(space: FreeSpace, report: Callable[[float, float], None]) -> Enough:
    """Judge an arena on graphs from coarse to fine, until three in a row see every island and agree.

    Args:
        space: where robots can be.
        report: told when a graph is made, with the spacing of its cells [m], and later which share of all states is
            known to be caught.
    """
    readings: list[Reading] = []
    evasion = None
    for number, size in enumerate(SIZES):
        spacing = float(np.sqrt(2 * space.area / np.sqrt(3) / size))
        report(spacing, 0.0)
        tiling = tile(space, spacing, (number + 1) % 2 * _TURN)
        kept = core(tiling.adjacency)
        if len(kept) > MOST_NODES:
            break
        inner = tiling.adjacency[np.ix_(kept, kept)]
        pursuers, lost = 1, None
        while len(kept) > 1 and pursuers < ALWAYS:
            chase = solve_chase(inner, pursuers, lambda share, spacing=spacing: report(spacing, share))
            if chase.always:
                break
            pursuers, lost = pursuers + 1, chase
        readings.append(Reading(tiling, kept, tiling.holes, pursuers))
        if lost:
            run = evade(inner, lost)
            evasion = Evasion(tuple(kept[list(run.pursuers)].tolist()), tuple(kept[list(run.evader)].tolist()))
        else:
            evasion = None
        found = Enough(space, tuple(readings), evasion)
        if found.agree and all(reading.islands == len(space.islands) for reading in readings[-AGREEING:]):
            break
    return Enough(space, tuple(readings), evasion)


def _winds(run: Float[np.ndarray, "steps 2"], island: Island) -> bool:
    """Whether a closed run goes round an island, once or more often."""
    if not len(run):
        return False
    x, y = (run - (island.x, island.y)).T
    angle = np.arctan2(y, x)
    turned = np.unwrap(np.append(angle, angle[0]))
    return abs(float(turned[-1] - turned[0])) > np.pi
