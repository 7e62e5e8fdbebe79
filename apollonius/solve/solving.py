"""Any of the problems there are, solved as its file asks for."""

from collections.abc import Callable

import jax.numpy as jnp

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.solve.grid import make_grid
from apollonius.solve.guarantee import make_duel, solve_duel
from apollonius.solve.iteration import Sweep, silent
from apollonius.solve.reach import make_chase, solve_reach
from apollonius.solve.safety import solve_safety
from apollonius.solve.solved import zero_sum_game_of
from apollonius.solve.store import Problem, Solution


def solve_problem(problem: Problem, game: Game, report: Callable[[Sweep], None] = silent) -> Solution:
    """Solve a problem of a game.

    Args:
        report: told after each sweep.

    Raises:
        InvalidInput: for a grid that memory has no room for, and a target that is not clear of everything.
    """
    if problem.kind == "game":
        solved = solve_duel(make_duel(zero_sum_game_of(problem, game)), report)
        return Solution(problem, solved.sweeps, solved.residual, solved.table.astype(jnp.float16))
    role = Role[problem.role.upper()]
    grid = make_grid(game.arena, game.body(role), tuple(problem.counts))
    if problem.target is None:
        solved = solve_safety(game, role, grid, problem.hold, report)
    else:
        x, y = problem.target
        _, solved = solve_reach(make_chase(game, grid, problem.hold), (x, y), report)
    return Solution(problem, solved.sweeps, solved.residual, solved.table)
