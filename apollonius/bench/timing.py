"""Wall seconds of what is repeated, one thing or several in turns, and the rates that they give."""

import os
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import jax

from apollonius.playout import Report


def seconds_of(run: Callable[[int], Any], repeats: int, report: Report) -> list[float]:
    """Wall seconds of each repeat; one that compiles and warms up goes before."""
    (seconds,) = in_turns((run,), repeats, report)
    return seconds


def in_turns(runs: Sequence[Callable[[int], Any]], repeats: int, report: Report) -> list[list[float]]:
    """Wall seconds of each repeat of each of several, side by side in time, so that a busy machine slows all alike."""
    seconds: list[list[float]] = [[] for _ in runs]
    for repeat in range(repeats + 1):
        for run, spent in zip(runs, seconds, strict=True):
            began = time.perf_counter()
            jax.block_until_ready(run(repeat))
            if repeat > 0:
                spent.append(time.perf_counter() - began)
        report(repeat, repeats)
    return seconds


def rate(name: str, amount: int, seconds: list[float]) -> dict[str, float]:
    return {
        f"{name}_per_second": amount / statistics.median(seconds),
        f"{name}_per_second_best": amount / min(seconds),
        f"{name}_per_second_worst": amount / max(seconds),
    }


def machine() -> dict[str, Any]:
    device = jax.devices()[0]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"device": device.device_kind, "cores": cores, "jax": jax.__version__}
