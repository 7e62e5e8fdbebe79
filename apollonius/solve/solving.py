"""Problems of each kind solved on their usual grids; the game of two from both sides, kept in a
folder.

Usual distances and times are on the scale of the paper's robots; a caller may name the nodes.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from math import ceil, tau
from pathlib import Path

import jax.numpy as jnp

from apollonius.agents.source import NamedPlayer, PlayerSource
from apollonius.arenas.file import from_dict, to_dict
from apollonius.game.game import Game
from apollonius.game.types import ROLES, BySide, Role
from apollonius.io.cache import cached, entry_path
from apollonius.io.errors import InvalidInput, require
from apollonius.solve.grid import Grid, Report, Sweep, make_grid
from apollonius.solve.joint import make_duel, solve_duel
from apollonius.solve.motion import ZeroSumGame, make_zero_sum_game
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.reach import solve_reach
from apollonius.solve.safety import solve_safety
from apollonius.solve.store import Problem, Solution, is_solution, load_solution, save_solution

SPACING = 0.2
"""Distance between neighbours along x and y [m], where that takes no more than `MOST` nodes."""
MOST = 101
"""Nodes along x and along y."""
HOLD = 0.5
"""Time for which an action is held [s]: long enough to leave a cell, short enough to steer."""
_HEADINGS = range(40, 65)
"""Numbers of headings among which a hold's turn comes closest to whole cells of one."""
_FASTER = 0.05
"""Least distance between neighbouring speeds [m/s]."""
PAIRS = 1.2e8
"""About as many pairs of nodes has the grid of two robots."""
FEW_PAIRS = 1e7
"""The same of one that is solved in seconds."""
_SPEEDS = 5
"""Its speeds."""
_LONGEST = 2.0
"""Its longest hold [s]."""


def reference_grid(game: Game, role: Role) -> tuple[Grid, int]:
    """Return a grid of one robot's states, for `solve_safety` and `solve_reach`, and the control
    steps of a hold.

    A hold moves the robot by whole cells of speed, and nearly so of heading.
    """
    body = game.body(role)
    dt = float(game.dt)
    hold = max(1, round(HOLD / dt))
    speeds = max(
        2, 1 + ceil((body.v_max - body.v_min) / max(float(body.u1_max) * dt * hold, _FASTER) - 1e-6)
    )
    turn = float(body.usual_turn_rate) * dt * hold
    headings = min(_HEADINGS, key=lambda count: abs(turn * count / tau - round(turn * count / tau)))
    arena = game.arena
    sizes = arena.x_max - arena.x_min, arena.y_max - arena.y_min
    x, y = (min(ceil(size / SPACING) + 1, MOST) for size in sizes)
    return make_grid(arena, body, (x, y, speeds, headings)), hold


def joint_grid(game: Game, role: Role, pairs: float = PAIRS) -> tuple[Grid, int]:
    """Return the grid of one robot of two, coarser, for about these pairs of nodes; and the control
    steps of a hold, by the pursuer's limits for both robots.
    """
    lead = game.pursuer
    dt = float(game.dt)
    arena = game.arena
    faster = (float(lead.v_max) - float(lead.v_min)) / (_SPEEDS - 1)
    hold = max(1, min(round(faster / max(float(lead.u1_max), _FASTER) / dt), round(_LONGEST / dt)))
    headings = min(max(8, round(tau / max(float(lead.usual_turn_rate) * dt * hold, 1e-6))), 16)
    places = pairs**0.5 / (_SPEEDS * headings)
    shape = (float(arena.x_max) - float(arena.x_min)) / (float(arena.y_max) - float(arena.y_min))
    x, y = (max(2, round((places * ratio) ** 0.5)) for ratio in (shape, 1 / shape))
    return make_grid(arena, game.body(role), (x, y, _SPEEDS, headings)), hold


PHYSICS = ("pursuer", "evader", "arena", "capture_distance", "dt")
"""The parts of a game that a solution depends on: not starts, time limit or rewards."""


