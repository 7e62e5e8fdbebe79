"""Games in all the arenas of a suite's part, by the names that files have for them: `suite-v1/train`, for example."""

import functools
from typing import Any

import jax.numpy as jnp
import numpy as np

from apollonius.arenas.suite import PARTS, SUITES, suite_arena, suite_names
from apollonius.errors import require
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.scenario import Makes, Scenario, together
from apollonius.game.starts import Starts

PAPERS_OWN = 16
"""Pairs of the paper's robots among those that are learned with,"""
OTHERS = 48
"""and pairs of others."""
NAMES = tuple(f"{suite}/{part}" for suite in SUITES for part in PARTS)
"""Of all scenarios."""


def scenario_game(name: str) -> Game:
    """The paper's rules in the arenas of a suite's part; errors as those of `find_scenario`.

    In `train` there are robots of many `makes`, and games begin nearer to walls and obstacles, so that the larger ones
    find a place.
    """
    starts = Starts(clearance=0.15) if name.endswith("/train") else Starts()
    return Game(starts=starts, scenario=find_scenario(name))


@functools.cache
def find_scenario(name: Any) -> Scenario:
    """The arenas of a part of a suite and, in `train`, the robots.

    Raises:
        InvalidInput: for an unknown name, and as `suite_arena`.
    """
    require(name in NAMES, "scenario", name, f"one of {', '.join(NAMES)}")
    suite, part = name.split("/")
    arenas = [suite_arena(suite, arena) for arena in suite_names(suite, part)]
    return Scenario(together(arenas), len(arenas), makes() if part == "train" else None, name)


def makes() -> Makes:
    """The paper's two robots a few times, and pairs of robots drawn at random around them, all log-uniformly.

    Each has a speed of 0.6 to 2 m/s, the evader's within a factor of 1.4 of the pursuer's; accelerates by 0.15 to
    1.2 m/s^2 and turns by 0.4 to 2 rad/s. Every other pair has bodies, with a radius of 0.05 to 0.25 m. One is caught
    when there are 0.2 to 0.4 m between them.
    """
    rng = np.random.default_rng(0)

    def drawn(low: float, high: float, paper: float) -> np.ndarray:
        some = np.exp(rng.uniform(np.log(low), np.log(high), OTHERS))
        return np.concatenate([np.full(PAPERS_OWN, paper), some]).astype(np.float32)

    pursuer_v = drawn(0.6, 2.0, 1.2)
    evader_v = np.clip(pursuer_v * drawn(1 / 1.4, 1.4, 1.0), 0.6, 2.0)

    def body(v: np.ndarray) -> Unicycle:
        u1, u2 = drawn(0.15, 1.2, 0.3), drawn(0.4, 2.0, 0.8)
        radius = drawn(0.05, 0.25, 0.0) * (np.arange(len(v)) % 2)
        return Unicycle(jnp.zeros(len(v)), *(jnp.asarray(leaf, jnp.float32) for leaf in (v, u1, u2, radius)))

    pursuer, evader = body(pursuer_v), body(evader_v)
    capture = jnp.asarray(drawn(0.2, 0.4, 0.3)) + pursuer.radius + evader.radius
    return Makes(pursuer, evader, capture)
