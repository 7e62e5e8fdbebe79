"""`apollonius solve`: ground truth by dynamic programming, kept as a file."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.commands.ending import command, finish
from apollonius.commands.options import add_grid_options, chosen_rules, plots, requested_grid
from apollonius.commands.values import named, new_file, real, require_writable
from apollonius.errors import InvalidInput, require

if TYPE_CHECKING:
    from collections.abc import Callable

    from apollonius.display import Display
    from apollonius.game.game import Game
    from apollonius.game.types import Role
    from apollonius.solve.store import Problem, Solution

STARTS = 20_000
"""Starts over which shares and times are taken."""


def add_solve(subparsers: Any) -> None:
    """The parser of `solve`."""
    parser = subparsers.add_parser("solve", help="solve for optimal play on a grid, and keep the table")
    parser.add_argument(
        "what", choices=("safety", "reach", "game"),
        help="safety: whence a robot can avoid a crash for ever; reach: the least time to a standing target; "
        "game: what a side is sure of against any opponent",
    )  # fmt: skip
    parser.add_argument(
        "--game", type=named, default="paper", help="name of the game, or its .toml file (default: %(default)s)"
    )
    parser.add_argument(
        "--role", choices=("pursuer", "evader"), help="of safety and game: which side (default: pursuer)"
    )
    parser.add_argument("--target", type=real, nargs=2, metavar=("X", "Y"), help="of reach: where it stands [m]")
    parser.add_argument(
        "--payoff", choices=("win", "time"),
        help="of game: a win is worth 1 and a loss -1, discounted (win, default), or only the time to a win (time)",
    )  # fmt: skip
    add_grid_options(parser)
    parser.add_argument(
        "--out",
        type=new_file(".npz"),
        help="file of the table; what it holds is not solved again (default: WHAT-GAME.npz)",
    )
    parser.add_argument(
        "--plot", type=new_file(".png"), metavar="FILE", help="draw what was solved as .png: two maps of the arena"
    )
    parser.add_argument("--force", action="store_true", help="overwrite a file that holds something else")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.set_defaults(run=run_solve)


def run_solve(options: argparse.Namespace) -> int:
    """Solve, or load what is solved already; say how good it is and what it means."""
    from apollonius.arenas.file import find_game
    from apollonius.game.types import Role
    from apollonius.solve.store import load_solution, save_solution

    game, what = find_game(options.game), options.what
    require(
        (options.target is not None) == (what == "reach"),
        "--target",
        options.target,
        "X Y for reach, and left out otherwise",
    )
    require(
        not (what == "reach" and options.role), "--role", options.role, "left out for reach, where the pursuer moves"
    )
    role = Role[(options.role or "pursuer").upper()]
    problem = _game_problem(options, game, role) if what == "game" else _robot_problem(options, game, role)
    if options.plot:
        _drawing()
    path: Path = options.out or Path(f"{what}-{Path(options.game).stem}.npz")
    require_writable("--out", path.parent)
    written: list[Path] = []
    if path.exists() and not options.force:
        solution = load_solution(path)
        if solution.problem != problem:
            raise InvalidInput(f"'{path}' holds the solution of another problem: give another --out, or --force.")
    else:
        solution = _solve(problem, game, role, options.display)
        path.parent.mkdir(parents=True, exist_ok=True)
        save_solution(solution, path)
        written.append(path)
    if options.plot:
        options.plot.parent.mkdir(parents=True, exist_ok=True)
        _drawing()(solution, game, options.plot)
        written.append(options.plot)
    options.display.begin("judging the table", compiles=True)
    facts = {
        "grid": "x".join(map(str, problem.counts)),
        "hold [s]": round(problem.hold * float(game.dt), 6),
        "sweeps": solution.sweeps,
        "residual": solution.residual,
    }
    facts |= {"safety": _about_safety, "reach": _about_reach, "game": _about_game}[what](solution, game, role)
    facts["file"] = str(path)
    options.display.end()
    if options.json:
        print(json.dumps(facts))
    else:
        for name, value in facts.items():
            print(f"{name:<52} {value:.4g}" if isinstance(value, float) else f"{name:<52} {value}")
    if written:
        finish(*written, then=_next(options, path, role), json=options.json)
    return 0


def _drawing() -> "Callable[[Solution, Game, Path], None]":
    """What draws a solution; refused, before anything is solved, where what it needs is missing."""
    with plots():
        from apollonius.show.solution import save_solution_maps
    return save_solution_maps


def _next(options: argparse.Namespace, path: Path, role: "Role") -> str:
    """What to do with a table."""
    rules = chosen_rules(options)
    if options.what == "game":
        players = (path, "random") if role.name == "PURSUER" else ("random", path)
        return command("evaluate", *players, *rules, "--games", 100)
    if options.what == "reach":
        return command("regret", "P_stage1", *rules, "--games", 1000)
    return command("evaluate", "P_curriculum", "random", *rules, "--starts", "viable")


def _robot_problem(options: argparse.Namespace, game: "Game", role: "Role") -> "Problem":
    """The problem of one robot."""
    from apollonius.arenas.record import to_dict
    from apollonius.solve.store import Problem

    require(options.payoff is None, "--payoff", options.payoff, "left out but for game, where there is an opponent")
    grid, hold = requested_grid(options, game, role)
    return Problem(options.what, role.name.lower(), to_dict(game), list(grid.counts), hold, options.target)


def _game_problem(options: argparse.Namespace, game: "Game", role: "Role") -> "Problem":
    """The problem of both robots."""
    from apollonius.arenas.record import to_dict
    from apollonius.solve.reference import joint_grid
    from apollonius.solve.store import Problem

    grid, hold = requested_grid(options, game, role, joint_grid)
    payoff = options.payoff or "win"
    return Problem("game", role.name.lower(), to_dict(game), list(grid.counts), hold, payoff=payoff)


def _solve(problem: "Problem", game: "Game", role: "Role", display: "Display") -> "Solution":
    import jax.numpy as jnp

    from apollonius.solve.catalogue import contest_of
    from apollonius.solve.grid import make_grid
    from apollonius.solve.guarantee import make_duel, solve_duel
    from apollonius.solve.reach import make_chase, solve_reach
    from apollonius.solve.safety import solve_safety
    from apollonius.solve.store import Solution
    from apollonius.terminal import sweeps_on

    display.begin(f"solving {problem.kind} on {'x'.join(map(str, problem.counts))} nodes", compiles=True)
    report = sweeps_on(display)
    if problem.kind == "game":
        solved = solve_duel(make_duel(contest_of(problem, game)), report)
        return Solution(problem, solved.sweeps, solved.residual, solved.table.astype(jnp.float16))
    grid = make_grid(game.arena, (game.pursuer, game.evader)[role], tuple(problem.counts))
    if problem.target is None:
        solved = solve_safety(game, role, grid, problem.hold, report)
    else:
        x, y = problem.target
        _, solved = solve_reach(make_chase(game, grid, problem.hold), (x, y), report)
    return Solution(problem, solved.sweeps, solved.residual, solved.table)


def _about_safety(solution: "Solution", game: "Game", role: "Role") -> dict[str, Any]:
    """Which of the game's moving starts are lost: by the table, and by the manoeuvres that it steers."""
    from dataclasses import replace

    import jax
    import numpy as np

    from apollonius.agents.shield import BRAKING
    from apollonius.playout import draw_starts
    from apollonius.solve.grid import make_grid
    from apollonius.solve.safety import steered_brakes

    body = (game.pursuer, game.evader)[role]
    grid = make_grid(game.arena, body, tuple(solution.problem.counts))
    moving = replace(game, starts=replace(game.starts, speed="moving"))
    starts = draw_starts(moving, jax.random.key(0), STARTS)
    robots = (starts.pursuer, starts.evader)[role]
    if not body.brakes_to_rest:
        kept = jax.jit(jax.vmap(lambda robot: grid.interpolate(solution.table, robot)))(robots)
        return {"moving starts lost, by the table": float(np.mean(np.asarray(kept) < 0))}
    backup = steered_brakes(game, role, grid, solution.table)  # the shield's own manoeuvres come first
    judged = jax.jit(jax.vmap(lambda robot: (grid.interpolate(solution.table, robot), backup.rooms(robot))))(robots)
    kept, rooms = map(np.asarray, judged)
    return {
        "moving starts lost, by the table": float(np.mean(kept < 0)),
        "moving starts lost, if it brakes as the table steers": float(np.mean(rooms.max(axis=1) < 0)),
        "moving starts lost, if it brakes": float(np.mean(rooms[:, : len(BRAKING)].max(axis=1) < 0)),
    }


