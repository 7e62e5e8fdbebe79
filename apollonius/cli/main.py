"""The command line of `apollonius`: its commands and its error messages."""

import argparse
import errno
import os
import re
import sys
from collections.abc import Iterable, Mapping
from io import TextIOWrapper
from typing import Any, NoReturn

from apollonius.cli.arena import add_arena, add_players
from apollonius.cli.exploit import add_exploit, add_regret
from apollonius.cli.export import add_export, add_replay
from apollonius.cli.identify import add_identify
from apollonius.cli.judge import add_evaluate, add_simulate, add_suite, add_tournament
from apollonius.cli.runs import add_reproduce, add_runs, add_track
from apollonius.cli.show import add_play, add_report, add_show, add_slice
from apollonius.cli.solve import add_pursuers, add_solve
from apollonius.cli.train import add_resume, add_train
from apollonius.io.cache import keep_compilations
from apollonius.io.compiling import watch_compilations
from apollonius.io.errors import (
    LONGEST_MESSAGE,
    InvalidInput,
    closest_names,
    format_value,
    unknown_name,
)
from apollonius.io.interrupts import INTERRUPTED, interrupt_status, stop_message
from apollonius.version import __version__

_ODD_SETTING = re.compile("for JAX flag|for environment 'JAX")
"""Words with which JAX refuses the value of an environment variable."""
COMMANDS = {
    "Learn": {
        "train": (
            add_train,
            "train a pursuer and an evader, then judge them",
            "--preset standard --out runs/mine",
        ),
        "resume": (add_resume, "resume training runs that were stopped", "runs/mine"),
        "track": (
            add_track,
            "send a run's metrics to TensorBoard, W&B, MLflow or trackio",
            "runs/mine --to wandb",
        ),
        "runs": (
            add_runs,
            "list training runs: state, share done, last evaluation, machine",
            "runs/sweep",
        ),
    },
    "Judge": {
        "evaluate": (
            add_evaluate,
            "play many games between two agents and count",
            "pursuer E_scratch --games 1000",
        ),
        "tournament": (add_tournament, "play every pursuer against every evader", "--games 1000"),
        "exploit": (add_exploit, "attack an agent with opponents that know it", "evader E_scratch"),
        "suite": (
            add_suite,
            "judge an agent by the benchmark, or check a card",
            "judge pursuer --out pursuer.json",
        ),
        "simulate": (
            add_simulate,
            "play games between robots with bodies, in MuJoCo",
            "pursuer random --games 300",
        ),
    },
    "Solve": {
        "solve": (add_solve, "solve for optimal play on a grid, and keep the table", "safety"),
        "regret": (add_regret, "how far an agent falls short of the solved game", "P_curriculum"),
        "pursuers": (add_pursuers, "how many pursuers are enough in an arena", "office"),
    },
    "Watch and play": {
        "show": (
            add_show,
            "a game as a picture or an animation, and as a replay file",
            "pursuer evader --game office",
        ),
        "players": (add_players, "list all players and what they do", ""),
        "play": (add_play, "play in a browser against a trained agent", "--as pursuer"),
        "slice": (
            add_slice,
            "an agent's action values and actions over the arena",
            "P_curriculum --opponent 5 5",
        ),
        "report": (add_report, "a training run as one HTML page, games included", "runs/mine"),
    },
    "Arenas and robots of your own": {
        "arena": (
            add_arena,
            "list arenas, check one of your own, or draw a random one",
            "check office --out a.png",
        ),
        "export": (
            add_export,
            "write a player as C or ONNX, which need no JAX",
            "pursuer --to c --out player.c",
        ),
        "replay": (
            add_replay,
            "compare a robot's recorded actions with its agent's",
            "--bag bags/pursuer-1",
        ),
        "identify": (
            add_identify,
            "measure a robot's limits, delays and noise in a recorded drive",
            "--bag bags/drive --out robot.toml",
        ),
    },
    "The paper": {
        "reproduce": (
            add_reproduce,
            "train, evaluate and draw everything in the paper",
            "--budget quick",
        )
    },
}
"""By purpose, in the order of the help: each adds its arguments, says what it does, and has an
example.
"""


def _are_commands(choices: Iterable[Any]) -> bool:
    """Check whether the choices of an argument are commands, each of which has a parser."""
    has_values = isinstance(choices, Mapping)
    return has_values and all(isinstance(each, OneLineParser) for each in choices.values())


