"""Agents from outside: ONNX models, each run by a process of its own, and their player."""

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
from apollonius.game.types import NUM_ACTIONS, Action, RandomBits
from apollonius.io.document import read_bytes
from apollonius.io.errors import InvalidInput, format_value, missing_extra, require
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.registry import OBSERVATIONS

ROUND_SECONDS = 600.0
"""Time for all answers of a round [s]: ten times its processor time, since machines are busy."""
_MOST_BYTES = 1 << 26
_PROGRAM = Path(__file__).with_name("onnx_process.py")
_NO_ACTION = b"\xff"
"""All bytes of what is no action: of the whole number -1, and of levels that are no numbers."""


class OnnxProcess:
    """The process of a model, one for each round of games.

    Raises InvalidInput for another file, for a model that does not start, and where onnxruntime is
    missing.
    """

    def __init__(self, path: Path) -> None:
        remedy = missing_extra("export", "onnxruntime")
        require(
            remedy is None,
            "agent",
            path,
            f"of the package where onnxruntime is not installed: {remedy}",
        )
        self.content = read_bytes(path, "an ONNX model", "check the path", _MOST_BYTES)
        self._running: tuple[subprocess.Popen[bytes], socket.socket, IO[bytes]] | None = None
        size, numbers = self.start_round(0)
        self.stop()
        if self.reason:
            remedy = "give a model in one file, without external data"
            raise InvalidInput(f"'{path}' does not start ({self.reason}): {remedy}.")
        sizes = {observation.size: observation for observation in OBSERVATIONS.values()}
        known_sizes = sizes.values()
        bound = ", ".join(f"{observation.size} ({observation.name})" for observation in known_sizes)
        require(size in sizes, f"'{path}': numbers that it reads", size, f"one of {bound}")
        self.observation = sizes[size]
        if numbers == 1:
            self.brake = np.array(BRAKE_STRAIGHT, np.int32)
        else:
            self.brake = np.array([-1, 0], np.float32)

    def start_round(self, games: int) -> list[int]:
        """Start the process of a new round, whose games have the first slots of a batch.

        Returns how many numbers the model reads, and how many make an action.
        """
        self.stop()
        self.reason, self._seconds = "", ROUND_SECONDS
        variables = {"PATH": os.defpath, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        line, other_end = socket.socketpair()
        # It lives as long as the process; a pipe would block.
        errors = tempfile.TemporaryFile()  # noqa: SIM115
        with other_end:
            process = subprocess.Popen(
                [sys.executable, "-I", str(_PROGRAM)],
                stdin=other_end.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=errors,
                cwd=os.sep,
                env=variables,
                start_new_session=True,
            )
        self._running = process, line, errors
        answer = self._exchange(np.uint32(len(self.content)).tobytes() + self.content, 8)
        self._games, self.forfeited = games, set(range(games)) if self.reason else set[int]()
        return np.frombuffer(answer, np.uint32).tolist()

    def stop(self) -> None:
        """End the process and its group; wait for no other one."""
        if self._running:
            process, line, errors = self._running
            with line, errors, suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            with suppress(subprocess.TimeoutExpired):
                process.wait(1.0)
        self._running = None

    def request_actions(self, observation: object, steps: object) -> np.ndarray:
        """Return the actions of all rows of a batch.

        A robot whose game is over brakes; where there is no action, it does so too, and its game is
        lost.
        """
        numbers, steps = np.ascontiguousarray(observation, np.float32), np.asarray(steps)
        actions = np.broadcast_to(self.brake, (len(numbers), *self.brake.shape)).copy()
        slots = np.arange(len(numbers)) % 2 ** max(self._games - 1, 0).bit_length()
        # Games begin together, and an empty slot stays at its first step.
        in_play = ~np.isin(slots, list(self.forfeited))
        playing = (slots < self._games) & (steps == steps.max()) & in_play
        if playing.any():
            request = np.uint32(playing.sum()).tobytes() + numbers[playing].tobytes()
            answer = self._exchange(request, actions[playing].nbytes)
            actions[playing] = np.frombuffer(answer, actions.dtype).reshape(-1, *self.brake.shape)
        least, most = (-1, 1) if self.brake.ndim else (0, NUM_ACTIONS - 1)
        is_valid = (actions >= least) & (actions <= most)  # False for NaN
        is_invalid = ~is_valid.reshape(len(actions), -1).all(axis=1)
        if is_invalid.any():
            self.reason = self.reason or "an answer that is no action"
        self.forfeited |= set(slots[is_invalid].tolist())
        actions[is_invalid] = self.brake
        return actions

    def _exchange(self, request: bytes, size: int) -> bytes:
        """Send a request and return the answer, of this size.

        Where none comes in time, the process ends, and the answer is no action.
        """
        assert self._running is not None, "a process that has ended is asked no more"
        process, line, errors = self._running
        answer, until = b"", time.monotonic() + self._seconds
        try:
            line.settimeout(self._seconds)
            line.sendall(request)
            while len(answer) < size:
                line.settimeout(max(until - time.monotonic(), 1e-3))
                part = line.recv(size - len(answer))
                if not part:
                    raise BrokenPipeError
                answer += part
        except TimeoutError:
            self.reason = f"no answer within {ROUND_SECONDS:g} s of a round"
        except OSError:
            with suppress(subprocess.TimeoutExpired):
                process.wait(1.0)
            text = os.pread(errors.fileno(), 1 << 16, 0).decode(errors="replace")
            lines = text.strip().splitlines()
            status = process.poll() or 0
            ending = f"status {status}"
            if status < 0:
                ending = f"signal {-status}, as at its limit of time"
            self.reason = format_value(lines[-1] if lines else f"it ended with {ending}")
        self._seconds = max(until - time.monotonic(), 1e-3)
        if len(answer) == size:
            return answer
        self.stop()
        return _NO_ACTION * size


class OnnxAgent(AbstractPolicy):
    """The player by an ONNX model; it remembers how many steps it has played."""

    process: OnnxProcess = eqx.field(static=True)

    @property
    def observation(self) -> AbstractObservation:
        return self.process.observation

    @property
    def continuous(self) -> bool:
        return self.process.brake.ndim > 0

    @property
    def memory(self) -> Int[Array, ""]:
        return jnp.zeros((), jnp.int32)

    def __call__(
        self, observation: Float[Array, " size"], memory: Int[Array, ""], bits: RandomBits
    ) -> tuple[Action, Int[Array, ""]]:
        result = jax.ShapeDtypeStruct(self.process.brake.shape, self.process.brake.dtype)
        action = jax.pure_callback(
            self.process.request_actions, result, observation, memory, vmap_method="broadcast_all"
        )
        return action, memory + 1


def external_process(policy: AbstractPolicy) -> OnnxProcess | None:
    """Return the process that a player asks; None for a player of the package."""
    return policy.process if isinstance(policy, OnnxAgent) else None
