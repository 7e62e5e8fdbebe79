"""Options of several commands, and their last lines about written files."""

import argparse
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.cli.terminal import varied_table
from apollonius.cli.values import (
    agent_of,
    existing_game,
    installed_extra,
    new_folder,
    require_writable,
    swept_number,
    whole_number,
)
from apollonius.io.document import to_json
from apollonius.io.errors import format_value, require
from apollonius.io.limits import GAME_FILES, GAMES, RECORDS, SEED, CountLimit
from apollonius.io.workers import WORKERS, JobRunner, run_jobs

if TYPE_CHECKING:
    from apollonius import Game, Match, NamedPlayer
    from apollonius.evaluate.match import MatchResult
    from apollonius.play.replay import Replay


AGENT = "a player's name or file; apollonius players lists them"
"""Help for an argument that names a player."""
REPLAYS = Path("replays")
"""Folder of replays unless another one is asked for."""
LENGTHS = ("quick", "standard", "paper")
"""Names of the presets of a training."""


def add_game(parser: argparse.ArgumentParser) -> None:
    about = (
        "name of the game, as office or team-3v1/office, or a .toml or .json file "
        "(default: %(default)s)"
    )
    parser.add_argument("--game", type=existing_game, default="paper", help=about)


def add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object and nothing else"
    )


def add_game_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seed",
        type=whole_number(SEED),
        default=0,
        help="seed of the starts (default: %(default)s)",
    )
    parser.add_argument(
        "--starts", choices=("rest", "moving"), help="initial speeds (default: as the game says)"
    )
    add_game(parser)


def add_workers(parser: argparse.ArgumentParser, of: str, default: str | None = None) -> None:
    about = (
        f"where {of} run: in processes of this machine, on slurm, or on ray "
        f"(default: {default or 'here'})"
    )
    parser.add_argument("--on", type=installed_extra, choices=WORKERS, default=default, help=about)


def jobs_run(options: argparse.Namespace, logs: Path | None = None) -> JobRunner | None:
    """Return the function that runs jobs on the workers of `--on`, or None without the option.

    On Slurm the jobs print to files in the folder `logs`.
    """
    return (
        partial(run_jobs, report=options.display.print_line, on=options.on, logs=logs)
        if options.on
        else None
    )


def chosen_rules(options: argparse.Namespace) -> list[str]:
    """Return the words that choose the game and its starts in another command, where they are not
    the defaults.
    """
    rules = {"game": options.game, "starts": getattr(options, "starts", None)}
    return [
        word
        for name, value in rules.items()
        if value not in ("paper", None)
        for word in (f"--{name}", value)
    ]


def add_match_options(parser: argparse.ArgumentParser, games: CountLimit = GAMES) -> None:
    """Add two players, their games and starts, and the output of their results."""
    parser.add_argument("pursuer", type=agent_of("pursuer"), metavar="PURSUER", help=AGENT)
    parser.add_argument("evader", type=agent_of("evader"), metavar="EVADER", help=AGENT)
    parser.add_argument(
        "--games",
        type=whole_number(games),
        default=1000,
        help="number of games (default: %(default)s)",
    )
    add_game_options(parser)
    add_json(parser)
    about = "write K games as replays, lost ones first"
    parser.add_argument("--record", type=whole_number(RECORDS), default=0, metavar="K", help=about)
    about = "folder of the replays (default: replays)"
    parser.add_argument("--replays", type=new_folder, default=REPLAYS, metavar="DIR", help=about)
    about = (
        "play a match for each value of a number of the game, as pursuer.v_max=0.8:1.6:5; "
        "twice for pairs"
    )
    parser.add_argument(
        "--vary",
        type=swept_number,
        action="append",
        default=[],
        metavar="FIELD=FROM:TO:COUNT",
        help=about,
    )


def require_replays(options: argparse.Namespace) -> None:
    """Refuse more replays than games, a folder of replays that cannot be written to, and one for
    none.
    """
    bound = f"from 0 to --games = {options.games}"
    require(options.record <= options.games, "--record", options.record, bound)
    if options.record:
        require_writable("--replays", options.replays)
    bound = "left out without --record, which says how many"
    is_needed = options.record or options.replays == REPLAYS
    require(is_needed, "--replays", options.replays, bound)


def requested_match(options: argparse.Namespace, in_one_arena: bool) -> "Match":
    """Make the match that the options describe, and warn about unusual choices; raises InvalidInput
    for an impossible one.
    """
    from apollonius.arenas.file import find_game, game_in_one_arena
    from apollonius.evaluate.match import Match

    game = (
        game_in_one_arena(options.game, options.command)
        if in_one_arena
        else find_game(options.game)
    )
    match = Match.of_names(
        game, options.pursuer, options.evader, options.games, options.seed, options.starts
    )
    warn(options, match.game, match.players)
    return match


