"""`apollonius solve` and `pursuers`: ground truth by dynamic programming, and how many pursuers are
enough.
"""

import argparse
from collections.abc import Sequence
from functools import partial
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.agents.names import SIDES
from apollonius.cli.options import add_game, add_json, print_next_step, print_result, warn
from apollonius.cli.terminal import columns, show_sweep
from apollonius.cli.values import (
    existing_file,
    existing_game,
    new_file,
    nodes,
    real_number,
    require_writable,
    whole_number,
)
from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import HOLD

if TYPE_CHECKING:
    from apollonius import BySide, Game, Role
    from apollonius.cli.display import Display
    from apollonius.solve.cop_number import CopNumber
    from apollonius.solve.grid import Sweep
    from apollonius.solve.players import SaddlePolicy
    from apollonius.solve.store import Problem


SOLVING = ("solving the game for the pursuer", "solving the game for the evader")
"""Pieces of work, by role."""


def solved_game(
    display: "Display", game: "Game", counts: Sequence[int] | None, folder: Path | None
) -> "BySide[SaddlePolicy]":
    """Solve a game, or load its tables; return both sides' players.

    Args:
        display: Display of the progress.
        game: The game.
        counts: Nodes of the grid along x, y, v and heading; a coarse grid for None.
        folder: Folder of the tables; None stores nothing.

    Raises:
        InvalidInput: As `cached_tables`.
    """
    from apollonius.solve.solving import cached_tables

    def report(role: "Role", sweep: "Sweep") -> None:
        if sweep.number == 1:
            display.begin_task(SOLVING[role])
        show_sweep(display, sweep)

    display.begin_task(SOLVING[0])
    return cached_tables(game, counts, folder, report)


