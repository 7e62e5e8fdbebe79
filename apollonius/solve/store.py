"""Solutions as files: the table, compressed, and a header that says what was solved and how well."""

import io
import json
import struct
import tokenize
import warnings
import zipfile
import zlib
from dataclasses import asdict, dataclass
from math import inf, prod
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Shaped

from apollonius.arenas.record import from_dict
from apollonius.arrays import MOST_HEADER, require_finite
from apollonius.document import parse_json, write_atomically
from apollonius.errors import InvalidInput, require, shown
from apollonius.game.validation import MAX_SIZE
from apollonius.limits import HOLD, JOINT_HOLD, MOST_COUNTED, require_memory
from apollonius.solve.grid import FEWER_NODES
from apollonius.solve.zero_sum_game import PAYOFFS

FORMAT = "apollonius-solution"
FORMAT_VERSION = 1
KINDS = ("safety", "reach", "game")
"""What can be solved."""
_MOST_NODES = 1_000_000
_DAMAGE = (
    ValueError, KeyError, TypeError, EOFError, OSError, RuntimeError, NotImplementedError, OverflowError, MemoryError,
    SyntaxError, RecursionError, struct.error, tokenize.TokenError, zlib.error, zipfile.BadZipFile, Warning,
)  # fmt: skip
"""What a damaged archive raises when it is read."""


@dataclass(frozen=True)
class Problem:
    """What is solved: two solutions of one problem are the same."""

    kind: str
    """`safety`, `reach` or `game`."""
    role: str
    """The side whose robot it is, or that moves first: `pursuer` or `evader`."""
    game: dict[str, Any]
    """The game, number by number."""
    counts: list[int]
    """Nodes along x, y, v and heading."""
    hold: int
    """Control steps for which an action is held."""
    target: list[float] | None = None
    """Where the target stands [m]; of `reach` only."""
    payoff: str | None = None
    """What outcomes are worth (`zero_sum_game.PAYOFFS`); of `game` only."""

    def __post_init__(self) -> None:
        require(self.kind in KINDS, "kind", self.kind, f"one of {', '.join(KINDS)}")
        require(self.role in ("pursuer", "evader"), "role", self.role, "pursuer or evader")
        four = len(self.counts) == 4 and min(self.counts) >= 2 and max(self.counts) <= _MOST_NODES
        require(four, "counts", self.counts, f"four numbers of nodes, from 2 to {_MOST_NODES:,}")
        (JOINT_HOLD if self.kind == "game" else HOLD).require("hold", self.hold)
        target = self.target is not None
        require(target == (self.kind == "reach"), "target", self.target, "given for reach, and left out otherwise")
        place = [abs(number) <= MAX_SIZE for number in self.target or ()]
        require(not target or place == [True, True], "target", self.target, "x and y")
        payoffs = tuple(PAYOFFS) if self.kind == "game" else (None,)
        require(self.payoff in payoffs, "payoff", self.payoff, f"one of {', '.join(map(str, payoffs))}")


@dataclass(frozen=True)
class Solution:
    """A solved problem."""

    problem: Problem
    sweeps: int
    residual: float
    """Largest change of a value in the last sweep."""
    table: Shaped[Array, "..."]
    """Values at the nodes, by (v, heading, x, y); of `game` what `solve_duel` returns, in half precision."""


def save_solution(solution: Solution, path: Path) -> None:
    """Write a solution's file, atomically.

    Raises:
        OSError: when the file cannot be written.
    """
    header = {"format": FORMAT, "version": FORMAT_VERSION, "problem": asdict(solution.problem)}
    header |= {"sweeps": solution.sweeps, "residual": solution.residual}
    content = io.BytesIO()
    np.savez_compressed(content, header=np.array(json.dumps(header)), table=np.asarray(solution.table))
    write_atomically(path, content.getvalue())


