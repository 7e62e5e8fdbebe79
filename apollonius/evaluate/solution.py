"""A solution in numbers: how well it was solved, and its values at the starts of its game."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.game.by_side import one_each
from apollonius.game.game import Game, sample_starts
from apollonius.game.types import Role
from apollonius.solve.grid import make_grid
from apollonius.solve.motion import motion_of
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.reach import Reach
from apollonius.solve.solving import zero_sum_game_of
from apollonius.solve.store import Solution

STARTS = 20_000
"""Starts over which shares and times are taken."""


def about(solution: Solution, game: Game) -> dict[str, Any]:
    """Return a solution in numbers by their names: how well it was solved, and its values at the game's starts."""
    problem = solution.problem
    how = {
        "grid": "x".join(map(str, problem.counts)),
        "hold [s]": round(problem.hold * float(game.dt), 6),
        "sweeps": solution.sweeps,
        "residual": solution.residual,
    }
    kinds = {"safety": _about_safety, "reach": _about_reach, "game": _about_game}
    return how | kinds[problem.kind](solution, game, Role[problem.role.upper()])


def _about_safety(solution: Solution, game: Game, role: Role) -> dict[str, Any]:
    grid = make_grid(game.arena, game.body(role), tuple(solution.problem.counts))
    moving = replace(game, starts=replace(game.starts, speed="moving"))
    starts = sample_starts(moving, jax.random.key(0), STARTS)
    robots = one_each(starts.robots)[role]
    values = jax.jit(jax.vmap(lambda robot: grid.interpolate(solution.table, robot)))(robots)
    return {"moving starts lost, by the table": float(np.mean(np.asarray(values) < 0))}


def _about_reach(solution: Solution, game: Game, role: Role) -> dict[str, Any]:
    assert solution.problem.target is not None
    x, y = (jnp.asarray(coordinate, jnp.float32) for coordinate in solution.problem.target)
    grid = make_grid(game.arena, game.pursuer, tuple(solution.problem.counts))
    reach = Reach(game, motion_of(game, role, solution.problem.hold), grid, x, y, solution.table)
    robots = sample_starts(game, jax.random.key(0), STARTS).pursuer
    seconds = np.asarray(jax.jit(jax.vmap(reach.seconds))(robots))
    caught = np.isfinite(seconds)
    return {
        "starts with a capture": float(np.mean(caught)),
        "median time to capture [s]": float(np.median(seconds)),
        "longest [s]": float(np.max(seconds[caught], initial=0.0)),
    }


def _about_game(solution: Solution, game: Game, role: Role) -> dict[str, Any]:
    """Return what the table promises the side at the game's starts, most of which are between nodes."""
    player = SaddlePolicy(zero_sum_game_of(solution.problem, game), solution.table)
    starts = sample_starts(game, jax.random.key(0), STARTS)
    promised = np.asarray(player.best_value(starts))
    return {
        f"promised to the {role.name.lower()}, on average over starts": float(np.mean(promised)),
        "at the best start": float(np.max(promised)),
        "at the worst": float(np.min(promised)),
    }
