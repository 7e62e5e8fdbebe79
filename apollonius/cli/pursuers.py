"""`apollonius pursuers`: how many pursuers are enough in an arena, for idealised robots, and how one fewer fails."""

import argparse
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.cli.options import add_json, command, finish, warn
from apollonius.cli.values import known_game, new_file
from apollonius.io.document import to_json
from apollonius.io.errors import InvalidInput

if TYPE_CHECKING:
    from apollonius.arenas.free_space import Island
    from apollonius.solve.enough import Enough


def add_pursuers(subparsers: Any) -> None:
    parser = subparsers.add_parser("pursuers", help="how many pursuers are enough in an arena, and how one fewer fails")
    parser.add_argument("game", type=known_game, metavar="ARENA", help="the name of a game, or a .toml or .json file")
    parser.add_argument(
        "--out", type=new_file(".png"), metavar="PNG", help="draw where an evader runs that one fewer never catches"
    )
    add_json(parser)
    parser.set_defaults(run=run_pursuers)


def run_pursuers(options: argparse.Namespace) -> int:
    """Count, tell and draw; exit status 1 where the graphs do not agree."""
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.arenas.free_space import free_space
    from apollonius.solve.enough import MOST_NODES, how_many

    display = options.display
    game = game_in_one_arena(options.game, "pursuers")
    warn(options, game)
    display.begin("looking where robots can be", compiles=True)
    space, known = free_space(game), set[float]()

    def report(spacing: float, share: float) -> None:
        if spacing not in known:
            known.add(spacing)
            display.begin(f"solving the game on cells of {spacing:.2g} m")
        display.note({"caught from": f"{share:.1%} of all starts"})

    enough = how_many(space, report)
    display.end()
    if not enough.readings:
        raise InvalidInput(
            f"'{options.game}' has too many obstacles: the game on its graph would have more than {MOST_NODES:,} nodes "
            "that matter; take a part of it."
        )
    if options.json:
        print(to_json(_facts(options.game, enough)))
    else:
        print(_told(options.game, enough))
    if options.out:
        from apollonius.show.arena import save_evasion

        save_evasion(Path(options.game).stem, game, enough, options.out)
        then = command("show", "P_any", "E_any", "--game", options.game, "--out", options.out.with_suffix(".gif"))
        finish(options.out, then=then, json=options.json)
    return 0 if enough.agree else 1


def _facts(name: str, enough: "Enough") -> dict[str, Any]:
    facts: dict[str, Any] = {
        "arena": name,
        "pursuers": enough.pursuers,
        "agree": enough.agree,
        "parts": enough.space.parts,
        "islands": [_island(island) for island in enough.space.islands],
        "graphs": [
            {
                "spacing": reading.tiling.spacing,
                "turned_degrees": degrees(reading.tiling.angle),
                "nodes": len(reading.tiling.places),
                "core": len(reading.core),
                "islands_seen": reading.islands,
                "pursuers": reading.pursuers,
            }
            for reading in enough.readings
        ],
        "evasion": None,
    }
    if enough.evasion:
        facts["evasion"] = {
            "pursuers": enough.starts.tolist(),
            "run": enough.run.tolist(),
            "round": [_island(island) for island in enough.circled],
        }
    return facts


def _island(island: "Island") -> dict[str, Any]:
    return {"x": island.x, "y": island.y, "obstacles": island.obstacles}


def _told(name: str, enough: "Enough") -> str:
    lines = [
        f"{name}: {enough.verdict}",
        "equally fast, without inertia, turn by turn, seeing each other; robots of the game may need more",
        f"{'cells':>8}  {'turned':>6}  {'nodes':>6}  {'core':>6}  {'islands seen':>12}  enough",
    ]
    for reading in enough.readings:
        tiling, seen = reading.tiling, f"{reading.islands} of {len(enough.space.islands)}"
        lines.append(
            f"{tiling.spacing:>6.2f} m  {degrees(tiling.angle):>5.0f}°  {len(tiling.places):>6}  "
            f"{len(reading.core):>6}  {seen:>12}  {reading.pursuers:>6}"
        )
    if enough.unseen:
        small = "1 island is" if enough.unseen == 1 else f"{enough.unseen} islands are"
        lines.append(f"{small} smaller than these cells, and left out: who takes smaller steps runs round it too")
    if enough.space.parts > 1:
        lines.append(f"the free space falls into {enough.space.parts} parts; this is about the largest")
    if enough.evasion:
        few = len(enough.starts)
        who, catch = ("1 pursuer", "catches") if few == 1 else (f"{few} pursuers", "catch")
        starts, (start, *_) = ([_place(x, y) for x, y in places.tolist()] for places in (enough.starts, enough.run))
        lines.append(f"{who} at {' and '.join(starts)} never {catch} an evader that starts at {start}")
        round_ = "; ".join(f"{', '.join(one.obstacles)} at {_place(one.x, one.y)}" for one in enough.circled)
        lines.append(f"it runs {f'round {round_}' if round_ else 'to and fro'}")
    return "\n".join(lines)


def _place(x: float, y: float) -> str:
    return f"({x:.2f}, {y:.2f})"