def load_solution(path: Path) -> Solution:
    """Read a solution's file: its header first, and no more of the table than the header says there is.

    Raises:
        InvalidInput: for a file that is missing, damaged, not a solution's, of another version, too large for this
            machine's memory, or with values that are not finite.
    """
    if not path.is_file():
        raise InvalidInput(f"there is no solution '{path}': check the path, or solve it with apollonius solve.")
    foreign = f"'{path}' holds no whole Apollonius solution: solve it again, into another file"
    try:
        with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
            fields = parse_json(_text(archive), foreign)
            version = fields.get("version")
            if fields.get("format") != FORMAT:
                raise InvalidInput(f"{foreign}.")
            if version != FORMAT_VERSION:
                told = f"'{path}' has format version {shown(version)}, this program reads {FORMAT_VERSION}: update it."
                raise InvalidInput(told)
            header = from_dict(_Header, fields, f"the header of '{path}'")
            table = _table(archive, header.problem, path)
    except _DAMAGE as error:
        if isinstance(error, InvalidInput):
            raise
        raise InvalidInput(f"{foreign} ({shown(error)}).") from error
    require_finite(path, {"table": table}, "solve it again")
    return Solution(header.problem, header.sweeps, header.residual, jnp.asarray(table))


@dataclass(frozen=True)
class _Header:
    """What a solution's file says about it."""

    format: str
    version: int
    problem: Problem
    sweeps: int
    residual: float

    def __post_init__(self) -> None:
        require(0 <= self.sweeps <= MOST_COUNTED, "sweeps", self.sweeps, "0 or more")
        require(0 <= self.residual < inf, "residual", self.residual, "0 or more, and finite")


def _text(archive: zipfile.ZipFile) -> str:
    """The header, a text in an array of NumPy's."""
    with _entry(archive, "header.npy", MOST_HEADER) as file:
        shape, kind = _array_kind(file)
        if shape != () or kind.kind != "U" or kind.itemsize > MOST_HEADER:
            raise ValueError("its header is no text")
        return str(np.frombuffer(file.read(kind.itemsize), kind)[0])


def _table(archive: zipfile.ZipFile, problem: Problem, path: Path) -> np.ndarray:
    """The table, of the kind and size that the problem asks for."""
    x, y, v, heading = problem.counts
    expected = np.dtype(np.float16 if problem.kind == "game" else np.float32)
    size = (x * y * v * heading) ** (2 if problem.kind == "game" else 1)
    require_memory(f"'{path}': grid", "x".join(map(str, problem.counts)), 3 * size * expected.itemsize, FEWER_NODES)
    with _entry(archive, "table.npy", size * expected.itemsize + MOST_HEADER) as file:
        shape, kind = _array_kind(file)
        fits = (len(shape) == 3 and prod(shape) == size) if problem.kind == "game" else shape == (v, heading, x, y)
        if kind != expected or not fits:
            raise ValueError("its table is not of the size that its header says")
        content = file.read(size * expected.itemsize)
        file.read(1)  # at the end of an entry its checksum is compared
        return np.frombuffer(content, expected).reshape(shape)


def _entry(archive: zipfile.ZipFile, name: str, most: int) -> Any:
    """An entry of an archive to read from, if it is stored in one of NumPy's two ways and not too large."""
    entry = archive.getinfo(name)
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or entry.flag_bits & 1:
        raise ValueError(f"{name} is encrypted, or compressed in an unknown way")
    if entry.file_size > most:
        raise ValueError(f"{name} has {entry.file_size:,} bytes")
    return archive.open(entry)


def _array_kind(file: Any) -> tuple[tuple[int, ...], np.dtype]:
    """Shape and number type of an array of NumPy's, by its header."""
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("an array of another version")
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # of headers that NumPy has never written
        shape, columns_first, kind = np.lib.format.read_array_header_1_0(file)
    if columns_first or kind.hasobject:
        raise ValueError("an array of another kind")
    return shape, kind
