"""Both sides' tables of the game of two robots, solved once and kept in a folder."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path

import jax.numpy as jnp

from apollonius.arenas.record import to_dict
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import ROLES, Role
from apollonius.solve.iteration import Sweep
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.reference import joint_grid
from apollonius.solve.solved import table_player, zero_sum_game_of
from apollonius.solve.solving import solve_problem
from apollonius.solve.store import Problem, save_solution


def kept_tables(
    game: Game,
    counts: Sequence[int] | None,
    folder: Path | None,
    report: Callable[[Role, Sweep], None] = lambda role, sweep: None,
    played: Game | None = None,
) -> BySide[SaddlePolicy]:
    """The players of both sides by the solved game, payoff `win`; what the folder holds is not solved again.

    Args:
        counts: nodes along x, y, v and heading; None for those of `joint_grid`.
        folder: where the files are kept, each named after what it solves; None keeps none.
        report: told after each sweep.
        played: the same game as the players shall play it, whose arena may have a chart, and empty places for
            obstacles; None for the game itself.

    Raises:
        InvalidInput: for a grid that memory has no room for, and a damaged file.
    """

    def player(role: Role) -> SaddlePolicy:
        problem = joint_problem(game, role, counts)
        path = folder / _file_name(problem) if folder else None
        if path is not None and path.is_file():
            found = table_player(path, game)
            return found if played is None else replace(found, zero_sum_game=zero_sum_game_of(problem, played))
        solution = solve_problem(problem, game, lambda sweep: report(role, sweep))
        if path is not None:
            save_solution(solution, path)
        return SaddlePolicy(zero_sum_game_of(problem, played or game), jnp.asarray(solution.table))

    return ROLES.map(player)


def joint_problem(game: Game, role: Role, counts: Sequence[int] | None = None) -> Problem:
    """The game of two robots from one side, payoff `win`, on a grid of so many nodes, or of `joint_grid`'s."""
    grid, hold = joint_grid(game, Role.PURSUER)
    return Problem("game", role.name.lower(), to_dict(game), list(counts or grid.counts), hold, payoff="win")


def _file_name(problem: Problem) -> str:
    asked = json.dumps(asdict(problem), sort_keys=True)
    return f"{problem.role}-{sha256(asked.encode()).hexdigest()[:12]}.npz"
