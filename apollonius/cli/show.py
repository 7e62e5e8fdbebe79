"""`apollonius show` and `report`: one game as a picture, an animation or a replay file; a training run as a page."""

import argparse
from pathlib import Path

from apollonius.cli.options import AGENT, add_game_options, chosen_rules, command, finish, requested_match
from apollonius.cli.values import agent_of, new_file, real, run_folder
from apollonius.io.errors import require, require_extra

MOVING = (".gif", ".webp", ".mp4")
"""Formats of moving pictures."""


def add_show(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "pursuer", type=agent_of("pursuer"), metavar="PURSUER|REPLAY", help=f"{AGENT}; or a replay file alone"
    )
    parser.add_argument("evader", type=agent_of("evader"), metavar="EVADER", nargs="?", help="the other side's player")
    add_game_options(parser)
    parser.add_argument(
        "--out", type=new_file(*MOVING, ".png", ".json", needs={".mp4": "video"}), default="game.gif",
        help="file to write: .png, .gif, .webp, .mp4 or a replay's .json (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--speed", type=real, help="seconds of the game in one of a moving picture (default: 1, real time)"
    )
    parser.set_defaults(run=run_show, games=1)


def run_show(options: argparse.Namespace) -> int:
    from apollonius.play.replay import load_replay, save_replay
    from apollonius.show import animation

    if options.speed is not None:
        moving = f"left out, as only {', '.join(MOVING)} move"
        require(options.out.suffix in MOVING, "--speed", options.speed, moving)
        possible = f"from {animation.SLOWEST:g} to {animation.FASTEST:g} times real time"
        require(animation.SLOWEST <= options.speed <= animation.FASTEST, "--speed", options.speed, possible)
    display = options.display
    display.begin("playing one game", compiles=True)
    if options.evader is None:
        replay = load_replay(Path(options.pursuer))
        first = replay.first_difference()
        if first is not None:
            display.tell(f"played again, this game differs from step {first} on")
        starts = replay.game.starts.speed
    else:
        from apollonius.evaluate.match import record_game

        match = requested_match(options, in_one_arena=True)
        replay, starts = record_game(match, 0), match.starts_played
    display.begin(f"drawing {len(replay.states)} states")
    if options.out.suffix == ".json":
        save_replay(replay, options.out)
    else:
        animation.save_animation(replay, options.out, options.speed or 1.0)
    display.end()
    print(
        f"{replay.pursuer} against {replay.evader}: {replay.ending()} ({len(replay.actions)} steps, starts: {starts})"
    )
    if options.out.suffix == ".json":
        then = command("show", options.out, "--out", options.out.with_suffix(".gif"))
    elif options.evader is None:
        then = command("play")
    else:
        then = command("evaluate", options.pursuer, options.evader, *chosen_rules(options), "--games", 1000)
    finish(options.out, then=then)
    return 0


def add_report(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=run_folder, metavar="RUN", help="folder of a training run")
    parser.add_argument("--out", type=new_file(".html"), help="file to write, .html (default: RUN/report.html)")
    parser.set_defaults(run=run_report)


def run_report(options: argparse.Namespace) -> int:
    folder: Path = options.folder
    out: Path = options.out or folder / "report.html"
    require_extra("plot", "report")
    from apollonius.show.report import report_of, save_report

    options.display.begin("playing games and drawing", compiles=True)
    save_report(report_of(folder), out)
    options.display.end()
    finish(out, then=f"open {out} in a browser")
    return 0
