"""The command line of `apollonius`: what can be asked, and how errors are told."""

import argparse
import os
import sys
from pathlib import Path
from typing import NoReturn

from apollonius import commands
from apollonius.errors import InvalidInput

STAGES = ("fixed-target", "self-play", "both")


class OneLineParser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Print the error and leave with status 2."""
        print(f"{self.prog}: {message}; see {self.prog} --help", file=sys.stderr)
        sys.exit(2)


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    options = build_parser().parse_args(arguments)
    try:
        return options.run(options)
    except InvalidInput as error:
        print(f"apollonius {options.command}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains once more at its exit
        return 1
    except OSError as error:
        where = f" '{error.filename}'" if error.filename else ""
        print(f"apollonius {options.command}: cannot use{where}: {error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return commands.INTERRUPTED


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command."""
    parser = OneLineParser(prog="apollonius", description="Learn, solve and play pursuit-evasion games.")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=OneLineParser)

    train = subparsers.add_parser("train", help="train a pursuer and an evader, then judge them")
    train.add_argument(
        "--preset", default="quick", help="length of training: quick (minutes, default), standard or paper"
    )
    train.add_argument("--stage", choices=STAGES, help="which stage to train (default: both)")
    train.add_argument("--profile", help="how to learn: fast (default) or paper (plain DQN as printed)")
    train.add_argument("--game", help="name of the game (default: paper)")
    train.add_argument("--seed", type=int, help="seed of everything random (default: 0)")
    train.add_argument("--config", type=Path, help="a config.toml to start from instead of a preset")
    train.add_argument("--pursuer", help="agent that the pursuer of a lone --stage goes on from (default: none)")
    train.add_argument(
        "--evader", nargs="+", help="players that the pursuer of --stage fixed-target learns to catch (default: still)"
    )
    train.add_argument("--out", type=Path, help="folder of the run (default: runs/PRESET-STAGE-SEED)")
    train.add_argument("--force", action="store_true", help="overwrite a run that is already there")
    train.set_defaults(run=commands.run_train)

    resume = subparsers.add_parser("resume", help="go on with a training run that was stopped")
    resume.add_argument("folder", type=Path, metavar="DIR", help="folder of the run")
    resume.set_defaults(run=commands.run_resume)

    evaluate = subparsers.add_parser("evaluate", help="play many games between two agents and count")
    agent_help = "a built-in player (random, still), a zoo agent, or a .safetensors file; shielded:NAME never crashes"
    evaluate.add_argument("pursuer", metavar="PURSUER", help=agent_help)
    evaluate.add_argument("evader", metavar="EVADER", help=agent_help)
    evaluate.add_argument("--games", type=int, default=1000, help="number of games (default: %(default)s)")
    evaluate.add_argument("--seed", type=int, default=0, help="seed of the starts (default: %(default)s)")
    evaluate.add_argument("--starts", choices=("rest", "moving"), default="rest", help="initial speeds (default: rest)")
    evaluate.add_argument("--game", default="paper", help="name of the game (default: %(default)s)")
    evaluate.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    evaluate.add_argument(
        "--record", type=int, default=0, metavar="K", help="write K games as replays, lost ones first"
    )
    evaluate.add_argument(
        "--replays", type=Path, default=Path("replays"), metavar="DIR", help="folder of the replays (default: replays)"
    )
    evaluate.set_defaults(run=commands.run_evaluate)

    show = subparsers.add_parser("show", help="a game as a picture or an animation, and as a replay file")
    show.add_argument("pursuer", metavar="PURSUER|REPLAY", help=f"{agent_help}; or a replay file alone")
    show.add_argument("evader", metavar="EVADER", nargs="?", help="the same, for the other side")
    show.add_argument("--seed", type=int, default=0, help="seed of the start (default: %(default)s)")
    show.add_argument("--starts", choices=("rest", "moving"), default="rest", help="initial speeds (default: rest)")
    show.add_argument("--game", default="paper", help="name of the game (default: %(default)s)")
    show.add_argument(
        "--out", type=Path, default=Path("game.gif"),
        help="file to write: .png, .gif, .webp, .mp4 or a replay's .json (default: %(default)s)",
    )  # fmt: skip
    show.set_defaults(run=commands.run_show)

    reproduce = subparsers.add_parser("reproduce", help="train, evaluate and draw all that the paper shows")
    reproduce.add_argument(
        "--budget", default="quick", help="length of each training: quick (default), standard or paper"
    )
    reproduce.add_argument("--seeds", type=int, default=1, help="number of seeds, from 0 (default: %(default)s)")
    reproduce.add_argument("--games", type=int, default=10_000, help="games in a match (default: %(default)s)")
    reproduce.add_argument("--out", type=Path, help="folder of the study (default: runs/reproduce-BUDGET)")
    reproduce.add_argument("--resume", action="store_true", help="go on with a study that was stopped")
    reproduce.set_defaults(run=commands.run_reproduce)

    bench = subparsers.add_parser("bench", help="measure speed on this machine")
    bench.add_argument("what", choices=("env", "train"), help="random play, or stage 1 training")
    bench.add_argument("--games", type=int, help="games at a time (default: 4096 for env, the profile's for train)")
    bench.add_argument(
        "--profile",
        default="classic",
        help="for train: classic (batch 128, an update every 4 env steps; default), fast or paper",
    )
    bench.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    bench.set_defaults(run=commands.run_bench)
    return parser