def _about_reach(solution: "Solution", game: "Game", role: "Role") -> dict[str, Any]:
    """How fast the target is caught from the game's starts."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    from apollonius.playout import draw_starts
    from apollonius.solve.grid import make_grid
    from apollonius.solve.motion import motion_of
    from apollonius.solve.reach import Reach

    assert solution.problem.target is not None
    x, y = (jnp.asarray(coordinate, jnp.float32) for coordinate in solution.problem.target)
    grid = make_grid(game.arena, game.pursuer, tuple(solution.problem.counts))
    reach = Reach(game, motion_of(game, role, solution.problem.hold), grid, x, y, solution.table)
    robots = draw_starts(game, jax.random.key(0), STARTS).pursuer
    seconds = np.asarray(jax.jit(jax.vmap(reach.seconds))(robots))
    caught = np.isfinite(seconds)
    return {
        "starts with a capture": float(np.mean(caught)),
        "median time to capture [s]": float(np.median(seconds)),
        "longest [s]": float(np.max(seconds[caught], initial=0.0)),
    }


def _about_game(solution: "Solution", game: "Game", role: "Role") -> dict[str, Any]:
    """What the side is sure of at the game's starts."""
    import jax
    import numpy as np

    from apollonius.playout import draw_starts
    from apollonius.solve.catalogue import contest_of
    from apollonius.solve.players import SaddlePolicy

    player = SaddlePolicy(contest_of(solution.problem, game), solution.table)
    starts = draw_starts(game, jax.random.key(0), STARTS)
    sure = np.asarray(player.best_worth(starts))
    return {
        "payoff": solution.problem.payoff,
        f"the {role.name.lower()} is sure of, on average over starts": float(np.mean(sure)),
        "at the best start": float(np.max(sure)),
        "at the worst": float(np.min(sure)),
    }
