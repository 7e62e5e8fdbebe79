"""Agents from outside: an ONNX model, which a process of its own runs, and the policy that asks it."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from apollonius.agents.classical import BRAKE_STRAIGHT
from apollonius.agents.policy import AbstractPolicy
from apollonius.game.types import NUM_ACTIONS, Action, Bits
from apollonius.io.document import read_bytes
from apollonius.io.errors import InvalidInput, missing, require, shown
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.registry import OBSERVATIONS

ROUND_SECONDS = 600.0
"""Time for all answers of a round [s]: ten times that on a core which the process has, for machines that are busy."""
_MOST_BYTES = 1 << 26
_LONGEST_ERROR = 1 << 16
_PROGRAM = Path(__file__).with_name("onnx_process.py")


class Failure(Exception):
    """The end of a model's process, by its own fault."""


class OnnxProcess:
    """The process of a model, one for each round of games.

    An answer that is late or missing costs the games that were asked, an impossible action that game alone. A robot of
    a lost game brakes. Raises InvalidInput for another file, and for a model that does not start.
    """

    def __init__(self, path: Path) -> None:
        remedy = missing("export", "onnxruntime")
        require(remedy is None, "agent", path, f"of the package where onnxruntime is not installed: {remedy}")
        self.content = read_bytes(path, "an ONNX model", "check the path", _MOST_BYTES)
        self.reason = ""
        self._running: tuple[subprocess.Popen[bytes], socket.socket, IO[bytes]] | None = None
        try:
            size, numbers = self._start()
        except Failure as reason:
            raise InvalidInput(
                f"'{path}' does not start ({reason}): give a model in one file, without external data."
            ) from reason
        finally:
            self.end()
        sizes = {one.size: one for one in OBSERVATIONS.values()}
        bound = ", ".join(f"{one.size} ({one.name})" for one in sizes.values())
        require(size in sizes, f"'{path}': numbers that it reads", size, f"one of {bound}")
        self.observation, self.is_discrete = sizes[size], numbers == 1

    def begin(self, games: int) -> None:
        """Start the process of a new round, whose games have the first slots of a batch."""
        self._games, self.forfeited = games, set[int]()
        try:
            self._start()
        except Failure as reason:
            self._forfeit(np.arange(games), str(reason))

    def end(self) -> None:
        """End the process and its group; wait for no other process."""
        if self._running:
            process, line, errors = self._running
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            line.close()
            errors.close()
            with suppress(subprocess.TimeoutExpired):
                process.wait(1.0)
        self._running = None

    def ask(self, seen: object, steps: object) -> np.ndarray:
        """Return the actions of all rows of a batch; those whose game is over or lost brake."""
        numbers, steps = np.ascontiguousarray(seen, np.float32), np.asarray(steps)
        brake = np.array(BRAKE_STRAIGHT, np.int32) if self.is_discrete else np.array([-1.0, 0.0], np.float32)
        actions = np.broadcast_to(brake, (len(numbers), *brake.shape)).copy()
        slots = np.arange(len(numbers)) % 2 ** max(self._games - 1, 0).bit_length()
        # Games begin together, and an empty slot stays at its first step.
        live = (slots < self._games) & (steps == steps.max()) & ~np.isin(slots, list(self.forfeited))
        if not live.any():
            return actions
        request = np.uint32(live.sum()).tobytes() + numbers[live].tobytes()
        try:
            answer = self._exchange(request, actions[live].nbytes)
        except Failure as reason:
            self._forfeit(slots[live], str(reason))
            self.end()
            return actions
        actions[live] = np.frombuffer(answer, actions.dtype).reshape(-1, *brake.shape)
        least, most = (0, NUM_ACTIONS - 1) if self.is_discrete else (-1, 1)
        possible = ((actions >= least) & (actions <= most)).reshape(len(actions), -1).all(axis=1)  # no NaN is
        if not possible.all():
            self._forfeit(slots[~possible], "an answer that is no action")
            actions[~possible] = brake
        return actions

    def _start(self) -> list[int]:
        """Start the process; return how many numbers the model reads and how many make an action."""
        self.end()
        variables = {"PATH": os.defpath, "HOME": os.sep, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        line, end = socket.socketpair()
        errors = tempfile.TemporaryFile()  # noqa: SIM115 (open as long as the process; unlike a pipe it never blocks)
        with end:
            process = subprocess.Popen(
                [sys.executable, "-I", str(_PROGRAM)], stdin=end.fileno(), stdout=subprocess.DEVNULL, stderr=errors, cwd=os.sep,
                env=variables, start_new_session=True,
            )  # fmt: skip
        self._running, self._seconds = (process, line, errors), ROUND_SECONDS
        model = np.uint32(len(self.content)).tobytes() + self.content
        return np.frombuffer(self._exchange(model, 8), np.uint32).tolist()

    def _exchange(self, request: bytes, size: int) -> bytes:
        """Send a request and return the answer of this size; raises Failure without one in what is left of the time."""
        assert self._running is not None, "a process that has ended is asked no more"
        answer, line, until = b"", self._running[1], time.monotonic() + self._seconds
        try:
            line.settimeout(self._seconds)
            line.sendall(request)
            while len(answer) < size:
                line.settimeout(max(until - time.monotonic(), 1e-3))
                part = line.recv(size - len(answer))
                if not part:
                    raise Failure(self._last_words())
                answer += part
        except TimeoutError as late:
            raise Failure(f"no answer within {ROUND_SECONDS:g} s of a round") from late
        except OSError as gone:
            raise Failure(self._last_words()) from gone
        self._seconds = max(until - time.monotonic(), 1e-3)
        return answer

    def _forfeit(self, slots: np.ndarray, reason: str) -> None:
        self.forfeited |= set(slots.tolist())
        self.reason = self.reason or reason

    def _last_words(self) -> str:
        """Return the last line of what the process has complained about, or how it ended."""
        assert self._running is not None, "a process that has ended has been heard"
        process, _, errors = self._running
        with suppress(subprocess.TimeoutExpired):
            process.wait(1.0)
        lines = os.pread(errors.fileno(), _LONGEST_ERROR, 0).decode(errors="replace").strip().splitlines()
        status = process.poll() or 0
        ending = f"signal {-status}, as at its limit of time" if status < 0 else f"status {status}"
        return shown(lines[-1] if lines else f"it ended with {ending}")


class OnnxAgent(AbstractPolicy):
    """The player by an ONNX model; it remembers how many steps it has played."""

    process: OnnxProcess = eqx.field(static=True)

    @property
    def observation(self) -> AbstractObservation:
        return self.process.observation

    @property
    def continuous(self) -> bool:
        return not self.process.is_discrete

    @property
    def memory(self) -> Int[Array, ""]:
        return jnp.zeros((), jnp.int32)

    def __call__(
        self, seen: Float[Array, " size"], memory: Int[Array, ""], bits: Bits
    ) -> tuple[Action, Int[Array, ""]]:
        kind = ((), jnp.int32) if self.process.is_discrete else ((2,), jnp.float32)
        result = jax.ShapeDtypeStruct(*kind)
        return jax.pure_callback(self.process.ask, result, seen, memory, vmap_method="broadcast_all"), memory + 1


def process_of(policy: AbstractPolicy) -> OnnxProcess | None:
    """Return the process that a player asks; None for a player of the package."""
    return policy.process if isinstance(policy, OnnxAgent) else None