def add_table_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say by which tables to play."""
    solved = parser.add_mutually_exclusive_group()
    solved.add_argument(
        "--tables",
        type=existing_file,
        nargs=2,
        metavar="FILE",
        help="the game solved from both sides",
    )
    solved.add_argument(
        "--grid", type=nodes, help="nodes of the grid to solve it on (default: a coarse one)"
    )


def requested_tables(options: argparse.Namespace, game: "Game") -> "BySide[SaddlePolicy]":
    """Return the players by the solved game: from files, or solved here and kept in the cache."""
    from apollonius import BySide, Role
    from apollonius.io.cache import cache_folder
    from apollonius.solve.solving import FEW_PAIRS, joint_grid, table_player

    if options.tables:
        options.display.begin_task(SOLVING[0])
        players = [table_player(path, game) for path in options.tables]
        sides = {player.zero_sum_game.role: player for player in players}
        require(
            len(sides) == 2,
            "--tables",
            " ".join(map(str, options.tables)),
            "a pursuer's and an evader's",
        )
        return BySide(sides[Role.PURSUER], sides[Role.EVADER])
    counts = options.grid or joint_grid(game, Role.PURSUER, FEW_PAIRS)[0].counts
    return solved_game(options.display, game, counts, cache_folder("tables"))


def add_solve(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "what",
        choices=("safety", "reach", "game"),
        help="safety: from where a robot can avoid a crash forever; "
        "reach: the least time to a standing target; "
        "game: the payoff that the grid promises a side against any opponent",
    )
    add_game(parser)
    parser.add_argument(
        "--role", choices=SIDES, help="of safety and game: which side (default: pursuer)"
    )
    parser.add_argument(
        "--whole-cells",
        action="store_true",
        help="of game: robots move by whole cells along x and y",
    )
    parser.add_argument(
        "--target",
        type=real_number,
        nargs=2,
        metavar=("X", "Y"),
        help="of reach: where it stands [m]",
    )
    parser.add_argument(
        "--grid", type=nodes, help="nodes along x, y, v and heading (default: about 0.2 m apart)"
    )
    parser.add_argument(
        "--hold",
        type=whole_number(HOLD),
        help="steps for which an action is held (default: about 0.5 s)",
    )
    about = "file of the table; what it holds is not solved again (default: WHAT-GAME.safetensors)"
    parser.add_argument("--out", type=new_file(".safetensors"), help=about)
    parser.add_argument(
        "--force", action="store_true", help="overwrite a file that holds something else"
    )
    add_json(parser)
    parser.set_defaults(run=run_solve)


def run_solve(options: argparse.Namespace) -> int:
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.evaluate.solved import describe_solution
    from apollonius.solve.solving import solve_problem
    from apollonius.solve.store import load_solution, save_solution

    game, display = game_in_one_arena(options.game, "solve"), options.display
    problem = _requested_problem(options, game)
    warn(options, game)
    path: Path = options.out or Path(f"{problem.kind}-{Path(options.game).stem}.safetensors")
    require_writable("--out", path.parent)
    is_new = options.force or not path.exists()
    if not is_new:
        solution = load_solution(path)
        if solution.problem != problem:
            raise InvalidInput(
                f"'{path}' holds the solution of another problem: give another --out, or --force."
            )
    else:
        display.begin_task(f"solving {problem.kind} on {'x'.join(map(str, problem.counts))} nodes")
        solution = solve_problem(problem, game, partial(show_sweep, display))
        save_solution(solution, path)
    display.begin_task("judging the table")
    facts = describe_solution(solution, game) | {"file": str(path)}
    texts = {
        name: f"{value:.4g}" if isinstance(value, float) else value for name, value in facts.items()
    }
    print_result(options, facts, "\n".join(f"{name:<52} {value}" for name, value in texts.items()))
    if is_new:
        print_next_step(options, path)
    return 0


def _requested_problem(options: argparse.Namespace, game: "Game") -> "Problem":
    from apollonius import Role, reference_grid
    from apollonius.arenas.file import to_dict
    from apollonius.solve.grid import make_grid
    from apollonius.solve.solving import joint_grid
    from apollonius.solve.store import Problem

    what, target = options.what, options.target
    require(
        (target is not None) == (what == "reach"),
        "--target",
        target,
        "X Y for reach, and left out otherwise",
    )
    has_role = not (what == "reach" and options.role)
    require(has_role, "--role", options.role, "left out for reach, where the pursuer moves")
    role = Role[(options.role or "pursuer").upper()]
    grid, hold = (joint_grid if what == "game" else reference_grid)(game, role)
    counts, hold = options.grid or grid.counts, options.hold or hold
    make_grid(game.arena, game.body(role), counts)  # refused here, before anything is solved
    return Problem(
        what, role.name.lower(), to_dict(game), list(counts), hold, target, options.whole_cells
    )


def add_pursuers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "game",
        type=existing_game,
        metavar="ARENA",
        help="the name of a game, or a .toml or .json file",
    )
    parser.add_argument(
        "--to-see", action="store_true", help="count those that are sure to see a hidden evader"
    )
    add_json(parser)
    parser.set_defaults(run=run_pursuers)


def run_pursuers(options: argparse.Namespace) -> int:
    """Count and tell; exit status 1 where the graphs do not agree."""
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.arenas.free_space import free_space
    from apollonius.solve.cop_number import find_cop_number
    from apollonius.solve.search_number import find_search_number

    display = options.display
    game = game_in_one_arena(options.game, "pursuers")
    warn(options, game)
    display.begin_task("looking where robots can be")
    space = free_space(game)

    def report(spacing: float) -> None:
        display.begin_task(f"solving the game on cells of {spacing:.2g} m")

    result = (
        find_search_number(game, space, report)
        if options.to_see
        else find_cop_number(space, report)
    )
    if not result.graph_results:
        raise InvalidInput(
            f"'{options.game}' has too many obstacles to be solved on a graph; take a part of it."
        )
    facts = _facts(options.game, result)
    print_result(options, facts, _text(facts, result.verdict))
    return 0 if result.agree else 1


def _facts(name: str, result: "CopNumber") -> dict[str, Any]:
    places = result.graph_results[-1].places
    return {
        "arena": name,
        "pursuers": result.pursuers,
        "agree": result.agree,
        "parts": result.space.parts,
        "islands": result.space.islands,
        "graphs": [
            {
                "spacing": reading.tiling.spacing,
                "turned_degrees": degrees(reading.tiling.angle),
                "nodes": len(reading.tiling.places),
                "core": reading.core,
                "islands_seen": reading.tiling.holes,
                "pursuers": reading.pursuers,
                **({} if reading.places is None else {"turns": len(reading.places) - 1}),
            }
            for reading in result.graph_results
        ],
        **({} if places is None else {"strategy": places.round(2).tolist()}),
    }


def _text(facts: dict[str, Any], verdict: str) -> str:
    graphs = facts["graphs"]
    cells = [
        [f"{value:.2f}" if isinstance(value, float) else str(value) for value in graph.values()]
        for graph in graphs
    ]
    how = (
        "all moving at once, until the evader is seen"
        if "strategy" in facts
        else "turn by turn, seeing each other"
    )
    lines = [
        f"{facts['arena']}: {verdict}",
        f"equally fast, without inertia, {how}; robots of the game may need more",
        *columns([[name.replace("_", " ") for name in graphs[0]], *cells]),
    ]
    if facts["parts"] > 1:
        lines.append(f"the free space falls into {facts['parts']} parts; this is about the largest")
    return "\n".join(lines)
