"""The process in which onnxruntime runs a model; it imports nothing of the package.

Standard input is a socket. From it come the model's size [bytes] and the model; the answer is how
many numbers the model reads, and how many make an action, 1 or 2. A request is a number of rows
and the `float32` of each; its answer is an `int32` for each row, -1 for what is no action, or two
`float32`. All sizes are `uint32`.
"""

import os
import resource
import sys
from contextlib import suppress
from typing import Any

import numpy as np

LIMITS = {
    resource.RLIMIT_AS: 4 << 30,
    resource.RLIMIT_CPU: 60,
    resource.RLIMIT_CORE: 0,
    resource.RLIMIT_FSIZE: 1 << 16,
    resource.RLIMIT_NOFILE: 0,
    resource.RLIMIT_NPROC: 0,
}
"""Memory [bytes], time on a core [s], and sizes of files [bytes]. No file or socket is opened from
here on, and, unless by root, no process or thread started."""


def main() -> None:
    """Load a model and answer until nobody asks."""
    import onnxruntime  # pyright: ignore[reportMissingImports]

    requests = sys.stdin.buffer

    def number() -> int:
        return int.from_bytes(requests.read(4), "little")

    model = requests.read(number())
    for kind, most in LIMITS.items():
        # a limit that this system does not have, or a lower one
        with suppress(ValueError, OSError):
            resource.setrlimit(kind, (most, most))
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    inputs = {entry.name: entry.shape for entry in session.get_inputs()}
    name, *further = inputs
    if further or not isinstance(inputs[name][-1], int):
        sys.exit(f"it reads {inputs}; give a model of one input [rows, size]")
    size = inputs[name][-1]

    def act(observation: Any) -> np.ndarray:
        return parse_actions(
            np.asarray(session.run(None, {name: observation})[0]), len(observation)
        )

    numbers = act(np.zeros((2, size), np.float32))[0].size
    os.write(0, np.array([size, numbers], "<u4").tobytes())
    rows = number()
    while rows:
        observations = np.frombuffer(requests.read(4 * rows * size), np.float32)
        os.write(0, act(observations.reshape(rows, size)).reshape(rows, numbers).tobytes())
        rows = number()


def parse_actions(answer: np.ndarray, rows: int) -> np.ndarray:
    """Return the actions of a model's answer, of nine values the best; -1 for what is no action."""
    if answer.shape == (rows, 9) and answer.dtype.kind == "f":
        return np.where(np.isnan(answer).any(axis=1), -1, answer.argmax(axis=1)).astype(np.int32)
    if answer.shape == (rows,) and answer.dtype.kind in "iu":
        return np.where((answer >= 0) & (answer < 9), answer, -1).astype(np.int32)
    if answer.shape == (rows, 2) and answer.dtype.kind == "f":
        return answer.astype(np.float32)
    shapes = "[rows] actions, [rows, 9] values or [rows, 2] levels"
    sys.exit(f"it answers {answer.dtype} {answer.shape}; give {shapes}")


if __name__ == "__main__":
    main()
