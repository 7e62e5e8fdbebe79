"""How long a person waits for a command: the first time, with no compilation kept, and when it ran before.

    python benchmarks/latency.py [REPEATS]

prints medians (of five) of whole processes, one after the other. Beside wall seconds stand processor seconds, which
other work on the machine lengthens less.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from apollonius.cache import VARIABLE

COMMANDS = (
    ("evaluate", "P_stage1", "still", "--games", "1000"),
    ("evaluate", "shielded:P_pool", "E_scratch", "--games", "1000"),
    ("show", "shielded:P_pool", "E_scratch", "--out", "game.gif"),
    ("solve", "safety", "--out", "safety.safetensors", "--force"),
)


def main() -> None:
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    print(f"medians of {repeats} on {cores} cores: seconds on the clock (of the processor)")
    print(f"{'command':<52} {'first call':>16} {'second call':>16}")
    for command in COMMANDS:
        pairs = [first_and_second(command) for _ in range(repeats)]
        cells = [
            " ".join(f"{statistics.median(kind):.1f}" for kind in zip(*calls, strict=True))
            for calls in zip(*pairs, strict=True)
        ]
        columns = [f"{wall} ({processor})" for wall, processor in map(str.split, cells)]
        print(f"{' '.join(command):<52} {columns[0]:>16} {columns[1]:>16}", flush=True)


def first_and_second(command: tuple[str, ...]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Wall and processor seconds of a command with an empty cache, and of the same command again."""
    with tempfile.TemporaryDirectory() as folder:
        return spend(command, folder), spend(command, folder)


def spend(command: tuple[str, ...], folder: str) -> tuple[float, float]:
    """Wall and processor seconds of a command whose compilations and files lie in a folder."""
    began, before = time.perf_counter(), sum(os.times()[:4])
    subprocess.run(
        [sys.executable, "-m", "apollonius", *command], check=True, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, cwd=folder,
        env={**os.environ, VARIABLE: str(Path(folder) / "cache")},
    )  # fmt: skip
    return time.perf_counter() - began, sum(os.times()[:4]) - before


if __name__ == "__main__":
    main()
