"""An agent from outside: a Python file or an ONNX model, which a process of its own asks and a policy plays."""

import json
import os
import socket
import struct
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents import entrant_process
from apollonius.agents.classical import BRAKE_STRAIGHT
from apollonius.agents.entrant_process import STATE
from apollonius.agents.policy import AbstractPolicy
from apollonius.game.types import NUM_ACTIONS, Action
from apollonius.io.document import read_bytes, to_json
from apollonius.io.errors import InvalidInput, require, shown
from apollonius.io.limits import ENTRANTS
from apollonius.observe.registry import OBSERVATIONS
from apollonius.observe.view import View

DECISION_SECONDS = 0.01
"""Time for a decision [s]: a request has that for each of its rows, or a second if that is more."""
START_SECONDS = 60.0
"""Time until the process answers for the first time [s]."""
_MOST_BYTES = 1 << 26
_LONGEST_LINE = 1 << 12
_OF_A_ROBOT = 6
"""Numbers of a robot in the observation `state`."""


class Failure(Exception):
    """The end of a process of an agent, by its own fault."""


class EntrantProcess:
    """The process of an agent from outside, one for each round of games.

    A row of a round, one robot of the game in one slot, is asked in every step until it fails: an answer that is late,
    missing or no action costs the games that were asked, and an impossible action that game alone. Then it brakes.

    Args:
        path: the agent's file, which the interpreter `python` runs.
        game: a description of the game for the agent, as JSON-like data.
        robots: their number in a game.

    Raises:
        InvalidInput: for another file, and for an agent that does not start.
    """

    def __init__(self, path: Path, python: str, game: dict[str, Any], robots: int) -> None:
        require(path.suffix in ENTRANTS, "entrant", path, f"a file that ends in {' or '.join(ENTRANTS)}")
        self.content = read_bytes(path, "an agent's file", "check the path", _MOST_BYTES)
        self._path, self._python = path, python
        self._sizes = {STATE: _OF_A_ROBOT * robots} | {name: one.size for name, one in OBSERVATIONS.items()}
        about = {"suffix": path.suffix, "bytes": len(self.content), "observations": self._sizes, "game": game}
        self._about = to_json(about).encode()
        self._running: subprocess.Popen[bytes] | None = None
        self.seconds, self.decisions, self.reason = 0.0, 0, ""
        try:
            said = self.begin(0)
            self.observation, self.is_discrete = said["observation"], said["actions"] == "discrete"
            self.is_isolated = bool(said["isolated"])
            known = self.observation in self._sizes and said["actions"] in ("discrete", "continuous")
        except (Failure, KeyError, TypeError, ValueError) as reason:
            raise InvalidInput(f"'{path}' does not start ({shown(reason)}): correct it.") from reason
        finally:
            self.end()
        require(
            known, f"'{path}': OBSERVATION, ACTIONS", said, f"one of {', '.join(self._sizes)}; discrete or continuous"
        )

    def begin(self, slots: int) -> dict[str, Any]:
        """Start the process of a new round, whose games have the first slots of a batch."""
        self.end()
        self.forfeited: set[int] = set()
        self._step, self._slots = 0, slots
        variables = {"PATH": os.defpath, "HOME": os.sep, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self._line, theirs = socket.socketpair()
        with theirs:
            self._running = subprocess.Popen(
                [self._python, "-I", entrant_process.__file__], stdin=theirs.fileno(), stdout=theirs.fileno(),
                stderr=subprocess.PIPE, bufsize=0, cwd=os.sep, env=variables, start_new_session=True,
            )  # fmt: skip
        return json.loads(self._exchange(self._about + b"\n" + self.content, None, START_SECONDS))

    def end(self) -> None:
        """End the process and all that it has started in its session."""
        if self._running:
            with self._running, self._line, suppress(ProcessLookupError):
                os.killpg(self._running.pid, 9)
            self._running = None

    def ask(self, seen: Any, steps: Any, arenas: Any) -> np.ndarray:
        """Return the actions of all rows of a batch; those that are not asked brake."""
        seen, steps, arenas = np.asarray(seen, np.float32), np.asarray(steps), np.asarray(arenas)
        brake = np.array(BRAKE_STRAIGHT, np.int32) if self.is_discrete else np.array([-1.0, 0.0], np.float32)
        actions = np.broadcast_to(brake, (len(seen), *np.shape(brake))).copy()
        width = 2 ** max(self._slots - 1, 0).bit_length()
        slots = np.arange(len(seen)) % max(width, 1)
        lost = np.isin(slots, list(self.forfeited))
        (rows,) = np.nonzero((slots < self._slots) & (steps == self._step) & ~lost)
        self._step += 1
        if not len(rows):
            return actions
        try:
            actions[rows] = self._answer(seen, np.stack([np.arange(len(seen)), steps, arenas]), rows)
        except Failure as reason:
            self.reason = self.reason or str(reason)
            self.forfeited |= set(slots[rows].tolist())
            self.end()
        least, most = (0, NUM_ACTIONS - 1) if self.is_discrete else (-1, 1)
        fits = ((actions >= least) & (actions <= most)).reshape(len(actions), -1).all(axis=1)  # no NaN is
        self.forfeited |= set(slots[~fits].tolist())
        actions[~fits] = brake
        return actions

    def _answer(self, seen: np.ndarray, labels: np.ndarray, rows: np.ndarray) -> np.ndarray:
        parts = [struct.pack("<I", len(rows)), labels[:, rows].astype("<u4").tobytes(), seen[rows].tobytes()]
        began, shape = time.perf_counter(), (len(rows),) if self.is_discrete else (len(rows), 2)
        answer = self._exchange(b"".join(parts), 4 * int(np.prod(shape)), max(1.0, DECISION_SECONDS * len(rows)))
        self.seconds += time.perf_counter() - began
        self.decisions += len(rows)
        return np.frombuffer(answer, np.int32 if self.is_discrete else np.float32).reshape(shape)

    def _exchange(self, message: bytes, size: int | None, seconds: float) -> bytes:
        """Send a message and return the answer, of a size or a line; raises Failure without one in time."""
        answer, end = bytearray(), time.monotonic() + seconds
        try:
            self._line.settimeout(seconds)
            self._line.sendall(message)
            while len(answer) < size if size is not None else not answer.endswith(b"\n"):
                self._line.settimeout(max(end - time.monotonic(), 1e-6))
                part = self._line.recv(1 << 16)
                answer += part
                if not part or (size is None and len(answer) > _LONGEST_LINE):
                    raise Failure(self._last_words())
        except TimeoutError as late:
            raise Failure(f"no answer within {seconds:g} s") from late
        except OSError as gone:
            raise Failure(self._last_words()) from gone
        if size is not None and len(answer) > size:
            raise Failure("an answer that is too long")
        return bytes(answer)

    def _last_words(self) -> str:
        """Return the last line of what a process that ends has complained about, or that it ended."""
        assert self._running is not None, "a process that has ended is asked no more"
        assert self._running.stderr is not None, "which is a pipe"
        with suppress(subprocess.TimeoutExpired):
            self._running.wait(1.0)
        os.set_blocking(self._running.stderr.fileno(), False)
        said = self._running.stderr.read(1 << 16) or b""
        lines = said.decode(errors="replace").strip().splitlines()
        return shown(lines[-1] if lines else f"it ended with status {self._running.poll()}")


class Entrant(AbstractPolicy):
    """The player by an agent from outside; it remembers how many steps it has played."""

    process: EntrantProcess = eqx.field(static=True)

    @property
    def charted(self) -> bool:
        return True

    @property
    def continuous(self) -> bool:
        return not self.process.is_discrete

    @property
    def memory(self) -> Int[Array, ""]:
        return jnp.zeros((), jnp.int32)

    def __call__(self, seen: View, memory: Int[Array, ""], bits: UInt32[Array, ""]) -> tuple[Action, Int[Array, ""]]:
        process = self.process
        numbers = _state(seen) if process.observation == STATE else OBSERVATIONS[process.observation](seen)
        kind = ((), jnp.int32) if process.is_discrete else ((2,), jnp.float32)
        given = numbers, memory, jnp.asarray(seen.chart.member)
        action = jax.pure_callback(process.ask, jax.ShapeDtypeStruct(*kind), *given, vmap_method="broadcast_all")
        return action, memory + 1


def _state(seen: View) -> Float[Array, " numbers"]:
    """Return x [m], y [m], v [m/s], heading [rad], whether in play, and age [s], of each robot, its own first."""
    robots = (seen.own, *seen.mates, *seen.opponents)
    numbers = [[*jax.tree.leaves(one.state), one.active, one.age] for one in robots]
    return jnp.stack([jnp.asarray(number, jnp.float32) for row in numbers for number in row])
