"""The number of pursuers that are sure to see an evader, for idealised robots on the graph of an arena.

The evader is as fast as they, knows where they are, and can be wherever nobody would have seen it: the contaminated
nodes (Parsons, "Pursuit-evasion in a graph", 1978; Guibas et al., "A visibility-based pursuit-evasion problem", 1999).
All move at once, to a neighbour or nowhere; then the pursuers look.
"""

import heapq
import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from apollonius.arenas.free_space import FreeSpace, Tiling
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.sensing import Sensors
from apollonius.game.types import Flag, RobotState
from apollonius.solve.enough import Adjacency, Enough, Reading, how_many

SIZES = (100, 150, 200, 250)
"""Cells that the free space is cut into, as of `apollonius.solve.enough`."""
MOST_STATES = 40_000
"""Most states that are examined for a number of pursuers: some seconds."""
BRANCHES = 6, 12
"""Most moves of a team that are followed from a state, those that leave the fewest contaminated nodes: in a deep search
and, where that finds nothing, in a wide one. Of one pursuer all are."""
MOST_SEARCHERS = 4
"""Most pursuers that are tried."""
Team = tuple[int, ...]
"""The nodes of all pursuers, in order."""
Nodes = Bool[np.ndarray, " nodes"]


def how_many_to_see(game: Game, space: FreeSpace, report: Callable[[float], None]) -> Enough:
    """Judge a game's arena as `apollonius.solve.enough.how_many`, by the pursuers' line of sight and range.

    Errors, delays and fields of view do not count; without sensors the pursuers have a line of sight.
    """
    sensors = (game.sensors and game.sensors.pursuer) or Sensors(line_of_sight=True)
    return how_many(space, report, partial(_read, game.arena, replace(sensors, field_of_view=None)), SIZES)


def _read(arena: Arena, sensors: Sensors, tiling: Tiling) -> Reading | None:
    """Return how many pursuers are enough on a graph, and their strategy; None where none is found."""
    seen, exact = sights(arena, sensors, tiling.places), True
    for pursuers in range(1, MOST_SEARCHERS + 1):
        searches = (clearing(tiling.adjacency, seen, pursuers, branches) for branches in BRANCHES)
        found, all_examined = next((one for one in searches if any(one)), ([], False))
        if found:
            return Reading(tiling, len(seen), pursuers, exact, tiling.places[np.array(found)])
        exact = all_examined
    return None


def sights(arena: Arena, sensors: Sensors, places: Float[np.ndarray, "nodes 2"]) -> Bool[np.ndarray, "nodes nodes"]:
    """Return which nodes a robot at each node has in sight."""
    x, y = jnp.asarray(places.T, jnp.float32)

    def sees(here: Int[Array, ""], there: Int[Array, ""]) -> Flag:
        zero = jnp.zeros(())
        return sensors.reaches(arena, *(RobotState(x[node], y[node], zero, zero) for node in (here, there)))

    nodes = jnp.arange(len(places))
    return np.asarray(jax.jit(jax.vmap(jax.vmap(sees, (None, 0)), (0, None)))(nodes, nodes))


def clearing(
    adjacency: Adjacency, seen: Bool[np.ndarray, "nodes nodes"], pursuers: int, branches: int, most: int = MOST_STATES
) -> tuple[list[Team], bool]:
    """Return the nodes of a team from turn to turn until no evader can be left, and whether all states were examined.

    A state is a team's nodes and the contaminated ones. Those with the fewest come first, and one is left out whose
    nodes are those of another one and include its contaminated ones, since whatever clears it clears that. If all were
    examined, and no way is returned, no team of this size is enough.
    """
    near = adjacency | np.eye(len(adjacency), dtype=bool)
    spreads, around = near.astype(np.float32), [np.flatnonzero(row).tolist() for row in near]
    least: dict[Team, list[Nodes]] = {}
    ways: list[tuple[Team, int]] = []
    waiting: list[tuple[int, int, Nodes]] = []

    def add(team: Team, contaminated: Nodes, before: int) -> None:
        others = least.get(team, [])
        if not any(np.all(contaminated | ~other) for other in others):
            least[team] = [other for other in others if np.any(other & ~contaminated)] + [contaminated]
            heapq.heappush(waiting, (int(contaminated.sum()), len(ways), contaminated))
            ways.append((team, before))

    for node in range(len(near)):
        add((node,) * pursuers, ~seen[node], -1)
    whole = True
    for _ in range(most):
        while waiting and not any(waiting[0][2] is kept for kept in least[ways[waiting[0][1]][0]]):
            heapq.heappop(waiting)
        if not waiting:
            return [], whole
        left, number, contaminated = heapq.heappop(waiting)
        if not left:
            found: list[Team] = []
            while number >= 0:
                team, number = ways[number]
                found.append(team)
            return found[::-1], False
        after = spreads @ contaminated.astype(np.float32) > 0
        teams = sorted({tuple(sorted(nodes)) for nodes in itertools.product(*(around[at] for at in ways[number][0]))})
        rest = after & ~np.any(seen[np.array(teams)], axis=1)
        best = np.argsort(rest.sum(axis=1), kind="stable")[: len(teams) if pursuers == 1 else branches]
        whole = whole and len(best) == len(teams)
        for move in best.tolist():
            add(teams[move], rest[move], number)
    return [], False
