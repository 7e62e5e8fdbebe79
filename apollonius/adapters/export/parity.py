"""Whether an exported policy decides as the package's own player does, and how long it takes."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import cycle, islice

import numpy as np
from jaxtyping import Float, Float32, Int

from apollonius.adapters.export.blueprint import Blueprint

Decide = Callable[[Float32[np.ndarray, "8"]], tuple[int, float, float]]
"""An exported policy: a state (`Blueprint`) in; the action and its controls u1 [m/s^2], u2 [rad/s] out."""
ROUNDING = 1e-5
"""Relative error of action values in single precision, with room."""
_BLOCK = 100


class CannotRun(Exception):
    """What it takes to run a format is not on this machine; the message says what."""


@dataclass(frozen=True)
class Parity:
    """In how many states an exported policy did what the package's player did not.

    Attributes:
        states: how many there were.
        ties: actions whose values are equal to rounding, so that either is the best.
        errors: any other action, or controls that are not the action's.
    """

    states: int
    ties: int
    errors: int


def compare(
    decide: Decide,
    blueprint: Blueprint,
    states: Float32[np.ndarray, "count 8"],
    observations: Float32[np.ndarray, "count size"],
    actions: Int[np.ndarray, " count"],
) -> Parity:
    """An exported policy in states in which the package's player saw these observations and chose these actions."""
    ties = errors = 0
    for state, observation, action in zip(states, observations, actions, strict=True):
        chosen, *controls = decide(state)
        if (np.array(controls, np.float32) != blueprint.controls[chosen]).any():
            errors += 1
        elif chosen != action:
            values = blueprint.values(observation)
            is_tie = bool(abs(values[chosen] - values[action]) <= ROUNDING * np.max(np.abs(values)))
            ties, errors = ties + is_tie, errors + (not is_tie)
    return Parity(len(states), ties, errors)


def microseconds(
    deciders: Mapping[str, Callable[[np.ndarray], object]], states: Mapping[str, np.ndarray], calls: int = 10_000
) -> dict[str, Float[np.ndarray, " calls"]]:
    """How long calls of each took, over its own states, one at a time.

    They take turns in blocks, so that a busy machine slows all alike; the first calls of a block, which find the
    other's numbers in the cache, are not counted.
    """
    spent: dict[str, list[int]] = {name: [] for name in deciders}
    sources = {name: cycle(states[name]) for name in deciders}
    for _ in range(-(-calls // _BLOCK)):
        for name, decide in deciders.items():
            for state in islice(sources[name], _BLOCK // 10):
                decide(state)
            for state in islice(sources[name], _BLOCK):
                began = time.perf_counter_ns()
                decide(state)
                spent[name].append(time.perf_counter_ns() - began)
    return {name: np.array(times) / 1000 for name, times in spent.items()}
