"""Whether an exported policy decides as the package's own player does, and how long it takes."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import cycle, islice

import numpy as np
from jaxtyping import Float, Float32, Int

from apollonius.adapters.export.blueprint import Blueprint
from apollonius.adapters.export.nearby import seen_nearby

Answer = tuple[int, float, float] | tuple[float, float]
"""Controls u1 [m/s^2] and u2 [rad/s]; before them, of a discrete policy, the action."""
Decide = Callable[[Float32[np.ndarray, "8"]], Answer]
"""An exported policy: a state (`Blueprint`) in, its answer out."""
ROUNDING = 1e-5
"""Relative error of action values in single precision, with room."""
TOLERANCE = 1e-4
"""By how much of its largest value a continuous policy's control may differ from the package's.

Single precision makes 7e-6 of it in trained agents: observations differ by up to 6e-7, and sums are added up in another
order. This is about ten times as much, and nothing to a drive; a wrong number or a missing term makes far more.
"""
_BLOCK = 100


class CannotRun(Exception):
    """What it takes to run a format is not on this machine; the message says what."""


@dataclass(frozen=True)
class Parity:
    """In how many states an exported discrete policy did what the package's player did not.

    Attributes:
        states: how many there were.
        ties: actions whose values are equal to rounding, so that either is the best.
        errors: any other action, or controls that are not the action's.
        jumps: actions that the player takes within `BREADTH` of the state, where what it sees of a chart jumps.
    """

    states: int
    ties: int
    errors: int
    jumps: int = 0


def compare(
    decide: Decide,
    blueprint: Blueprint,
    states: Float32[np.ndarray, "count 8"],
    observations: Float32[np.ndarray, "count size"],
    actions: Int[np.ndarray, " count"],
) -> Parity:
    """An exported discrete policy in states in which the package's player saw this and did that."""
    ties = errors = jumps = 0
    for state, observation, action in zip(states, observations, actions, strict=True):
        number, *controls = decide(state)
        chosen = int(number)
        if (np.array(controls, np.float32) != blueprint.controls[chosen]).any():
            errors += 1
        elif chosen != action:
            values = blueprint.values(observation)
            is_tie = bool(abs(values[chosen] - values[action]) <= ROUNDING * np.max(np.abs(values)))
            is_jump = not is_tie and blueprint.charted and chosen in _best_nearby(blueprint, state)
            ties, jumps, errors = ties + is_tie, jumps + is_jump, errors + (not is_tie and not is_jump)
    return Parity(len(states), ties, errors, jumps)


def _best_nearby(blueprint: Blueprint, state: Float32[np.ndarray, "8"]) -> set[int]:
    """The actions that the package's player takes around a state."""
    return {int(np.argmax(blueprint.values(seen))) for seen in seen_nearby(blueprint, state)}


def largest_difference(
    decide: Decide,
    blueprint: Blueprint,
    states: Float32[np.ndarray, "count 8"],
    gears: Float32[np.ndarray, "count 2"],
) -> float:
    """Of an exported continuous policy's controls from those of the package's player, which chose these gears in these
    states: a share of each control's largest value; NaN where a control is.

    Where that is much, and it plays by a chart, it is counted from the range of the controls that the player chooses
    within `BREADTH` of the state.
    """
    said = np.array([decide(state) for state in states], float)
    largest = np.maximum(blueprint.largest_controls, 1e-6)  # where the robot cannot turn, both are 0
    away = np.abs(said - gears * blueprint.largest_controls) / largest
    if blueprint.charted:
        for place in np.flatnonzero((away > TOLERANCE).any(axis=1)):
            around = _controls_nearby(blueprint, states[place])
            away[place] = np.abs(said[place] - np.clip(said[place], around.min(axis=0), around.max(axis=0))) / largest
    return float(np.max(away))


def _controls_nearby(blueprint: Blueprint, state: Float32[np.ndarray, "8"]) -> Float[np.ndarray, "states 2"]:
    """What the package's player chooses around a state."""
    gears = [np.tanh(blueprint.values(seen)) for seen in seen_nearby(blueprint, state)]
    return np.array(gears) * blueprint.largest_controls


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
