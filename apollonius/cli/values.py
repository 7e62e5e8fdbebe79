"""Checks of values on the command line: a bad one is refused before anything is imported or
done.
"""

import argparse
import math
import re
import shutil
import tempfile
import tomllib
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from apollonius.agents.names import (
    BUILT_IN,
    FROM_ZOO,
    LISTED,
    agents_folders,
    bare_name,
    sides_of,
    zoo_names,
)
from apollonius.arenas.names import game_names, unknown_game
from apollonius.game.names import TEAM
from apollonius.io.errors import (
    EXTRAS,
    TRACKERS,
    closest_names,
    format_value,
    missing_extra,
    require,
    unknown_name,
)
from apollonius.io.extensions import PLAYERS, extension_names
from apollonius.io.limits import GAME_FILES, ONNX, SEED, TRAININGS, CountLimit

LARGEST = 1e6
"""Largest real number that is taken: places, speeds and angles of a game are smaller."""
_NEEDED = {".png": "plot", ".html": "plot"}
"""Extras without which files with these endings cannot be written."""
_FILES = (".safetensors", ".json", ".wasm")
"""Suffixes of the files of players and of replays."""
VALUES = CountLimit(0, most=100, least=2)
"""Values of a number that is varied."""
_NODES = re.compile(r"(\d{1,6})x(\d{1,6})x(\d{1,6})x(\d{1,6})", re.ASCII)


def value_error(text: str, bound: str) -> argparse.ArgumentTypeError:
    """Return the error of a value that is not possible; the parser puts the argument's name before
    it.
    """
    return argparse.ArgumentTypeError(
        f"= {format_value(text) or 'nothing'} is not possible: it must be {bound}."
    )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def whole_number(limits: CountLimit) -> Callable[[str], int]:
    """Return the reader of a whole number of something that is counted; 1e4 is one, too."""

    def read(text: str) -> int:
        number = _number(text)
        if not number.is_integer() or not limits.least <= number <= limits.limit:
            raise value_error(text, limits.bound())
        return int(number)

    return read


def real_number(text: str) -> float:
    """Return a finite number of modest size."""
    number = _number(text)
    if not abs(number) <= LARGEST:
        raise value_error(text, f"a number within {LARGEST:g} of 0")
    return number


def installed_extra(text: str) -> str:
    """Return the name of a tracker, or of the place where jobs run, unless what it needs is not
    installed.
    """
    extra_modules = ("track", TRACKERS[text]) if text in TRACKERS else (text,)
    remedy = missing_extra(*extra_modules) if extra_modules[0] in EXTRAS else None
    if remedy:
        raise value_error(text, f"another one where its library is not installed: {remedy}")
    if text == "slurm" and shutil.which("sbatch") is None:
        raise value_error(text, "processes where Slurm's sbatch is not on the PATH")
    return text


def seeds(text: str) -> tuple[int, ...]:
    """Return the seeds of a sweep, given as `0-9` or `0,3,7`."""
    all_seeds: dict[int, None] = {}
    for part in text.split(","):
        first, dash, last = part.partition("-")
        low, high = map(whole_number(SEED), (first, last if dash else first))
        if not low <= high < low + TRAININGS.most - len(all_seeds):
            raise value_error(text, f"seeds as 0-9 or 0,3,7, at most {TRAININGS.most:,}")
        all_seeds |= dict.fromkeys(range(low, high + 1))
    return tuple(all_seeds)


def swept_field(text: str) -> tuple[str, tuple[Any, ...]]:
    """Return a field of a training's config and its values, listed as
    `algorithm.batch=64,128`, or spaced as by `swept_number`.
    """
    field, equals, values_text = text.partition("=")
    if values_text.count(":") == 2:
        return field, tuple(
            int(value) if value.is_integer() else value for value in swept_number(text)[1]
        )
    if not (field.strip() and equals and values_text):
        raise value_error(
            text, "FIELD=VALUE,VALUE or FIELD=FROM:TO:COUNT, as algorithm.batch=64,128"
        )
    try:
        return field, tuple(tomllib.loads(f"values = [{values_text}]")["values"])
    except (ValueError, RecursionError):  # words without quotation marks
        return field, tuple(values_text.split(","))


def swept_number(text: str) -> tuple[str, tuple[float, ...]]:
    """Return a number of a game and evenly spaced values of it, given as
    `pursuer.v_max=0.8:1.6:5`.
    """
    field, equals, numbers = text.partition("=")
    ends = numbers.split(":")
    if not (field.strip() and equals and len(ends) == 3):
        raise value_error(text, "FIELD=FROM:TO:COUNT, as pursuer.v_max=0.8:1.6:5")
    low = real_number(ends[0])
    high = real_number(ends[1])
    steps = whole_number(VALUES)(ends[2]) - 1
    if low == high:
        raise value_error(text, "FIELD=FROM:TO:COUNT with different ends")
    values = (low * (1 - i / steps) + high * i / steps for i in range(steps + 1))
    return field, tuple(float(f"{value:.12g}") for value in values)


def nodes(text: str) -> tuple[int, ...]:
    """Return the nodes of a grid along x, y, v and heading, given as `101x101x9x47`."""
    match = _NODES.fullmatch(text)
    if not match:
        raise value_error(text, "the nodes along x, y, v, heading, as 101x101x9x47")
    return tuple(map(int, match.groups()))


def player_or_file(text: str) -> str:
    """Return a name or path."""
    if not text or not text.isprintable():
        raise value_error(text, "a name, or the path of a file")
    return text


def agent_or_model(text: str) -> str:
    """Return a player's name or file, or the file of an ONNX model."""
    return (
        str(existing_file(text))
        if player_or_file(text).lower().endswith(ONNX)
        else existing_agent(text)
    )


