"""Games in many arenas of a suite, by the names that files have for them: `suite-v1/train`, for example."""

import functools
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from apollonius.arenas.names import PARTS, SUITES
from apollonius.arenas.suite import suite_arena, suite_names
from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.scenario import Makes, Scenario, together
from apollonius.game.starts import Starts

PAPERS_OWN = 16
"""Pairs of the paper's robots among those that are learned with,"""
OTHERS = 48
"""and pairs of others."""


def is_scenario(name: str) -> bool:
    """Whether a name is one of a part of a suite, or lists several of its arenas."""
    suite, _, within = name.partition("/")
    return suite in SUITES and (within in PARTS or "," in within)


def scenario_game(name: str) -> Game:
    """The paper's rules in the arenas of a suite's part, or in some of its arenas; errors as those of `find_scenario`.

    In `train` there are robots of many `makes`, and games begin nearer to walls and obstacles, so that the larger ones
    find a place.
    """
    starts = Starts(clearance=0.15) if name.endswith("/train") else Starts()
    return Game(starts=starts, scenario=find_scenario(name))


@functools.cache
def find_scenario(name: Any) -> Scenario:
    """The arenas of a part of a suite and, in `train`, the robots; or the arenas of a list, `suite-v1/maze-00,maze-01`.

    Raises:
        InvalidInput: for an unknown name, and as `suite_arena`.
    """
    arenas = _arenas(name)
    return Scenario(together(arenas), len(arenas), makes() if name.endswith("/train") else None, name)


def each_alone(game: Game) -> list[Game]:
    """The game in each of the arenas of its scenario, as if there were no other; itself where there is none.

    Raises:
        InvalidInput: for a scenario without a name, and as `find_scenario`.
    """
    if game.scenario is None:
        return [game]
    return [replace(game, arena=arena, scenario=None) for arena in _arenas(game.scenario.name)]


def _arenas(name: Any) -> list[Arena]:
    return [suite_arena(*one.split("/")) for one in arena_names(name)]


def arena_names(name: Any) -> list[str]:
    """Return the names of the arenas of a scenario, as `suite-v1/maze-00`; errors as those of `find_scenario`."""
    some = [f"{suite}/{part}" for suite in SUITES for part in PARTS]
    known = isinstance(name, str) and is_scenario(name)
    require(known, "scenario", name, f"one of {', '.join(some)}, or some arenas, as '{SUITES[0]}/maze-00,maze-01'")
    suite, within = name.split("/")
    names = suite_names(suite, within) if within in PARTS else within.split(",")
    return [f"{suite}/{arena}" for arena in names]


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