class SolvedGame(PlayerSource):
    """The players of solved games' files."""

    syntax = "a file of a solved game"

    def find(self, name: str, role: Role, game: Game) -> NamedPlayer | None:
        """Return the player of the file, called after it."""
        if not is_solution(Path(name)):
            return None
        policy, side = table_player(Path(name), game), role.name.lower()
        solved_for = policy.zero_sum_game.role.name.lower()
        require(
            solved_for == side,
            side,
            f"'{name}'",
            f"a file solved for the {side}; this is the {solved_for}'s",
        )
        return NamedPlayer(Path(name).stem, policy)


def table_player(path: Path, game: Game) -> SaddlePolicy:
    """Return the player by a solved game's file; raises InvalidInput for a bad one, or of another
    problem or game.
    """
    solution = load_solution(path)
    problem, game = solution.problem, game.duel("a solved game")
    solved_for, wanted_game = to_dict(from_dict(Game, problem.game, str(path))), to_dict(game)
    require(
        problem.kind == "game",
        "player",
        f"'{path}'",
        f"a solved game; this is one of {problem.kind}",
    )
    if any(solved_for[part] != wanted_game[part] for part in PHYSICS):
        raise InvalidInput(
            f"'{path}' was solved for another game: solve this one with apollonius solve game."
        )
    return SaddlePolicy(zero_sum_game_of(problem, game), jnp.asarray(solution.table))


def zero_sum_game_of(problem: Problem, game: Game) -> ZeroSumGame:
    """Return the game of a `game` problem, from the side that it was solved for."""
    grids = joint_grids(game, problem.counts)
    return make_zero_sum_game(game, grids, problem.hold, Role[problem.role.upper()])


def joint_grids(game: Game, counts: list[int]) -> tuple[Grid, Grid]:
    """Return the pursuer's grid and the evader's, with as many nodes each."""
    return make_grid(game.arena, game.pursuer, tuple(counts)), make_grid(
        game.arena, game.evader, tuple(counts)
    )


def solve_problem(problem: Problem, game: Game, report: Report | None = None) -> Solution:
    """Solve a problem of a game; raises InvalidInput for too large a grid, and a target that is not
    clear of all.
    """
    if problem.kind == "game":
        result = solve_duel(make_duel(zero_sum_game_of(problem, game), problem.whole_cells), report)
        return Solution(problem, result.sweeps, result.residual, result.table.astype(jnp.float16))
    role = Role[problem.role.upper()]
    grid = make_grid(game.arena, game.body(role), tuple(problem.counts))
    if problem.target is None:
        result = solve_safety(game, role, grid, problem.hold, report)
    else:
        x, y = problem.target
        _, result = solve_reach(game, grid, problem.hold, (x, y), report)
    return Solution(problem, result.sweeps, result.residual, result.table)


def cached_tables(
    game: Game,
    counts: Sequence[int] | None,
    folder: Path | None,
    report: Callable[[Role, Sweep], None] = lambda role, sweep: None,
    played: Game | None = None,
) -> BySide[SaddlePolicy]:
    """Return the players of both sides by the solved game.

    Args:
        game: the game that is solved.
        counts: nodes along x, y, v and heading; None for those of `joint_grid`.
        folder: where solutions are kept: what is there is not solved again.
        report: gets the side and the progress after each sweep.
        played: the same game with a chart, or with empty places for obstacles, if it is played so.

    Raises:
        InvalidInput: for a grid that does not fit into memory.
    """

    def player(role: Role) -> SaddlePolicy:
        problem = joint_problem(game, role, counts)
        physics = {part: problem.game.get(part) for part in PHYSICS}
        path = folder and entry_path(
            folder, f"{problem.role}.safetensors", asdict(problem) | {"game": physics}
        )
        solution = cached(
            path,
            lambda: solve_problem(problem, game, lambda sweep: report(role, sweep)),
            save_solution,
            load_solution,
        )
        return SaddlePolicy(zero_sum_game_of(problem, played or game), jnp.asarray(solution.table))

    return ROLES.map(player)


def joint_problem(game: Game, role: Role, counts: Sequence[int] | None = None) -> Problem:
    """Return the game of two from one side, on a grid of these nodes, or of `joint_grid`'s."""
    grid, hold = joint_grid(game, Role.PURSUER)
    return Problem("game", role.name.lower(), to_dict(game), list(counts or grid.counts), hold)
