"""The game solved from both sides, for a command that needs it before it can begin."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from apollonius.display import Display
    from apollonius.game.by_side import BySide
    from apollonius.game.game import Game
    from apollonius.game.types import Role
    from apollonius.solve.iteration import Sweep
    from apollonius.solve.players import SaddlePolicy

SOLVING = ("solving the game for the pursuer", "solving the game for the evader")
"""The pieces of work, for `Display.plan`."""


def solved_game(
    display: "Display", game: "Game", counts: Sequence[int] | None, folder: Path | None
) -> "BySide[SaddlePolicy]":
    """The players of both sides by the solved game, kept in a folder; arguments and errors as of `kept_tables`."""
    from apollonius.solve.kept import kept_tables
    from apollonius.terminal import sweeps_on

    shows: dict[Role, Callable[[Sweep], None]] = {}

    def report(role: "Role", sweep: "Sweep") -> None:
        if role not in shows:
            display.begin(SOLVING[role], compiles=True)
            shows[role] = sweeps_on(display)
        shows[role](sweep)

    display.begin(SOLVING[0], compiles=True)
    return kept_tables(game, counts, folder, report)
