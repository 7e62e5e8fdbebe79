"""`apollonius solve`: ground truth by dynamic programming, kept as a file."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.commands.options import (
    add_game,
    add_grid_options,
    add_json,
    chosen_rules,
    command,
    finish,
    requested_grid,
    warn,
)
from apollonius.commands.values import new_file, real, require_writable
from apollonius.document import to_json
from apollonius.errors import InvalidInput, require

if TYPE_CHECKING:
    from apollonius.game.game import Game
    from apollonius.solve.store import Problem


def add_solve(subparsers: Any) -> None:
    parser = subparsers.add_parser("solve", help="solve for optimal play on a grid, and keep the table")
    parser.add_argument(
        "what", choices=("safety", "reach", "game"),
        help="safety: whence a robot can avoid a crash for ever; reach: the least time to a standing target; "
        "game: an estimate of the payoff that a side is sure of against any opponent",
    )  # fmt: skip
    add_game(parser)
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
        type=new_file(".safetensors"),
        help="file of the table; what it holds is not solved again (default: WHAT-GAME.safetensors)",
    )
    parser.add_argument(
        "--plot", type=new_file(".png"), metavar="FILE", help="draw what was solved as .png: two maps of the arena"
    )
    parser.add_argument("--force", action="store_true", help="overwrite a file that holds something else")
    add_json(parser)
    parser.set_defaults(run=run_solve)


def run_solve(options: argparse.Namespace) -> int:
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.evaluate.solution import about
    from apollonius.solve.solving import solve_problem
    from apollonius.solve.store import load_solution, save_solution
    from apollonius.terminal import sweeps_on

    game, display = game_in_one_arena(options.game, "solve"), options.display
    problem = _requested_problem(options, game)
    warn(options, game)
    path: Path = options.out or Path(f"{problem.kind}-{Path(options.game).stem}.safetensors")
    require_writable("--out", path.parent)
    written: list[Path] = []
    if path.exists() and not options.force:
        solution = load_solution(path)
        if solution.problem != problem:
            raise InvalidInput(f"'{path}' holds the solution of another problem: give another --out, or --force.")
    else:
        display.begin(f"solving {problem.kind} on {'x'.join(map(str, problem.counts))} nodes", compiles=True)
        solution = solve_problem(problem, game, sweeps_on(display))
        save_solution(solution, path)
        written.append(path)
    if options.plot:
        from apollonius.show.solution import save_solution_maps

        save_solution_maps(solution, game, options.plot)
        written.append(options.plot)
    display.begin("judging the table", compiles=True)
    facts = about(solution, game) | {"file": str(path)}
    display.end()
    if options.json:
        print(to_json(facts))
    else:
        for name, value in facts.items():
            print(f"{name:<52} {value:.4g}" if isinstance(value, float) else f"{name:<52} {value}")
    if written:
        finish(*written, then=_next(options, path, problem.role), json=options.json)
    return 0


def _requested_problem(options: argparse.Namespace, game: "Game") -> "Problem":
    from apollonius.arenas.record import to_dict
    from apollonius.game.types import Role
    from apollonius.solve.solving import joint_grid, reference_grid
    from apollonius.solve.store import Problem

    what, target, payoff = options.what, options.target, options.payoff
    require((target is not None) == (what == "reach"), "--target", target, "X Y for reach, and left out otherwise")
    alone = not (what == "reach" and options.role)
    require(alone, "--role", options.role, "left out for reach, where the pursuer moves")
    bound = "left out but for game, where there is an opponent"
    require(payoff is None or what == "game", "--payoff", payoff, bound)
    role = Role[(options.role or "pursuer").upper()]
    grid, hold = requested_grid(options, game, role, joint_grid if what == "game" else reference_grid)
    payoff = payoff or "win" if what == "game" else None
    return Problem(what, role.name.lower(), to_dict(game), list(grid.counts), hold, target, payoff)


def _next(options: argparse.Namespace, path: Path, role: str) -> str:
    rules = chosen_rules(options)
    if options.what == "game":
        players = (path, "random") if role == "pursuer" else ("random", path)
        return command("evaluate", *players, *rules, "--games", 100)
    if options.what == "reach":
        return command("evaluate", "P_stage1", "still", *rules, "--games", 1000)
    return command("evaluate", "P_curriculum", "random", *rules, "--starts", "viable")
