"""`apollonius arena` and `players`: list, check and draw arenas, and list who can play in them."""

import argparse
from pathlib import Path
from typing import Any

from apollonius.agents.names import BUILT_IN, SIDES, sides_of, zoo_names
from apollonius.arenas.names import KINDS
from apollonius.cli.options import add_json, print_next_step, print_result, shell_command
from apollonius.cli.terminal import advice_table
from apollonius.cli.values import existing_game, new_file, real_number, whole_number
from apollonius.io.errors import require
from apollonius.io.extensions import PLAYERS, extension_names
from apollonius.io.limits import GAME_FILES, SEED

GAMES = 40
"""Games of each match of `check --players`."""


def add_arena(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    list_parser = actions.add_parser("list", help="list the games that ship with the package")
    list_parser.set_defaults(run=run_list, compiles=False)
    about = "report what is wrong with a game's arena, and draw it"
    _add_check(actions.add_parser("check", help=about))
    about = "write a game in a random arena in which every robot can go everywhere"
    _add_random(actions.add_parser("random", help=about))


def _add_check(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "game",
        type=existing_game,
        metavar="GAME",
        help="a .toml or .json file, or the name of a game",
    )
    parser.add_argument(
        "--out",
        type=new_file(".png", ".json"),
        metavar="FILE",
        help="write a picture of what was found (.png), or the game as the page reads it "
        "(.json, a new file)",
    )
    parser.add_argument(
        "--players",
        action="store_true",
        help=f"play {GAMES} games of each match between rules and agents: who does best here, "
        "and where it stops",
    )
    add_json(parser)
    parser.set_defaults(run=run_check)


def _add_random(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--kind", choices=KINDS, default="discs", help="of obstacles (default: %(default)s)"
    )
    parser.add_argument(
        "--seed",
        type=whole_number(SEED),
        default=0,
        help="seed of the arena (default: %(default)s)",
    )
    parser.add_argument(
        "--gap",
        type=real_number,
        default=1.0,
        help="least width of all passages [m] (default: %(default)s)",
    )
    parser.add_argument(
        "--size",
        type=real_number,
        nargs=2,
        default=(10.0, 10.0),
        metavar=("WIDTH", "HEIGHT"),
        help="[m]",
    )
    about = "whose other rules it has (default: paper)"
    parser.add_argument("--game", type=existing_game, default="paper", help=about)
    files = new_file(*GAME_FILES)
    about = "a .toml or .json file"
    parser.add_argument("--out", type=files, required=True, metavar="FILE", help=about)
    about = "overwrite a file that is already there"
    parser.add_argument("--force", action="store_true", help=about)
    parser.set_defaults(run=run_random)


def run_list(options: argparse.Namespace) -> int:
    from apollonius.arenas.file import describe_game, game_names

    for name in game_names():
        print(f"{name:<12} {describe_game(name)}")
    return 0


def run_check(options: argparse.Namespace) -> int:
    """Survey the arena; exit status 1 where something is wrong with it."""
    from apollonius.arenas.file import game_in_one_arena, save_game, to_dict
    from apollonius.arenas.survey import missed_passage, survey

    out: Path | None = options.out
    writes_game = out is not None and out.suffix == ".json"
    require(
        not (writes_game and options.out.exists()), "--out", out, "a new file; choose another name"
    )
    game = game_in_one_arena(options.game, "arena check")
    options.display.begin_task("surveying the arena")
    findings = survey(game)
    notes = [*findings.notes, *missed_passage(game)]
    lines = [*(f"wrong: {line}" for line in findings.wrong), *(f"note: {line}" for line in notes)]
    verdict = [] if findings.wrong else [f"{options.game}: nothing is wrong with this arena"]
    data: dict[str, Any] = {"game": options.game, "wrong": findings.wrong, "notes": notes}
    if options.players:
        from apollonius.evaluate.tournament import advise

        options.display.begin_task("playing the players against each other")
        advice = advise(game, GAMES, report=options.display.report)
        data["players"] = advice.to_dict()
        verdict.append(advice_table(advice))
    print_result(options, data, "\n".join([*lines, *verdict]))
    if out and writes_game:
        save_game(to_dict(game), out)
        print_next_step(options, out, then=shell_command("play", "--game", out))
    elif out:
        from apollonius.show.arena import save_plan

        save_plan(Path(options.game).stem, game, findings, out)
        again = shell_command("arena", "check", options.game, "--out", out)
        watch = shell_command(
            "show", "pursuer", "evader", "--game", options.game, "--out", out.with_suffix(".gif")
        )
        print_next_step(options, out, then=f"mend it, then {again}" if findings.wrong else watch)
    return 1 if findings.wrong else 0


def run_random(options: argparse.Namespace) -> int:
    """Write a game like another, in an arena drawn at random."""
    from apollonius.arenas.file import find_game, save_game, to_dict
    from apollonius.arenas.map_file import save_map
    from apollonius.arenas.random_arena import with_random_arena

    cells = (
        [options.out.with_suffix(suffix) for suffix in (".yaml", ".pgm")]
        if options.kind == "caves"
        else []
    )
    for path in (options.out, *cells):
        require(
            options.force or not path.exists(), "--out", path, "a new file; --force overwrites it"
        )
    random_game = with_random_arena(
        find_game(options.game), options.kind, options.seed, options.gap, tuple(options.size)
    )
    record = to_dict(random_game)
    contents = f"{len(random_game.arena.discs) + len(random_game.arena.polygons)} obstacles"
    if random_game.arena.map:
        save_map(random_game.arena.map, cells[0])
        record["arena"]["map"] = cells[0].name
        counts = (str(nodes - 1) for nodes in reversed(random_game.arena.map.field.shape))
        contents = f"a map of {' x '.join(counts)} cells"
    save_game(record, options.out)
    print(f"{options.kind}, {contents}, passages of {options.gap:g} m and more")
    print_next_step(
        options,
        options.out,
        then=shell_command("arena", "check", options.out, "--out", options.out.with_suffix(".png")),
    )
    return 0


ZOO = {
    "pursuer": "learned in 416 arenas, plays in any, alone or in a team",
    "P_smooth": "steers without steps",
    "P_curriculum": "of the paper: self-play after P_stage1",
    "P_scratch": "of the paper: self-play alone",
    "P_random": "of the paper: learned from a random evader",
    "P_stage1": "of the paper: standing targets only",
    "evader": "learned in 416 arenas, plays in any",
    "E_smooth": "steers without steps",
    "E_curriculum": "of the paper: self-play after P_stage1",
    "E_scratch": "of the paper: self-play alone",
}
"""Agents that ship with the package, in a few words."""
OTHERS = {
    "RUN/NAME": "an agent of a training run, by the run's folder or its name among runs",
    "FILE.safetensors": "an agent's file, or a game that solve solved",
    "shielded:NAME": (
        "any of these behind a shield: it never crashes, by the rules, where it starts at rest"
    ),
    "identifying:NAME": (
        "any of these, also shielded, that learns its robot's drive and limits while it drives"
    ),
    "PACKAGE:NAME": "a player of an installed package",
    "searching:NAME": (
        "a pursuer of limited sight that searches while it does not see the evader; after shielded:"
    ),
    "flanking:NAME": "a pursuer of a team that goes round to the evader's other side",
}


def add_players(parser: argparse.ArgumentParser) -> None:
    add_json(parser)
    parser.set_defaults(run=run_players, compiles=False)


def run_players(options: argparse.Namespace) -> int:
    words = {name: about for name, (_, about) in BUILT_IN.items()} | {
        name: ZOO.get(name, "") for name in zoo_names()
    }
    lines = []
    for sides in (SIDES[:1], SIDES[1:], SIDES):
        lines += [
            f"{' or '.join(sides)}:",
            *_rows({name: words[name] for name in words if sides_of(name) == sides}),
        ]
    extensions = dict.fromkeys(extension_names(PLAYERS), "")
    words |= extensions
    lines += ["of other packages:", *_rows(extensions)] if extensions else []
    lines += ["your own:", *_rows(OTHERS), "more about each: docs/reference/agents.md"]
    facts = [
        {"name": name, "sides": sides_of(name), "about": about} for name, about in words.items()
    ]
    print_result(options, {"players": facts, "forms": OTHERS}, "\n".join(lines))
    return 0


def _rows(players: dict[str, str]) -> list[str]:
    return [f"  {name:<18}{about}" for name, about in players.items()]
