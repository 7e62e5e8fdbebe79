"""Any of the problems there are, solved as its file asks for; the game of two from both sides, kept in a folder."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import jax.numpy as jnp

from apollonius.arenas.record import to_dict
from apollonius.cache import entry, kept
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import ROLES, Role
from apollonius.solve.grid import make_grid
from apollonius.solve.guarantee import make_duel, solve_duel
from apollonius.solve.iteration import Sweep, silent
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.reach import make_chase, solve_reach
from apollonius.solve.reference import joint_grid
from apollonius.solve.safety import solve_safety
from apollonius.solve.solved import PHYSICS, zero_sum_game_of
from apollonius.solve.store import Problem, Solution, load_solution, save_solution


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


def kept_tables(
    game: Game,
    counts: Sequence[int] | None,
    folder: Path | None,
    report: Callable[[Role, Sweep], None] = lambda role, sweep: None,
    played: Game | None = None,
) -> BySide[SaddlePolicy]:
    """Return the players of both sides by the solved game, payoff `win`; what the folder holds is not solved again.

    Args:
        counts: nodes along x, y, v and heading; None for those of `joint_grid`.
        folder: where the files are kept, each named after what it solves; None keeps none.
        report: told after each sweep.
        played: the game as the players shall play it, whose arena may have a chart, and empty places for obstacles;
            None for the game itself.

    Raises:
        InvalidInput: for a grid that memory has no room for.
    """

    def player(role: Role) -> SaddlePolicy:
        problem = joint_problem(game, role, counts)
        physics = {part: problem.game.get(part) for part in PHYSICS}
        path = folder and entry(folder, f"{problem.role}.safetensors", asdict(problem) | {"game": physics})
        solution = kept(
            path,
            lambda: solve_problem(problem, game, lambda sweep: report(role, sweep)),
            save_solution,
            load_solution,
        )
        return SaddlePolicy(zero_sum_game_of(problem, played or game), jnp.asarray(solution.table))

    return ROLES.map(player)


def joint_problem(game: Game, role: Role, counts: Sequence[int] | None = None) -> Problem:
    """Return the game of two robots from one side, payoff `win`, on a grid of so many nodes, or of `joint_grid`'s."""
    grid, hold = joint_grid(game, Role.PURSUER)
    return Problem("game", role.name.lower(), to_dict(game), list(counts or grid.counts), hold, payoff="win")
