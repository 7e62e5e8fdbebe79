"""Tianshou's double DQN, with its defaults where it has any."""

# pyright: reportMissingImports=false, reportUntypedBaseClass=false

from typing import Any

import numpy as np
import torch
from tianshou.algorithm import DQN
from tianshou.algorithm.modelfree.dqn import DiscreteQLearningPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import BaseVectorEnv
from tianshou.trainer import OffPolicyTrainerParams
from tianshou.utils.net.common import Net

from apollonius import Role
from benchmarks.entrants.game import (
    BUFFER,
    ENV_STEPS,
    EXPLORATION,
    GAMES,
    HIDDEN,
    LEAST_RANDOM,
    Layers,
    make_games,
)
from benchmarks.peers_sb3 import layers_of


class Games(BaseVectorEnv):
    """The games of a vector environment, by the interface that Tianshou's collectors call.

    They begin again by themselves; `reset` only tells what they began with.
    """

    def __init__(self, games: Any, seed: int) -> None:
        # Nothing of the parent's, whose workers hold a game each.
        self.games = games
        self.env_num = games.num_envs
        self.is_async = False
        self.is_closed = False
        self.workers = []
        self.first, _ = games.reset(seed=seed)

    def reset(self, env_id: Any = None, **options: Any) -> Any:
        numbers = np.arange(self.env_num) if env_id is None else np.asarray(env_id)
        return self.first[numbers], np.array([{} for _ in numbers])

    def step(self, action: Any, id: Any = None) -> Any:
        self.first, rewards, terminated, truncated, infos = self.games.step(np.asarray(action))
        observations = self.first.copy()
        over = terminated | truncated
        if over.any():
            observations[over] = infos["final_obs"][over]
        details = np.array([{"env_id": number} for number in range(self.env_num)])
        return observations, rewards, terminated, truncated, details

    def get_env_attr(self, key: str, id: Any = None) -> list[Any]:
        return [getattr(self.games, f"single_{key}", None)] * self.env_num

    def close(self) -> None:
        """Keep the games for the next training."""


def dqn(role: Role, seed: int) -> Layers:
    """Train DQN: a gradient step for every eighth env step, of 64 steps."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - which it draws from
    games = make_games(role)
    space = games.single_action_space
    network = Net(
        state_shape=games.single_observation_space.shape, action_shape=space.n, hidden_sizes=HIDDEN
    )
    policy = DiscreteQLearningPolicy(model=network, action_space=space)
    learner = DQN(policy=policy, optim=AdamOptimizerFactory(lr=1e-3), target_update_freq=320)
    buffer = VectorReplayBuffer(BUFFER, GAMES)
    collector = Collector(policy, Games(games, seed), buffer, exploration_noise=True)
    collector.reset()

    def explore(_epoch: int, env_steps: int) -> None:
        policy.set_eps_training(max(LEAST_RANDOM, 1 - env_steps / (EXPLORATION * ENV_STEPS)))

    learner.run_training(
        OffPolicyTrainerParams(
            training_collector=collector,
            max_epochs=1,
            epoch_num_steps=ENV_STEPS,
            collection_step_num_env_steps=GAMES,
            update_step_num_gradient_steps_per_sample=1 / 8,
            batch_size=64,
            training_fn=explore,
            verbose=False,
            show_progress=False,
        )
    )
    return layers_of(network)
