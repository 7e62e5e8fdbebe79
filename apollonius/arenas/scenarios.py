"""Games in many arenas by robots of many makes, by the names that files have for them."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from apollonius.errors import require
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.scenario import Makes, Scenario, together
from apollonius.game.starts import Starts

PAPERS_OWN = 16
MAKES = 48


def find_scenario(name: Any) -> Scenario:
    import json

    from apollonius.arenas.random_arena import random_arena

    require(name == "suite-v1/train", "scenario", name, "suite-v1/train")
    entries = json.load(open("/root/near/suite_train.json"))
    arenas = [random_arena(e["kind"], e["seed"], gap=e["gap"], width=e["width"], height=e["height"]) for e in entries]
    return Scenario(together(arenas), len(arenas), makes(), name)


def makes() -> Makes:
    """The paper's two robots a few times, and pairs of robots drawn at random around them.

    Each has a speed of 0.6 to 2 m/s, the evader's within a factor of 1.4 of the pursuer's; accelerates by 0.15 to
    1.2 m/s^2, turns by 0.4 to 2 rad/s, and has a radius of at most 0.25 m. One is caught 0.2 to 0.4 m from where
    the bodies touch.
    """
    rng = np.random.default_rng(0)

    def drawn(low: float, high: float, paper: float) -> np.ndarray:
        some = np.exp(rng.uniform(np.log(low), np.log(high), MAKES))
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


def training_game() -> Game:
    """The paper's rules with the arenas and robots of `suite-v1/train`, and starts nearer to the walls."""
    return Game(starts=Starts(clearance=0.15), scenario=find_scenario("suite-v1/train"))
