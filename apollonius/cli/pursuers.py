"""`apollonius pursuers`: how many pursuers are enough in an arena, for idealised robots."""

import argparse
from math import degrees
from typing import TYPE_CHECKING, Any

from apollonius.cli.options import add_json, answer, warn
from apollonius.cli.terminal import columns
from apollonius.cli.values import known_game
from apollonius.io.errors import InvalidInput

if TYPE_CHECKING:
    from apollonius.solve.enough import Enough


def add_pursuers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("game", type=known_game, metavar="ARENA", help="the name of a game, or a .toml or .json file")
    add_json(parser)
    parser.set_defaults(run=run_pursuers)


def run_pursuers(options: argparse.Namespace) -> int:
    """Count and tell; exit status 1 where the graphs do not agree."""
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.arenas.free_space import free_space
    from apollonius.solve.enough import MOST_NODES, how_many

    display = options.display
    game = game_in_one_arena(options.game, "pursuers")
    warn(options, game)
    display.begin("looking where robots can be", compiles=True)
    enough = how_many(free_space(game), lambda spacing: display.begin(f"solving the game on cells of {spacing:.2g} m"))
    if not enough.readings:
        raise InvalidInput(
            f"'{options.game}' has too many obstacles: the game on its graph would have more than {MOST_NODES:,} nodes "
            "that matter; take a part of it."
        )
    facts = _facts(options.game, enough)
    answer(options, facts, _text(facts, enough.verdict))
    return 0 if enough.agree else 1


def _facts(name: str, enough: "Enough") -> dict[str, Any]:
    return {
        "arena": name,
        "pursuers": enough.pursuers,
        "agree": enough.agree,
        "parts": enough.space.parts,
        "islands": enough.space.islands,
        "graphs": [
            {
                "spacing": reading.tiling.spacing,
                "turned_degrees": degrees(reading.tiling.angle),
                "nodes": len(reading.tiling.places),
                "core": len(reading.core),
                "islands_seen": reading.tiling.holes,
                "pursuers": reading.pursuers,
            }
            for reading in enough.readings
        ],
    }


def _text(facts: dict[str, Any], verdict: str) -> str:
    graphs = facts["graphs"]
    cells = [[f"{value:.2f}" if isinstance(value, float) else str(value) for value in one.values()] for one in graphs]
    lines = [
        f"{facts['arena']}: {verdict}",
        "equally fast, without inertia, turn by turn, seeing each other; robots of the game may need more",
        *columns([[name.replace("_", " ") for name in graphs[0]], *cells]),
    ]
    if facts["parts"] > 1:
        lines.append(f"the free space falls into {facts['parts']} parts; this is about the largest")
    return "\n".join(lines)
