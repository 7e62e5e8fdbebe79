"""What several commands ask for: a game, players, what draws."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from apollonius.errors import InvalidInput

if TYPE_CHECKING:
    from apollonius.game.game import Game

AGENT = (
    "a built-in player (random, still, potential-field; pursuers: pure-pursuit, proportional-navigation, intercept; "
    "evaders: flee, flee-aware, circle), a zoo agent, or a .safetensors file; shielded:NAME never crashes"
)
"""Help for an argument that names a player."""
INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells use it."""


def add_game_options(parser: argparse.ArgumentParser) -> None:
    """Options that choose the game and its start."""
    parser.add_argument("--seed", type=int, default=0, help="seed of the starts (default: %(default)s)")
    parser.add_argument(
        "--starts", choices=("rest", "moving", "viable"), default="rest",
        help="initial speeds: rest (default), moving, or moving but for starts that are lost before they begin",
    )  # fmt: skip
    parser.add_argument("--game", default="paper", help="name of the game, or its .toml file (default: %(default)s)")


def requested_game(options: argparse.Namespace) -> "Game":
    """The named game with the wanted starts; `viable` ones are drawn from `moving` by who plays."""
    from dataclasses import replace

    from apollonius.game.file import find_game

    game = find_game(options.game)
    return replace(game, starts=replace(game.starts, speed="rest" if options.starts == "rest" else "moving"))


@contextmanager
def plots() -> Iterator[None]:
    """What is imported here needs what draws and writes pages, and says so where it is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name not in ("matplotlib", "jinja2", "markupsafe", "markdown_it"):
            raise
        raise InvalidInput(f"this needs {error.name}: pip install 'apollonius[plot]'.") from error
