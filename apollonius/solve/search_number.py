"""The number of pursuers that are sure to see an evader, for idealised robots on the graph of an
arena.

The evader is as fast as they, knows where they are, and can be wherever nobody would have seen it:
the contaminated nodes (Parsons, "Pursuit-evasion in a graph", 1978; Guibas et al., "A
visibility-based pursuit-evasion problem", 1999). All move at once, to a neighbour or nowhere; then
the pursuers look.
"""

import heapq
import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from apollonius.arenas.free_space import FreeSpace, Tiling
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.sensing import Sensors
from apollonius.game.types import Flag, RobotState
from apollonius.solve.cop_number import Adjacency, CopNumber, GraphResult, find_cop_number

SIZES = (100, 150, 200, 250)
"""Cells that the free space is cut into, as of `apollonius.solve.cop_number`."""
MOST_STATES = 40_000
"""Most states that are examined for a number of pursuers: some seconds."""
BRANCHES = 6, 12
"""Most moves of a team that are followed from a state, those that leave the fewest contaminated
nodes: in a deep search and, where that finds nothing, in a wide one. Of one pursuer all are."""
MOST_SEARCHERS = 4
"""Most pursuers that are tried."""
Team = tuple[int, ...]
"""The nodes of all pursuers, in order."""
Nodes = Bool[np.ndarray, " nodes"]


def find_search_number(game: Game, space: FreeSpace, report: Callable[[float], None]) -> CopNumber:
    """Judge a game's arena as `apollonius.solve.cop_number.find_cop_number`, by the pursuers' line
    of sight and range.

    Errors, delays and fields of view do not count; without sensors the pursuers have a line of
    sight.
    """
    sensors = (game.sensors and game.sensors.pursuer) or Sensors(line_of_sight=True)
    return find_cop_number(
        space,
        report,
        partial(_judge_search, game.arena, replace(sensors, field_of_view=None)),
        SIZES,
    )


def _judge_search(arena: Arena, sensors: Sensors, tiling: Tiling) -> GraphResult | None:
    """Find the least number of pursuers on a graph, and their strategy; None without one."""
    in_sight, exact = nodes_in_sight(arena, sensors, tiling.places), True
    for pursuers in range(1, MOST_SEARCHERS + 1):
        search_with = partial(clearing_strategy, tiling.adjacency, in_sight, pursuers)
        searches = (search_with(branches) for branches in BRANCHES)
        strategy, all_examined = next((search for search in searches if any(search)), ([], False))
        if strategy:
            places = tiling.places[np.array(strategy)]
            return GraphResult(tiling, len(in_sight), pursuers, exact, places)
        exact = all_examined
    return None


def nodes_in_sight(
    arena: Arena, sensors: Sensors, places: Float[np.ndarray, "nodes 2"]
) -> Bool[np.ndarray, "nodes nodes"]:
    """Return the nodes that a robot at each node has in sight."""
    x, y = jnp.asarray(places.T, jnp.float32)

    def sees(node: Int[Array, ""], other: Int[Array, ""]) -> Flag:
        zero = jnp.zeros(())
        return sensors.reaches(
            arena, *(RobotState(x[number], y[number], zero, zero) for number in (node, other))
        )

    nodes = jnp.arange(len(places))
    return np.asarray(jax.jit(jax.vmap(jax.vmap(sees, (None, 0)), (0, None)))(nodes, nodes))


def clearing_strategy(
    adjacency: Adjacency,
    in_sight: Bool[np.ndarray, "nodes nodes"],
    pursuers: int,
    branches: int,
    most_states: int = MOST_STATES,
) -> tuple[list[Team], bool]:
    """Search a team's moves that clear a graph; return its nodes from turn to turn, empty if none.

    A state is a team's nodes and the contaminated ones. States with the fewest contaminated nodes
    come first. A state is left out if another one has the same team's nodes and no contaminated
    node besides those of this one, since whatever clears this one clears that. The second value is
    whether all states were examined without success: then no team of this size is enough.

    Args:
        adjacency: the graph.
        in_sight: the nodes that a robot at each node sees.
        pursuers: number of robots in the team.
        branches: most moves that are followed from a state; all for one robot.
        most_states: most states that are examined.
    """
    near = adjacency | np.eye(len(adjacency), dtype=bool)
    spreads = near.astype(np.float32)
    around = [np.flatnonzero(row).tolist() for row in near]
    states = _SearchStates()
    for node in range(len(near)):
        states.add((node,) * pursuers, ~in_sight[node], -1)
    examined_all = True
    for _ in range(most_states):
        state = states.pop()
        if state is None:
            return [], examined_all
        if not state.num_contaminated:
            return states.path_to(state.number), False
        after = spreads @ state.contaminated.astype(np.float32) > 0
        teams = _moves_from(states.paths[state.number][0], around)
        remaining = after & ~np.any(in_sight[np.array(teams)], axis=1)
        most = len(teams) if pursuers == 1 else branches
        best = np.argsort(remaining.sum(axis=1), kind="stable")[:most]
        examined_all = examined_all and len(best) == len(teams)
        for move in best.tolist():
            states.add(teams[move], remaining[move], state.number)
    return [], False


def _moves_from(team: Team, around: list[list[int]]) -> list[Team]:
    """Return the nodes of a team after each of its moves, by the nodes that each node leads to."""
    choices = itertools.product(*(around[node] for node in team))
    return sorted({tuple(sorted(nodes)) for nodes in choices})


class _WaitingState(NamedTuple):
    """A state that is to be examined; those with the fewest contaminated nodes come first, and of
    these the oldest.
    """

    num_contaminated: int
    number: int
    """Number of the state, in the order in which they were added."""
    contaminated: Nodes


class _SearchStates:
    """The states of a search.

    Attributes:
        paths: the nodes of each state's team, and the number of the state before, or -1.
        waiting: a heap of states that are to be examined, and of others since replaced.
        least: the contaminated nodes of each team's states, of which none contains another's.
    """

    def __init__(self) -> None:
        self.paths: list[tuple[Team, int]] = []
        self.waiting: list[_WaitingState] = []
        self.least: dict[Team, list[Nodes]] = {}

    def add(self, team: Team, contaminated: Nodes, before: int) -> None:
        """Add a state that follows another, unless one of the team has no node besides its own."""
        smaller = self.least.get(team, [])
        if any(np.all(contaminated | ~other) for other in smaller):
            return
        larger = [other for other in smaller if np.any(other & ~contaminated)]
        self.least[team] = [*larger, contaminated]
        state = _WaitingState(int(contaminated.sum()), len(self.paths), contaminated)
        heapq.heappush(self.waiting, state)
        self.paths.append((team, before))

    def pop(self) -> _WaitingState | None:
        """Remove and return the next state that was not replaced, or None."""
        while self.waiting:
            state = heapq.heappop(self.waiting)
            team, _ = self.paths[state.number]
            if any(state.contaminated is nodes for nodes in self.least[team]):
                return state
        return None

    def path_to(self, number: int) -> list[Team]:
        """Return the teams' nodes from a first state to this one."""
        path: list[Team] = []
        while number >= 0:
            team, number = self.paths[number]
            path.append(team)
        return path[::-1]
