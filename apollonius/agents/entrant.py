"""An agent from outside: a Python file or an ONNX model, which a process of its own asks and a policy plays."""

import json
import os
import subprocess
import time
from contextlib import suppress
from multiprocessing import Pipe
from pathlib import Path
from threading import Timer
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from apollonius.agents import entrant_process
from apollonius.agents.classical import BRAKE_STRAIGHT
from apollonius.agents.entrant_process import STATE
from apollonius.agents.policy import AbstractPolicy
from apollonius.game.types import NUM_ACTIONS, Action, Bits
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
_LONGEST_ANSWER = 1 << 12
_OF_A_ROBOT = 6
"""Numbers of a robot in the observation `state`."""


class Failure(Exception):
    """The end of a process of an agent, by its own fault."""


class EntrantProcess:
    """The process of an agent from outside, one for each round of games, in which `python` runs the agent's file.

    A row of a round, one robot of the game in one slot, is asked in every step until it fails: an answer that is late,
    missing or no action costs the games that were asked, and an impossible action that game alone. Then it brakes.
    Raises InvalidInput for another file, and for an agent that does not start.
    """

    def __init__(self, path: Path, python: str, game: dict[str, Any], robots: int) -> None:
        require(path.suffix in ENTRANTS, "entrant", path, f"a file that ends in {' or '.join(ENTRANTS)}")
        self.content = read_bytes(path, "an agent's file", "check the path", _MOST_BYTES)
        self._path, self._python = path, python
        self._sizes = {STATE: _OF_A_ROBOT * robots} | {name: one.size for name, one in OBSERVATIONS.items()}
        about = {"suffix": path.suffix, "bytes": len(self.content), "observations": self._sizes, "game": game}
        self._about = to_json(about).encode()
        self._running: tuple[subprocess.Popen[bytes], Any] | None = None
        self.reason = ""
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
        line, theirs = Pipe()
        with theirs:
            process = subprocess.Popen(
                [self._python, "-I", entrant_process.__file__], stdin=theirs.fileno(), stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE, bufsize=0, cwd=os.sep, env=variables, start_new_session=True,
            )  # fmt: skip
        self._running = process, line
        return json.loads(self._exchange(self._about + b"\n" + self.content, _LONGEST_ANSWER, START_SECONDS))

    def end(self) -> None:
        """End the process and all that it has started in its session."""
        if self._running:
            process, line = self._running
            with process, line, suppress(ProcessLookupError):
                os.killpg(process.pid, 9)
        self._running = None

    def ask(self, seen: Any, steps: Any, arenas: Any) -> np.ndarray:
        """Return the actions of all rows of a batch; those that are not asked brake."""
        seen, steps = np.ascontiguousarray(seen, np.float32), np.asarray(steps)
        brake = np.array(BRAKE_STRAIGHT, np.int32) if self.is_discrete else np.array([-1.0, 0.0], np.float32)
        actions = np.broadcast_to(brake, (len(seen), *np.shape(brake))).copy()
        slots = np.arange(len(seen)) % 2 ** max(self._slots - 1, 0).bit_length()
        lost = np.isin(slots, list(self.forfeited))
        (rows,) = np.nonzero((slots < self._slots) & (steps == self._step) & ~lost)
        self._step += 1
        if not len(rows):
            return actions
        labels = np.stack([np.arange(len(seen)), steps, np.asarray(arenas)], axis=1).astype(np.uint32)
        words = np.hstack([labels, seen.view(np.uint32)])[rows].tobytes()
        try:
            answer = self._exchange(words, actions[rows].nbytes, max(1.0, DECISION_SECONDS * len(rows)))
            actions[rows] = np.frombuffer(answer, actions.dtype).reshape(-1, *np.shape(brake))
        except (Failure, ValueError) as reason:  # an answer of another size, too
            self.reason = self.reason or str(reason)
            self.forfeited |= set(slots[rows].tolist())
            self.end()
        least, most = (0, NUM_ACTIONS - 1) if self.is_discrete else (-1, 1)
        fits = ((actions >= least) & (actions <= most)).reshape(len(actions), -1).all(axis=1)  # no NaN is
        self.forfeited |= set(slots[~fits].tolist())
        actions[~fits] = brake
        return actions

    def _exchange(self, message: bytes, most: int, seconds: float) -> bytes:
        """Send a message and return the answer, of `most` bytes at most; raises Failure without one in time."""
        assert self._running is not None, "a process that has ended is asked no more"
        process, line = self._running
        began, end = time.monotonic(), Timer(seconds, os.killpg, (process.pid, 9))
        end.start()
        try:
            line.send_bytes(message)
            return line.recv_bytes(most)
        except (EOFError, OSError) as gone:
            end.cancel()
            late = time.monotonic() - began >= seconds
            raise Failure(f"no answer within {seconds:g} s" if late else _last_words(process, gone)) from gone
        finally:
            end.cancel()


def _last_words(process: subprocess.Popen[bytes], error: Exception) -> str:
    """Return the last line of what a process that ends has complained about, or that it ended, or the error."""
    assert process.stderr is not None, "which is a pipe"
    with suppress(subprocess.TimeoutExpired):
        process.wait(1.0)
    os.set_blocking(process.stderr.fileno(), False)
    lines = (process.stderr.read(1 << 16) or b"").decode(errors="replace").strip().splitlines()
    status = process.poll()
    return shown(lines[-1] if lines else error if status is None else f"it ended with status {status}")


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

    def __call__(self, seen: View, memory: Int[Array, ""], bits: Bits) -> tuple[Action, Int[Array, ""]]:
        process = self.process
        numbers = _state(seen) if process.observation == STATE else OBSERVATIONS[process.observation](seen)
        kind = ((), jnp.int32) if process.is_discrete else ((2,), jnp.float32)
        given = numbers, memory, jnp.asarray(seen.chart.member)
        action = jax.pure_callback(process.ask, jax.ShapeDtypeStruct(*kind), *given, vmap_method="broadcast_all")
        return action, memory + 1


def process_of(policy: AbstractPolicy) -> EntrantProcess | None:
    """Return the process that a player asks; None for a player of the package."""
    return policy.process if isinstance(policy, Entrant) else None


def _state(seen: View) -> Float[Array, " numbers"]:
    """Return x [m], y [m], v [m/s], heading [rad], whether in play, and age [s], of each robot, its own first."""
    robots = (seen.own, *seen.mates, *seen.opponents)
    numbers = [[*jax.tree.leaves(one.state), one.active, one.age] for one in robots]
    return jnp.stack([jnp.asarray(number, jnp.float32) for row in numbers for number in row])
