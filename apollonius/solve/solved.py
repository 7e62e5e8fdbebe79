"""Players that act by the file of a solved game."""

from pathlib import Path

import jax.numpy as jnp

from apollonius.agents.kind import AbstractKind, Named, known_game
from apollonius.arenas.record import from_dict, to_dict
from apollonius.errors import InvalidInput, require
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.solve.grid import Grid, make_grid
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.store import Problem, is_solution, load_solution
from apollonius.solve.zero_sum_game import ZeroSumGame, make_zero_sum_game

PHYSICS = ("pursuer", "evader", "arena", "capture_distance", "dt")
"""What a solution depends on: not where games start, how long they last, or what a learner is paid."""


class Solved(AbstractKind):
    """The players of solved games' files."""

    looks = "a file of a solved game"

    def find(self, name: str, role: Role, game: Game | None) -> Named | None:
        """Return the player of the file, called after it."""
        if not is_solution(Path(name)):
            return None
        policy, side = table_player(Path(name), known_game(game, name)), role.name.lower()
        solved_for = policy.zero_sum_game.role.name.lower()
        require(solved_for == side, side, f"'{name}'", f"a file solved for the {side}; this is the {solved_for}'s")
        return Named(Path(name).stem, policy)


def table_player(path: Path, game: Game) -> SaddlePolicy:
    """The player that acts by the file of a solved game.

    Raises:
        InvalidInput: when the file is missing, bad, or of another problem or game.
    """
    solution = load_solution(path)
    problem, game = solution.problem, game.duel("a solved game")
    solved_for, asked = to_dict(from_dict(Game, problem.game, str(path))), to_dict(game)
    require(problem.kind == "game", "player", f"'{path}'", f"a solved game; this is one of {problem.kind}")
    if any(solved_for[part] != asked[part] for part in PHYSICS):
        raise InvalidInput(f"'{path}' was solved for another game: solve this one with apollonius solve game.")
    return SaddlePolicy(zero_sum_game_of(problem, game), jnp.asarray(solution.table))


def zero_sum_game_of(problem: Problem, game: Game) -> ZeroSumGame:
    """The game of a `game` problem, from the side that it was solved for."""
    assert problem.payoff is not None
    grids = joint_grids(game, problem.counts)
    return make_zero_sum_game(game, grids, problem.hold, Role[problem.role.upper()], problem.payoff)


def joint_grids(game: Game, counts: list[int]) -> tuple[Grid, Grid]:
    """The pursuer's grid and the evader's, with as many nodes each."""
    return make_grid(game.arena, game.pursuer, tuple(counts)), make_grid(game.arena, game.evader, tuple(counts))