def print_sweep(options: argparse.Namespace, play: "Callable[..., MatchResult]") -> int:
    """Play a match for each value of `--vary`, as `play_match` does, and print or draw how often
    the pursuer wins.
    """
    from apollonius.arenas.file import game_in_one_arena
    from apollonius.evaluate.vary import Variation, play_varied, varied_matches
    from apollonius.game.types import BySide

    require(
        options.record == 0,
        "--record",
        options.record,
        "left out with --vary, which keeps no games",
    )
    game, names = game_in_one_arena(options.game, "--vary"), BySide(options.pursuer, options.evader)
    variations = tuple(Variation(*variation) for variation in options.vary)
    matches = varied_matches(game, names, variations, options.games, options.seed, options.starts)
    options.display.begin_task("playing a match for each value")
    results = play_varied(matches, variations, options.display.report, play)
    print_result(
        options, match_facts(options, results.match) | results.to_dict(), varied_table(results)
    )
    if options.out:
        from apollonius.show.matches import draw_varied

        draw_varied(results, options.out)
        print_next_step(options, options.out)
    return 0


def warn(options: argparse.Namespace, game: "Game", players: "Iterable[NamedPlayer]" = ()) -> None:
    """Warn on standard error of unsound arenas and of players that have learned in another one.

    Games that ship with the package are sound, so only those of files are surveyed.
    """
    from apollonius.agents.trained import ANY, trained_elsewhere
    from apollonius.game.types import Role

    players_by_name = list({player.name: player for player in players}.values())
    for role in Role:
        elsewhere = [
            player.name
            for player in players_by_name
            if player.header
            and player.header.role == role.name.lower()
            and trained_elsewhere(player, game)
        ]
        if elsewhere:
            has = "has" if len(elsewhere) == 1 else "have"
            options.display.print_line(
                f"{', '.join(elsewhere)} {has} learned in another arena; {ANY[role]} plays in any"
            )
    if (
        game.scenario is not None
        or not options.game
        or not options.game.lower().endswith(GAME_FILES)
    ):
        return
    from apollonius.arenas.survey import map_notes, missed_passage, survey  # which load SciPy

    passages = (
        missed_passage(game) if any(player.policy.needs_chart for player in players_by_name) else []
    )
    for line in (*survey(game).wrong, *map_notes(game.arena), *passages):
        options.display.print_line(f"{options.game}: {line}")


def print_result(options: argparse.Namespace, facts: dict[str, Any], text: str) -> None:
    """Print a result, as one JSON object where that is asked for; the display shows no more."""
    options.display.stop()
    print(to_json(facts) if options.json else text)


def match_facts(options: argparse.Namespace, match: "Match") -> dict[str, Any]:
    names = {"pursuer": match.players.pursuer.name, "evader": match.players.evader.name}
    return names | {"game": options.game, "starts": match.game.starts.speed, "seed": match.seed}


def print_next_step(options: argparse.Namespace, *written: Path, then: str = "") -> None:
    """Print on standard error the written files and folders and, unless a program reads, the next
    sensible step; the display shows no more.
    """
    options.display.stop()
    lines = [f"wrote {format_value(path)} ({_size(path)})" for path in written]
    if then and not getattr(options, "json", False):
        lines.append(f"next: {then}")
    print(*lines, sep="\n", file=sys.stderr, flush=True)


def print_with_replays(
    options: argparse.Namespace,
    match: "Match",
    facts: dict[str, Any],
    text: str,
    kind: str,
    games: "Iterator[Replay]",
) -> int:
    """Write the first `options.record` games to files and print a match's result; return the exit
    status.

    Args:
        options: The command's options.
        match: The match.
        facts: The result as JSON-like data.
        text: The result in words.
        kind: Beginning of the files' names.
        games: The games in the order in which they are written.
    """
    from apollonius.play.replay import save_replay

    if options.record:
        options.display.begin_task(f"writing {options.record} replays")
    replay_files = list[Path]()
    for replay in islice(games, options.record):
        replay_files.append(
            options.replays / f"{kind}-{replay.index}-{replay.outcome.name.lower()}.json"
        )
        save_replay(replay, replay_files[-1])
    print_result(options, match_facts(options, match) | facts, text)
    if replay_files:
        then = shell_command("show", replay_files[0], "--out", replay_files[0].with_suffix(".gif"))
        print_next_step(options, options.replays, then=then)
    return 0


def shell_command(*words: object) -> str:
    """Return a command of this package as text for a shell."""
    return shlex.join(["apollonius", *map(str, words)])


def _size(path: Path) -> str:
    """Return the size of a file, or of all in a folder, in the unit that keeps it short."""
    files = [file for file in (path.rglob("*") if path.is_dir() else [path]) if file.is_file()]
    size = sum(file.stat().st_size for file in files)
    if size >= 10**6:
        return f"{size / 10**6:.1f} MB"
    return f"{size / 1000:.0f} kB" if size >= 1000 else f"{size} bytes"
