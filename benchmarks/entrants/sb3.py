"""Stable-Baselines3's PPO, A2C and DQN with their defaults."""

# pyright: reportMissingImports=false

from typing import Any

import torch
from stable_baselines3 import A2C, DQN, PPO

from apollonius import Role
from benchmarks.entrants.game import BATCH, ENV_STEPS, GAMES, HIDDEN, ROLLOUT, Layers, make_games
from benchmarks.peers_sb3 import Games, layers_of


def _train(algorithm: Any, role: Role, seed: int, net_arch: Any, **options: Any) -> Any:
    torch.set_num_threads(1)
    learner = algorithm(
        "MlpPolicy",
        Games(make_games(role)),
        seed=seed,
        policy_kwargs={"net_arch": net_arch, "activation_fn": torch.nn.ReLU},
        device="cpu",
        **options,
    )
    return learner.learn(ENV_STEPS).policy


def _actor(algorithm: Any, role: Role, seed: int, **options: Any) -> Layers:
    net_arch = {"pi": [*HIDDEN], "vf": [*HIDDEN]}
    policy = _train(algorithm, role, seed, net_arch, **options)
    return layers_of(policy.mlp_extractor.policy_net, policy.action_net)


def ppo(role: Role, seed: int) -> Layers:
    return _actor(PPO, role, seed, n_steps=ROLLOUT, batch_size=BATCH)


def a2c(role: Role, seed: int) -> Layers:
    return _actor(A2C, role, seed)


def dqn(role: Role, seed: int) -> Layers:
    """Train DQN, which learns from eight steps for each env step, as by default, but from 128 at
    a time.
    """
    options = {"train_freq": 1, "gradient_steps": GAMES // 16, "batch_size": 128}
    policy = _train(DQN, role, seed, [*HIDDEN], **options)
    return layers_of(policy.q_net.q_net)
