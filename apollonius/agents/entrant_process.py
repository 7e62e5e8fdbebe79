"""The process of an agent from outside. It runs apart from the package, of which it imports nothing.

Messages are those of `multiprocessing.connection`. The first is a line of JSON and the agent's file; its answer, JSON,
is the observation that the agent reads and the kind of its actions. Then a request is a row for each decision, slot,
step and arena as `uint32` and the observation as `float32`; its answer is an `int32` for each row, or two `float32`.
"""

import contextlib
import ctypes
import json
import os
import resource
import struct
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

Act = Callable[..., Any]
"""From observations `[rows, size]` and slots, steps and arenas `[rows]` to actions."""
_READ = 1 | 4 | 8
"""Landlock's rights to run and read files and to list folders."""
_CREATE, _ADD, _RESTRICT, _NO_NEW_PRIVILEGES = 444, 445, 446, 38
"""Numbers of Landlock's system calls, and of an operation of `prctl`."""
LIMITS = {resource.RLIMIT_AS: 4 << 30, resource.RLIMIT_CPU: 60, resource.RLIMIT_FSIZE: 0, resource.RLIMIT_CORE: 0}
"""Memory [bytes], time on a core [s] in a round, size of files written [bytes]."""
_SYSTEM = ("/usr", "/lib", "/lib64", "/etc", "/proc", "/sys", "/dev")
"""Folders that an agent can read, beside those of its interpreter."""
STATE = "state"
"""Name of the observation of those who name none."""


def main() -> None:
    """Shut this process in, load the agent, and answer until the judge ends it."""
    line = Connection(os.dup(0))
    os.dup2(os.open(os.devnull, os.O_RDWR), 0)  # the agent has no way to it
    first, _, content = line.recv_bytes().partition(b"\n")
    about = json.loads(first)
    for kind, most in LIMITS.items():
        resource.setrlimit(kind, (most, most))
    isolated = _shut_in([sys.prefix, sys.base_prefix, *_SYSTEM])
    load = _load_python if about["suffix"] == ".py" else _load_onnx
    act, said = load(content, about)
    line.send_bytes(json.JSONEncoder().encode(said | {"isolated": isolated}).encode())
    import numpy as np

    size, kind = about["observations"][said["observation"]], np.int32 if said["actions"] == "discrete" else np.float32
    shape = () if said["actions"] == "discrete" else (2,)
    while True:
        words = np.frombuffer(line.recv_bytes(), np.uint32).reshape(-1, 3 + size)
        seen = words[:, 3:].copy().view(np.float32)
        actions = np.asarray(act(seen, *words[:, :3].T.astype(np.int64))).astype(kind, casting="same_kind")
        line.send_bytes(actions.reshape(len(words), *shape).tobytes())


def _load_python(content: bytes, about: dict[str, Any]) -> tuple[Act, dict[str, str]]:
    names: dict[str, Any] = {"__name__": "entrant"}
    exec(compile(content, "entrant.py", "exec"), names)  # in this process, for that is what it is there for
    if "begin" in names:
        names["begin"](about["game"])
    said = {"observation": names.get("OBSERVATION", STATE), "actions": names.get("ACTIONS", "discrete")}
    return names["act"], said


def _load_onnx(content: bytes, about: dict[str, Any]) -> tuple[Act, dict[str, str]]:
    """Return what asks a model: one input `[rows, size]`; one action, nine values or two levels for each row."""
    import numpy as np
    import onnxruntime  # pyright: ignore[reportMissingImports]

    options = onnxruntime.SessionOptions()
    options.log_severity_level, options.intra_op_num_threads = 3, 1
    session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    name, size = session.get_inputs()[0].name, session.get_inputs()[0].shape[-1]
    sizes = {numbers: known for known, numbers in about["observations"].items() if known != STATE}
    if size not in sizes:
        raise ValueError(f"it reads {size} numbers; observations have {', '.join(map(str, sizes))}")

    def run(seen: Any, *_: Any) -> Any:
        made = np.asarray(session.run(None, {name: seen})[0])
        return made.argmax(axis=1).astype(np.int32) if made.ndim == 2 and made.shape[1] == 9 else made

    levels = np.asarray(run(np.zeros((2, size), np.float32))).ndim == 2
    return run, {"observation": sizes[size], "actions": "continuous" if levels else "discrete"}


def _shut_in(readable: list[str]) -> bool:
    """Leave this process nothing but to read these folders: it writes nothing, connects nowhere, signals nobody.

    By Landlock, of Linux 5.13 and later; returns whether it is there.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    version = libc.syscall(_CREATE, None, 0, 1)
    if version < 1:
        return False
    files = sum(1 << bit for bit in range(13 + (version >= 2) + (version >= 3) + (version >= 5)))
    rules = struct.pack("=QQQ", files, 3, 3)[: 8 if version < 4 else 16 if version < 6 else 24]
    ruleset = libc.syscall(_CREATE, rules, len(rules), 0)
    for folder in readable:
        with contextlib.suppress(FileNotFoundError):
            libc.syscall(_ADD, ruleset, 1, struct.pack("=Qi", _READ, os.open(folder, os.O_PATH)), 0)
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    return libc.syscall(_RESTRICT, ruleset, 0) == 0


if __name__ == "__main__":
    main()
