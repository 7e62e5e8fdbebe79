"""The game solved from both sides, for a command that needs it before it can begin."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from apollonius.commands.values import existing_file, nodes
from apollonius.errors import require

if TYPE_CHECKING:
    from apollonius.display import Display
    from apollonius.game.by_side import BySide
    from apollonius.game.game import Game
    from apollonius.game.types import Role
    from apollonius.solve.grid import Sweep
    from apollonius.solve.players import SaddlePolicy

SOLVING = ("solving the game for the pursuer", "solving the game for the evader")
"""The pieces of work, for `Display.plan`."""


def solved_game(
    display: "Display", game: "Game", counts: Sequence[int] | None, folder: Path | None
) -> "BySide[SaddlePolicy]":
    """The players of both sides by the solved game, kept in a folder; arguments and errors as of `kept_tables`."""
    from apollonius.solve.solving import kept_tables
    from apollonius.terminal import sweeps_on

    shows: dict[Role, Callable[[Sweep], None]] = {}

    def report(role: "Role", sweep: "Sweep") -> None:
        if role not in shows:
            display.begin(SOLVING[role], compiles=True)
            shows[role] = sweeps_on(display)
        shows[role](sweep)

    display.begin(SOLVING[0], compiles=True)
    return kept_tables(game, counts, folder, report)


def add_table_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say by which tables to play."""
    solved = parser.add_mutually_exclusive_group()
    solved.add_argument(
        "--tables", type=existing_file, nargs=2, metavar="FILE", help="the solved game from both sides (solve game)"
    )
    solved.add_argument(
        "--grid", type=nodes, help="nodes on which it is solved otherwise, and kept (default: a coarse grid)"
    )


def requested_tables(options: argparse.Namespace, game: "Game") -> "BySide[SaddlePolicy]":
    """Return the players by the solved game: from files, or solved here and kept in the cache."""
    from apollonius.cache import cache_folder
    from apollonius.game.by_side import BySide
    from apollonius.game.types import Role
    from apollonius.solve.solving import FEW_PAIRS, joint_grid, table_player

    if options.tables:
        options.display.begin(SOLVING[0], compiles=True)
        players = [table_player(path, game) for path in options.tables]
        sides = {player.zero_sum_game.role: player for player in players}
        require(len(sides) == 2, "--tables", " ".join(map(str, options.tables)), "a pursuer's and an evader's")
        return BySide(sides[Role.PURSUER], sides[Role.EVADER])
    counts = options.grid or joint_grid(game, Role.PURSUER, FEW_PAIRS)[0].counts
    return solved_game(options.display, game, counts, cache_folder("tables"))