def agent_of(side: str) -> Callable[[str], str]:
    """Return the reader of a player of a side, which refuses those of the other one where their
    names tell.
    """
    return partial(existing_agent, side=side)


def existing_agent(text: str, side: str | None = None) -> str:
    """Return a player's name or file; one that nobody has is refused here, where JAX is not needed
    for it.
    """
    bare = bare_name(player_or_file(text))
    if bare.lower().endswith(_FILES):
        existing_file(bare)
    names = [*BUILT_IN, *zoo_names()]
    name = bare.removeprefix(FROM_ZOO)
    in_run = [*agents_in_run(bare), *agents_in_run(bare.rpartition("/")[0])]
    if name in names and side and side not in sides_of(name):
        raise argparse.ArgumentTypeError(
            f"'{text}' plays the {sides_of(name)[0]}, not the {side}: take another there."
        )
    if name in names or bare in in_run or _path_fact(Path(bare).is_file):
        return text
    extensions = extension_names(PLAYERS)
    if bare in extensions:
        return text
    names = [candidate for candidate in names if not side or side in sides_of(candidate)]
    suggestion = closest_names(bare, in_run or [*names, *extensions]) or next(iter(in_run), None)
    files = (
        "a .safetensors file, RUN/NAME for an agent of a training run, or PACKAGE:NAME for one "
        "of a package"
    )
    message = unknown_name("agent", bare, f"{LISTED}; or give {files}", suggestion)
    raise argparse.ArgumentTypeError(message)


def agents_in_run(run: str) -> list[str]:
    """Return the agents of a training run as RUN/NAME; none for what is no run."""
    folders = [folder for folder in agents_folders(run) if run and _path_fact(folder.is_dir)]
    return sorted(
        f"{run}/{file.stem}" for folder in folders for file in folder.glob("*.safetensors")
    )


def scenario_or_file(text: str) -> str:
    """Return a scenario's name, or its `.json` file."""
    is_file = player_or_file(text).lower().endswith(".json")
    return str(existing_file(text)) if is_file else text


def existing_game(text: str) -> str:
    """Return a game's name or file; one that nobody has is refused here, where JAX is not needed
    for it.
    """
    name = (
        player_or_file(text).split("/", 1)[-1]
        if TEAM.fullmatch(player_or_file(text).split("/")[0])
        else text
    )
    if name.lower().endswith(GAME_FILES):
        existing_file(name)
    elif "/" not in name and not TEAM.fullmatch(name) and name not in game_names():
        raise argparse.ArgumentTypeError(unknown_game(name))
    return text


def _path(is_fit: Callable[[Path], bool], kind: str) -> Callable[[str], Path]:
    """Return the reader of a path that fits, that of a kind of thing which is there."""

    def read(text: str) -> Path:
        path = Path(player_or_file(text))
        if not _path_fact(lambda: is_fit(path)):
            raise argparse.ArgumentTypeError(f"no such {kind}: '{format_value(text)}'")
        return path

    return read


existing_file = _path(Path.is_file, "file")
bag_folder = _path(Path.is_dir, "folder of a bag")
run_folder = _path(lambda path: (path / "config.toml").is_file(), "folder of a training run")
runs_folder = _path(
    lambda path: path.is_dir() and any(path.rglob("config.toml")), "folder of training runs"
)


def new_file(*suffixes: str, needs: Mapping[str, str] = _NEEDED) -> Callable[[str], Path]:
    """Return the reader of a file to write with one of these suffixes; `needs` has the extras that
    some take.
    """

    def read(text: str) -> Path:
        path = Path(player_or_file(text))
        if path.suffix not in suffixes:
            kinds = f"one of {', '.join(suffixes)}" if len(suffixes) > 1 else "".join(suffixes)
            raise value_error(text, f"a file that ends in {kinds}")
        if _path_fact(path.exists) and not _path_fact(path.is_file):
            raise value_error(text, "a file, and something else has that name; choose another")
        reason = _unwritable(path, path.parent)
        if reason:
            raise value_error(text, reason)
        remedy = missing_extra(needs[path.suffix]) if path.suffix in needs else None
        if remedy:
            raise value_error(text, f"of another kind where libraries are not installed: {remedy}")
        return path

    return read


def new_folder(text: str) -> Path:
    """Return a folder to write to, new or not, in a place where that can be done."""
    path = Path(player_or_file(text))
    if _path_fact(path.exists) and not _path_fact(path.is_dir):
        raise value_error(text, "a folder, and something else has that name; choose another")
    reason = _unwritable(path, path)
    if reason:
        raise value_error(text, reason)
    return path


def require_writable(name: str, path: Path) -> None:
    """Refuse a folder, new or not, that is an argument's default and cannot be written to; raises
    InvalidInput.
    """
    reason = _unwritable(path, path)
    require(reason is None, name, path, reason or "")


def _path_fact(question: Callable[[], bool]) -> bool:
    """Return the answer of a path about itself; False for one that cannot be."""
    try:
        return question()
    except (OSError, ValueError):
        return False


def _unwritable(path: Path, folder: Path) -> str | None:
    """Return the bound that a path breaks if its folder, or the nearest one above, takes no files;
    else None.
    """
    try:
        with suppress(FileNotFoundError, NotADirectoryError):
            # which says of some paths that they cannot be, as of those that are too long
            path.lstat()
        while not _path_fact(folder.exists) and folder != folder.parent:
            folder = folder.parent
        # one that has no name, or none for long: nothing is left behind
        with tempfile.TemporaryFile(dir=folder):
            return None
    except OSError as error:
        reason = error.strerror or error
        return (
            f"in a folder that can be written to ('{format_value(folder)}': {reason}); "
            "choose another"
        )
