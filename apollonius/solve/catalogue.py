"""Players by name, among them those that act by a solved game's file."""

from pathlib import Path

import jax.numpy as jnp

from apollonius.agents.catalogue import SHIELDED, Named, find_agent
from apollonius.agents.shield import shielded
from apollonius.arenas.record import from_dict, to_dict
from apollonius.errors import InvalidInput, require
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.solve.contest import Contest, make_contest
from apollonius.solve.grid import Grid, make_grid
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.store import Problem, load_solution

SUFFIX = ".npz"
"""How the names of solutions' files end."""
_PHYSICS = ("pursuer", "evader", "arena", "capture_distance", "dt")
"""What a solution depends on: not where games start, how long they last, or what a learner is paid."""


def find_player(name: str, role: Role, game: Game) -> Named:
    """The player of this name: one that acts by the file of a solved game, or an agent (`agents.catalogue.find_agent`).

    Raises:
        InvalidInput: when there is none, its file is bad, or it was solved for the other side or another game.
    """
    bare = name.removeprefix(SHIELDED)
    if not bare.endswith(SUFFIX):
        return find_agent(name, role, game)
    policy, side = table_player(Path(bare), game), role.name.lower()
    solved_for = policy.contest.role.name.lower()
    require(solved_for == side, side, f"'{bare}'", f"a file solved with --role {side}; this is the {solved_for}'s")
    if bare != name:
        return Named(SHIELDED + Path(bare).stem, shielded(policy, game, role))
    return Named(Path(bare).stem, policy)


def table_player(path: Path, game: Game) -> SaddlePolicy:
    """The player that acts by the file of a solved game.

    Raises:
        InvalidInput: when the file is missing, bad, or of another problem or game.
    """
    solution = load_solution(path)
    problem = solution.problem
    solved_for, asked = to_dict(from_dict(Game, problem.game, str(path))), to_dict(game)
    require(problem.kind == "game", "player", f"'{path}'", f"a solved game; this is one of {problem.kind}")
    if any(solved_for[part] != asked[part] for part in _PHYSICS):
        raise InvalidInput(f"'{path}' was solved for another game: solve this one with apollonius solve game.")
    return SaddlePolicy(contest_of(problem, game), jnp.asarray(solution.table))


def contest_of(problem: Problem, game: Game) -> Contest:
    """The game of a `game` problem, from the side that it was solved for."""
    assert problem.payoff is not None
    grids = joint_grids(game, problem.counts)
    return make_contest(game, grids, problem.hold, Role[problem.role.upper()], problem.payoff)


def joint_grids(game: Game, counts: list[int]) -> tuple[Grid, Grid]:
    """The pursuer's grid and the evader's, with as many nodes each."""
    return make_grid(game.arena, game.pursuer, tuple(counts)), make_grid(game.arena, game.evader, tuple(counts))
