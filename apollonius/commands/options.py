"""What several commands ask for: a game, players, matplotlib."""

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
    parser.add_argument("--starts", choices=("rest", "moving"), default="rest", help="initial speeds (default: rest)")
    parser.add_argument("--game", default="paper", help="name of the game, or its .toml file (default: %(default)s)")


def requested_game(options: argparse.Namespace) -> "Game":
    """The named game with the wanted starts."""
    from dataclasses import replace

    from apollonius.game.file import find_game

    game = find_game(options.game)
    return replace(game, starts=replace(game.starts, speed=options.starts))


@contextmanager
def plots() -> Iterator[None]:
    """What is imported here needs matplotlib, and says so where it is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != "matplotlib":
            raise
        raise InvalidInput("figures need matplotlib: pip install 'apollonius[plot]'.") from error
