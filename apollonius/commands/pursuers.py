"""`apollonius pursuers`: how many pursuers are enough in an arena, for idealised robots, and how one fewer fails.

Beside it stands how often teams of each size catch an evader there with the game's own robots, if games are asked for.
"""

import argparse
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.commands.ending import command, finish
from apollonius.commands.options import AGENT, warn
from apollonius.commands.values import count, known_agent, known_game, new_file
from apollonius.document import to_json
from apollonius.errors import InvalidInput
from apollonius.limits import GAMES, ROBOTS, SEED

if TYPE_CHECKING:
    from apollonius.arenas.free_space import Island
    from apollonius.evaluate.team_sizes import Matches, TeamSizes
    from apollonius.game.game import Game
    from apollonius.solve.enough import Enough

_TEAMS = tuple(f"shielded:{name}" for name in ("P_team", "encirclement", "voronoi-pursuit", "pure-pursuit"))
"""Who plays the pursuers: a learned team, two classical ones that know their mates, and one that does not."""
_PLAYED = {"teams": _TEAMS, "evader": "shielded:E_any", "most": 4, "seed": 0}
"""What is about the games that are played, and its defaults."""


def add_pursuers(subparsers: Any) -> None:
    """The parser of `pursuers`."""
    parser = subparsers.add_parser("pursuers", help="how many pursuers are enough in an arena, and how one fewer fails")
    parser.add_argument("game", type=known_game, metavar="ARENA", help="the name of a game, or a .toml or .json file")
    parser.add_argument(
        "--out", type=new_file(".png"), metavar="PNG", help="draw where an evader runs that one fewer never catches"
    )
    parser.add_argument("--games", type=count(GAMES), help="also play so many games with each team (default: none)")
    parser.add_argument(
        "--teams", type=known_agent, nargs="+", metavar="PURSUER",
        help=f"who plays all pursuers of a team (default: {' '.join(_TEAMS)})",
    )  # fmt: skip
    parser.add_argument("--evader", type=known_agent, help=f"{AGENT} (default: %(default)s)")
    parser.add_argument("--most", type=count(ROBOTS), help="pursuers of the largest team (default: %(default)s)")
    parser.add_argument("--seed", type=count(SEED), help="seed of the starts (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.set_defaults(run=run_pursuers, **_PLAYED)


def run_pursuers(options: argparse.Namespace) -> int:
    """Count, tell and draw; exit status 1 where the graphs do not agree."""
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.arenas.free_space import free_space
    from apollonius.solve.enough import MOST_NODES, how_many
    from apollonius.terminal import sizes_table

    display = options.display
    if not options.games:
        for name, default in _PLAYED.items():
            if getattr(options, name) != default:
                raise InvalidInput(f"--{name} is about games and needs --games: say how many to play with each team.")
    game = game_in_one_arena(options.game, "pursuers")
    matches = _matches(options, game) if options.games else None
    warn(
        options,
        game,
        [player for sizes in (matches or {}).values() for one in sizes.values() for player in one.players],
    )
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
    sizes = _played(options, matches) if matches else None
    if options.json:
        print(to_json(_facts(options.game, enough) | {"played": sizes and sizes.to_dict()}))
    else:
        print(_told(options.game, enough), *([sizes_table(sizes)] if sizes else []), sep="\n\n")
    if options.out:
        from apollonius.show.pursuers import save_evasion

        save_evasion(Path(options.game).stem, game, enough, options.out, sizes)
        then = command("show", "P_any", "E_any", "--game", options.game, "--out", options.out.with_suffix(".gif"))
        finish(options.out, then=then, json=options.json)
    return 0 if enough.agree else 1


def _matches(options: argparse.Namespace, game: "Game") -> "Matches":
    """What is to be played; whom there is not is refused before anything is solved."""
    from apollonius.evaluate.team_sizes import matches_of_sizes

    options.display.begin("making teams of every size", compiles=True)
    return matches_of_sizes(game, options.teams, options.evader, options.most, options.games, options.seed)


def _played(options: argparse.Namespace, matches: "Matches") -> "TeamSizes":
    """Teams of every size against the evader, with the game's own robots."""
    from apollonius.evaluate.team_sizes import play_sizes

    options.display.begin("playing teams of every size", compiles=True)
    sizes = play_sizes(options.evader, matches, options.display.report)
    options.display.end()
    return sizes


def _facts(name: str, enough: "Enough") -> dict[str, Any]:
    """All that was solved, for a program."""
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
    """The same in lines."""
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
