"""`apollonius solve`: ground truth by dynamic programming, kept as a file."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.commands.options import add_grid_options, requested_grid
from apollonius.errors import InvalidInput, require

if TYPE_CHECKING:
    from apollonius.game.game import Game
    from apollonius.game.types import Role
    from apollonius.solve.grid import Grid
    from apollonius.solve.store import Problem, Solution

STARTS = 20_000
"""Starts over which shares and times are taken."""


def add_solve(subparsers: Any) -> None:
    """The parser of `solve`."""
    parser = subparsers.add_parser("solve", help="solve for optimal play on a grid, and keep the table")
    parser.add_argument(
        "what", choices=("safety", "reach"),
        help="safety: whence a robot can avoid a crash for ever; reach: the least time to a standing target",
    )  # fmt: skip
    parser.add_argument("--game", default="paper", help="name of the game, or its .toml file (default: %(default)s)")
    parser.add_argument("--role", choices=("pursuer", "evader"), help="whose safety (default: pursuer)")
    parser.add_argument("--target", type=float, nargs=2, metavar=("X", "Y"), help="of reach: where it stands [m]")
    add_grid_options(parser)
    parser.add_argument(
        "--out", type=Path, help="file of the table; what it holds is not solved again (default: WHAT-GAME.npz)"
    )
    parser.add_argument("--force", action="store_true", help="overwrite a file that holds something else")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.set_defaults(run=run_solve)


def run_solve(options: argparse.Namespace) -> int:
    """Solve, or load what is solved already; say how good it is and what it means."""
    from apollonius.game.file import find_game
    from apollonius.game.record import to_dict
    from apollonius.game.types import Role
    from apollonius.solve.store import Problem, load_solution, save_solution

    game, reaching = find_game(options.game), options.what == "reach"
    given = options.target is not None
    require(given == reaching, "--target", options.target, "X Y for reach, and left out otherwise")
    require(not (reaching and options.role), "--role", options.role, "left out for reach, where the pursuer moves")
    role = Role[(options.role or "pursuer").upper()]
    grid, hold = requested_grid(options, game, role)
    problem = Problem(options.what, role.name.lower(), to_dict(game), list(grid.counts), hold, options.target)
    path: Path = options.out or Path(f"{options.what}-{Path(options.game).stem}.npz")
    if path.exists() and not options.force:
        solution = load_solution(path)
        if solution.problem != problem:
            raise InvalidInput(f"'{path}' holds the solution of another problem: give another --out, or --force.")
    else:
        solution = _solve(problem, game, role, grid)
        path.parent.mkdir(parents=True, exist_ok=True)
        save_solution(solution, path)
    facts = {
        "grid": "x".join(map(str, grid.counts)),
        "hold [s]": round(hold * float(game.dt), 6),
        "sweeps": solution.sweeps,
        "residual": solution.residual,
    }
    facts |= _about_reach(solution, game, grid) if reaching else _about_safety(solution, game, role, grid)
    facts["file"] = str(path)
    if options.json:
        print(json.dumps(facts))
    else:
        for name, value in facts.items():
            print(f"{name:<52} {value:.4g}" if isinstance(value, float) else f"{name:<52} {value}")
    return 0


def _solve(problem: "Problem", game: "Game", role: "Role", grid: "Grid") -> "Solution":
    from apollonius.solve.reach import make_chase, solve_reach
    from apollonius.solve.safety import solve_safety
    from apollonius.solve.store import Solution
    from apollonius.terminal import SweepDisplay

    report = SweepDisplay()
    if problem.target is None:
        solved = solve_safety(game, role, grid, problem.hold, report)
    else:
        x, y = problem.target
        _, solved = solve_reach(make_chase(game, grid, problem.hold), (x, y), report)
    return Solution(problem, solved.sweeps, solved.residual, solved.table)


def _about_safety(solution: "Solution", game: "Game", role: "Role", grid: "Grid") -> dict[str, Any]:
    """Which of the game's moving starts are lost: by the table, and by the manoeuvres that it steers."""
    from dataclasses import replace

    import jax
    import jax.numpy as jnp

    from apollonius.agents.shield import brakes
    from apollonius.game.game import reset_batch
    from apollonius.solve.safety import steered_brakes

    moving = replace(game, starts=replace(game.starts, speed="moving"))
    starts = jax.jit(reset_batch, static_argnames="games")(moving, jax.random.key(0), games=STARTS)
    robots = (starts.pursuer, starts.evader)[role]
    kept = jax.jit(jax.vmap(lambda robot: grid.interpolate(solution.table, robot)))(robots)
    facts = {"moving starts lost, by the table": float(jnp.mean(kept < 0))}
    body = (game.pursuer, game.evader)[role]
    if body.brakes_to_rest:
        ways = {"as the table steers": steered_brakes(game, role, grid, solution.table), "": brakes(game, role)}
        for how, backup in ways.items():
            lost = float(jnp.mean(jax.jit(jax.vmap(backup.room))(robots) < 0))
            facts[f"moving starts lost, if it brakes {how}".rstrip()] = lost
    return facts


def _about_reach(solution: "Solution", game: "Game", grid: "Grid") -> dict[str, Any]:
    """How fast the target is caught from the game's starts."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    from apollonius.game.game import reset_batch
    from apollonius.game.types import Role
    from apollonius.solve.motion import motion_of
    from apollonius.solve.reach import Reach

    assert solution.problem.target is not None
    x, y = (jnp.asarray(coordinate, jnp.float32) for coordinate in solution.problem.target)
    reach = Reach(game, motion_of(game, Role.PURSUER, solution.problem.hold), grid, x, y, solution.table)
    robots = jax.jit(reset_batch, static_argnames="games")(game, jax.random.key(0), games=STARTS).pursuer
    seconds = np.asarray(jax.jit(jax.vmap(reach.seconds))(robots))
    caught = np.isfinite(seconds)
    return {
        "starts with a capture": float(np.mean(caught)),
        "median time to capture [s]": float(np.median(seconds)),
        "longest [s]": float(np.max(seconds[caught], initial=0.0)),
    }
