"""The command line of `apollonius`: its commands and its error messages."""

import argparse
import errno
import os
import sys
from typing import Any, NoReturn

from apollonius.cli.arena import add_arena
from apollonius.cli.evaluate import add_evaluate
from apollonius.cli.exploit import add_exploit
from apollonius.cli.export import add_export
from apollonius.cli.play import add_play
from apollonius.cli.pursuers import add_pursuers
from apollonius.cli.regret import add_regret
from apollonius.cli.report import add_report
from apollonius.cli.reproduce import add_reproduce
from apollonius.cli.show import add_show
from apollonius.cli.simulate import add_simulate
from apollonius.cli.slice import add_slice
from apollonius.cli.solve import add_solve
from apollonius.cli.tournament import add_tournament
from apollonius.cli.train import add_resume, add_train
from apollonius.io.cache import keep_compilations
from apollonius.io.errors import LONGEST_MESSAGE, InvalidInput, nearest, shown
from apollonius.io.interrupts import INTERRUPTED, status, stopped
from apollonius.version import __version__

COMMANDS = {
    "Learn": (add_train, add_resume),
    "Judge": (add_evaluate, add_tournament, add_exploit, add_simulate),
    "Solve": (add_solve, add_regret, add_pursuers),
    "Watch and play": (add_show, add_play, add_slice, add_report),
    "Arenas and robots of your own": (add_arena, add_export),
    "The paper": (add_reproduce,),
}
"""By purpose, in the order of the help."""


class OneLineParser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is no choice of an argument, and name the nearest choice."""
        known = [str(choice) for choice in action.choices or ()]
        if action.choices is not None and value not in action.choices and (near := nearest(str(value), known)):
            raise argparse.ArgumentError(action, f"= {shown(value)} is not possible: did you mean '{near}'?")
        super()._check_value(action, value)  # pyright: ignore[reportAttributeAccessIssue]

    def error(self, message: str) -> NoReturn:
        words = message.removeprefix("argument ").replace(": = ", " = ", 1).removesuffix(".")  # `values.unfit` has "= "
        print(f"{self.prog}: {shown(words, LONGEST_MESSAGE)}; see {self.prog} --help", file=sys.stderr)
        sys.exit(2)


def main(arguments: list[str] | None = None) -> int:
    """Run the command with these arguments, or those of the process, and return its exit status."""
    parser, given = build_parser(), sys.argv[1:] if arguments is None else arguments
    if not given:
        parser.print_help()
        return 0
    options = parser.parse_args(given)
    from apollonius.cli.display import Display  # which draws, and --help need not wait for that

    try:
        with Display(options.command) as options.display:
            keep_compilations()
            return options.run(options)
    except InvalidInput as error:
        print(f"apollonius {options.command}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains once more at its exit
        return 1
    except RuntimeError as error:
        if "Unable to initialize backend" not in str(error):
            raise
        wish = shown(os.environ.get("JAX_PLATFORMS", ""))
        message = f"JAX_PLATFORMS = {wish} is not possible: it must be a kind of device that is here; unset it"
        print(f"apollonius {options.command}: {message}", file=sys.stderr)
        return 2
    except OSError as error:
        where = f" '{shown(error.filename)}'" if error.filename else ""
        how = stopped().removeprefix("stopped").removeprefix("; ") or "give the same command again"
        full = f"; make room on the disk, then {how}" if error.errno == errno.ENOSPC else ""
        print(f"apollonius {options.command}: cannot use{where}: {error.strerror or error}{full}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(stopped(), file=sys.stderr, flush=True)
        return status() or INTERRUPTED


def build_parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog="apollonius",
        usage="apollonius COMMAND ...",
        description="Learn, solve and play pursuit-evasion games between mobile robots among obstacles.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"apollonius {__version__}", help="say it and leave")
    subparsers = parser.add_subparsers(
        dest="command", required=True, prog="apollonius", metavar="COMMAND", help=argparse.SUPPRESS,
        parser_class=OneLineParser,
    )  # fmt: skip
    groups = []
    for purpose, commands in COMMANDS.items():
        group = _Group(subparsers)
        for add in commands:
            add(group)
        groups.append("\n".join([f"{purpose}:", *group.lines]))
    parser.epilog = "\n\n".join([*groups, "apollonius COMMAND --help says more. To begin with: apollonius play"])
    return parser


class _Group:
    """Commands of one purpose, with a line each in the help of the whole, which also heads their own help."""

    def __init__(self, subparsers: Any) -> None:
        self._subparsers = subparsers
        self.lines: list[str] = []

    def add_parser(self, name: str, help: str) -> argparse.ArgumentParser:
        """Return a parser for a command, with a line about its purpose."""
        self.lines.append(f"  {name:<12}{help}")
        return self._subparsers.add_parser(name, description=f"{help[0].upper()}{help[1:]}.")
