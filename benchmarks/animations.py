"""How long animations of a game of about 300 steps take on one core: the file alone, and all of `apollonius show`.

    python benchmarks/animations.py

prints the median of five of each. Beside wall seconds stand processor seconds, which other work on the core lengthens
less; those of ffmpeg are included.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from apollonius.replay import load_replay
from apollonius.show.animation import FORMATS, save_animation

SHOW = [sys.executable, "-m", "apollonius", "show"]
GAME = ["P_curriculum", "E_scratch", "--seed", "10"]
REPEATS = 5


def main() -> None:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # processes begun from here inherit it
    with tempfile.TemporaryDirectory() as folder:
        recorded = Path(folder) / "game.json"
        run_show(*GAME, "--out", str(recorded))
        replay = load_replay(recorded)
        print(f"a game of {len(replay.actions)} steps, one core, median of {REPEATS}")
        for suffix in FORMATS:
            path = str(recorded.with_suffix(suffix))
            report(f"{suffix} written", partial(save_animation, replay, Path(path)))
            report(f"{suffix} from a replay file", partial(run_show, str(recorded), "--out", path))
            report(f"{suffix} from two agents", partial(run_show, *GAME, "--out", path))


def run_show(*arguments: str) -> None:
    subprocess.run([*SHOW, *arguments], check=True, stdout=subprocess.DEVNULL)


def report(what: str, run: Callable[[], None]) -> None:
    """Time it and print a line."""
    wall, processor = zip(*(spend(run) for _ in range(REPEATS)), strict=True)
    print(f"{what:<28} {statistics.median(wall):6.2f} s wall, {statistics.median(processor):6.2f} s of the processor")


def spend(run: Callable[[], None]) -> tuple[float, float]:
    """Wall seconds and processor seconds of a call, those of processes that it begins and awaits included."""
    began, before = time.perf_counter(), sum(os.times()[:4])
    run()
    return time.perf_counter() - began, sum(os.times()[:4]) - before


if __name__ == "__main__":
    main()
