"""The smallest training that still has everything in it: two stages of four chunks, seconds in all."""

from dataclasses import replace
from typing import Any

import jax

from apollonius.game.dynamics import Unicycle
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.learn.config import RunConfig
from apollonius.learn.dqn import DQNConfig
from apollonius.learn.fixed_target import FixedTarget, FixedTargetConfig
from apollonius.learn.rollout_stage import RolloutStage
from apollonius.learn.self_play import SelfPlayConfig
from apollonius.learn.stage import NO_NETWORKS

CHUNK = 8192
"""Env steps of a chunk: 128 iterations of 64 games."""


@jax.jit
def start(stage: RolloutStage, key, networks=NO_NETWORKS):
    """The state before the first step: of many small parts, which are compiled as one."""
    return stage.init(key, networks)


SMALL: dict[str, Any] = {
    "observation": "paper",
    "width": 16,
    "depth": 1,
    "n_step": 3,
    "final_n_step": 2,
    "learning_rate": 1e-2,
    "averaging": 0.1,
    "batch": 16,
    "games": 64,
    "env_steps_per_update": 64,
    "replay_capacity": CHUNK,
}
"""What both algorithms share."""
DQN = DQNConfig(
    **SMALL,
    learning_starts=20_000,
    target_period=3 * CHUNK,
    exploration_fraction=0.25,
    final_epsilon=0.0,
)
"""The replay holds one chunk. Play explores in the first chunk only; learning begins in the third."""

STAGE = FixedTargetConfig(env_steps=4 * CHUNK, evaluations=4, evaluation_games=64)
SELF_PLAY = SelfPlayConfig(env_steps=4 * CHUNK, evaluations=4, evaluation_games=64, pursuer_epsilon=1.0)
GAME = replace(
    make_game("one-large"),
    pursuer=Unicycle(v_min=0.6),
    evader=Unicycle(v_min=0.3),
    capture_distance=1.5,
    max_steps=100,
    starts=Starts(clearance=0.8, separation=2.5),
)
"""Neither robot can stop, so that all kinds of outcomes are common, though none within 8 steps of the start."""
RUN = RunConfig(game=GAME, algorithm=DQN, stages=(STAGE, SELF_PLAY))
STOPPING = replace(RUN, game=replace(GAME, pursuer=Unicycle(), evader=Unicycle()))
"""Of robots that can stop: no start at rest is lost, and shields can help."""


def make_stage(config=STAGE, algorithm=DQN, game=GAME) -> FixedTarget:
    """A stage in the game, by default the first."""
    return config.make(algorithm, game)