class OneLineParser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is no choice of an argument, and name the nearest choice."""
        if action.choices is not None and value not in action.choices:
            choices = [*map(str, action.choices)]
            if _are_commands(action.choices):
                argument = None
                kind = "command"
                remedy = f"see {self.prog} --help"
            else:
                argument = action
                kind = "choice"
                remedy = f"choose one of {', '.join(choices)}"
            message = unknown_name(kind, str(value), remedy, closest_names(str(value), choices))
            raise argparse.ArgumentError(argument, message)

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, args: Any = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        """Refuse unknown arguments here, where the command is known whose help says more."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return options, unknown

    def error(self, message: str) -> NoReturn:
        # `values.value_error` has "= "
        words = message.removeprefix("argument ").replace(": = ", " = ", 1).removesuffix(".")
        more = "" if words.endswith(("?", "--help")) else f"; see {self.prog} --help"
        print(f"{self.prog}: {format_value(words, LONGEST_MESSAGE)}{more}", file=sys.stderr)
        sys.exit(2)


def main(arguments: list[str] | None = None) -> int:
    """Run the command with these arguments, or those of the process, and return its exit status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # and not None, as of a process without them
            stream.reconfigure(errors="replace")  # of signs that a terminal does not have, as ±
    parser = build_parser()
    words = sys.argv[1:] if arguments is None else arguments
    if not words:
        parser.print_help()
        return 0
    options = parser.parse_args(words)
    from apollonius.cli.display import Display  # which draws, and --help need not wait for that

    try:
        with Display(options.command) as options.display:
            if getattr(options, "compiles", True):
                keep_compilations()  # which imports JAX
                watch_compilations()
            return options.run(options)
    except InvalidInput as error:
        message = str(error)
    except BrokenPipeError:
        # or Python complains once more at its exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        message = _file_message(error)
    except (RuntimeError, ValueError) as error:
        message = _jax_message(error)
        if message is None:
            raise
    except KeyboardInterrupt:
        print(stop_message(), file=sys.stderr, flush=True)
        return interrupt_status() or INTERRUPTED
    print(f"apollonius {options.command}: {message}", file=sys.stderr)
    return 2


def _file_message(error: OSError) -> str:
    """Say which file cannot be used, and what to do on a full disk."""
    where = f" '{format_value(error.filename)}'" if error.filename else ""
    hint = stop_message().removeprefix("stopped").removeprefix("; ")
    remedy = f"; make room on the disk, then {hint or 'give the same command again'}"
    full = remedy if error.errno == errno.ENOSPC else ""
    return f"cannot use{where}: {error.strerror or error}{full}"


def _jax_message(error: Exception) -> str | None:
    """Say which of JAX's settings is wrong; return None for any other error."""
    if "Unable to initialize backend" in str(error):
        wish = format_value(os.environ.get("JAX_PLATFORMS", ""))
        bound = "it must be a kind of device that is here; unset it"
        return f"JAX_PLATFORMS = {wish} is not possible: {bound}"
    if _ODD_SETTING.search(str(error)):
        remedy = "correct the environment variable, or unset it"
        return f"JAX does not begin ({format_value(error)}): {remedy}"
    return None


def build_parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog="apollonius",
        usage="apollonius COMMAND ...",
        description="Learn, solve and play pursuit-evasion games between mobile robots "
        "among obstacles.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"apollonius {__version__}")
    subparsers = parser.add_subparsers(
        dest="command",
        required=True,
        prog="apollonius",
        metavar="COMMAND",
        help=argparse.SUPPRESS,
        parser_class=OneLineParser,
    )
    groups = []
    for purpose, commands in COMMANDS.items():
        groups.append(
            "\n".join(
                [f"{purpose}:", *(f"  {name:<12}{does}" for name, (_, does, _) in commands.items())]
            )
        )
        for name, (add, does, example) in commands.items():
            description = f"{does[0].upper()}{does[1:]}."
            add(
                subparsers.add_parser(
                    name, description=description, epilog=f"Example: apollonius {name} {example}"
                )
            )
    parser.epilog = "\n\n".join(
        [*groups, "apollonius COMMAND --help says more. To begin with: apollonius play"]
    )
    return parser
