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
    parser.add_argument("--to-see", action="store_true", help="count those that are sure to see a hidden evader")
    add_json(parser)
    parser.set_defaults(run=run_pursuers)


def run_pursuers(options: argparse.Namespace) -> int:
    """Count and tell; exit status 1 where the graphs do not agree."""
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.arenas.free_space import free_space
    from apollonius.solve.enough import how_many
    from apollonius.solve.searchers import how_many_to_see

    display = options.display
    game = game_in_one_arena(options.game, "pursuers")
    warn(options, game)
    display.begin("looking where robots can be", compiles=True)
    space = free_space(game)

    def report(spacing: float) -> None:
        display.begin(f"solving the game on cells of {spacing:.2g} m")

    enough = how_many_to_see(game, space, report) if options.to_see else how_many(space, report)
    if not enough.readings:
        raise InvalidInput(f"'{options.game}' has too many obstacles to be solved on a graph; take a part of it.")
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
                "core": reading.core,
                "islands_seen": reading.tiling.holes,
                "pursuers": reading.pursuers,
                **({} if reading.places is None else {"turns": len(reading.places) - 1}),
            }
            for reading in enough.readings
        ],
        **({} if (places := enough.readings[-1].places) is None else {"strategy": places.round(2).tolist()}),
    }


def _text(facts: dict[str, Any], verdict: str) -> str:
    graphs = facts["graphs"]
    cells = [[f"{value:.2f}" if isinstance(value, float) else str(value) for value in one.values()] for one in graphs]
    how = "all moving at once, until the evader is seen" if "strategy" in facts else "turn by turn, seeing each other"
    lines = [
        f"{facts['arena']}: {verdict}",
        f"equally fast, without inertia, {how}; robots of the game may need more",
        *columns([[name.replace("_", " ") for name in graphs[0]], *cells]),
    ]
    if facts["parts"] > 1:
        lines.append(f"the free space falls into {facts['parts']} parts; this is about the largest")
    return "\n".join(lines)
