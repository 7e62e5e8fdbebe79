"""Players by name, among them those that act by a solved game's file."""

from pathlib import Path

import jax.numpy as jnp

from apollonius.agents.catalogue import SHIELDED, Named, find_agent
from apollonius.agents.shield import shielded
from apollonius.errors import InvalidInput, require
from apollonius.game.game import Game
from apollonius.game.record import to_dict
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
    path, side = Path(bare), role.name.lower()
    solution = load_solution(path)
    problem = solution.problem
    require(problem.kind == "game", side, f"'{bare}'", f"a solved game; this is one of {problem.kind}")
    require(problem.role == side, side, f"'{bare}'", f"a file solved with --role {side}; this is the {problem.role}'s")
    asked = to_dict(game)
    if any(problem.game[part] != asked[part] for part in _PHYSICS):
        raise InvalidInput(f"'{bare}' was solved for another game: solve this one with apollonius solve game.")
    policy = SaddlePolicy(contest_of(problem, game), jnp.asarray(solution.table))
    if bare != name:
        return Named(SHIELDED + path.stem, shielded(policy, game, role))
    return Named(path.stem, policy)


def contest_of(problem: Problem, game: Game) -> Contest:
    """The game of a `game` problem, from the side that it was solved for."""
    assert problem.payoff is not None
    grids = joint_grids(game, problem.counts)
    return make_contest(game, grids, problem.hold, Role[problem.role.upper()], problem.payoff)


def joint_grids(game: Game, counts: list[int]) -> tuple[Grid, Grid]:
    """The pursuer's grid and the evader's, with as many nodes each."""
    return make_grid(game.arena, game.pursuer, tuple(counts)), make_grid(game.arena, game.evader, tuple(counts))
