"""The smallest training that still has everything in it: two stages of four chunks, seconds in all."""

from dataclasses import replace
from typing import Any

import jax

from apollonius.game.dynamics import Unicycle
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.learn import train_state
from apollonius.learn.config import RunConfig
from apollonius.learn.dqn import DQNConfig
from apollonius.learn.stage_config import Plan, SelfPlayConfig, StageConfig

CHUNK = 8192
"""Env steps of a chunk: 128 iterations of 64 games."""

start = jax.jit(train_state.start, static_argnums=0)
"""Of many small parts, which are compiled as one."""

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

STAGE = StageConfig(env_steps=4 * CHUNK, evaluations=4, evaluation_games=64)
PLAN = Plan(DQN, STAGE)
GAME = replace(
    make_game("one-large"),
    pursuer=Unicycle(v_min=0.6),
    evader=Unicycle(v_min=0.3),
    capture_distance=1.5,
    max_steps=100,
    starts=Starts(clearance=0.8, separation=2.5),
)
"""Neither robot can stop, so that all kinds of outcomes are common, though none within 8 steps of the start."""
RUN = RunConfig(game=GAME, dqn=DQN, fixed_target=STAGE, self_play=SelfPlayConfig(**vars(replace(STAGE, progress=1.0))))
STOPPING = replace(RUN, game=replace(GAME, pursuer=Unicycle(), evader=Unicycle()))
"""Of robots that can stop: no start at rest is lost, and shields can help."""
