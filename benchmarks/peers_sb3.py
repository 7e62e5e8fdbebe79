"""Stable-Baselines3 in the `paper` game, for `time_to_96.py`: its DQN and its PPO, many games at a
time.
"""

# pyright: reportMissingImports=false, reportUntypedBaseClass=false

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from apollonius import Reward

HIDDEN = [96, 96, 96]
STEPS = 100_000_000
"""More than any training takes."""


def still_evaders(games: int) -> "Games":
    """Make many games of pursuers with standing evaders."""
    return Games(
        gymnasium.make_vec(
            "apollonius.envs.gymnasium:apollonius/Pursuit-v0",
            num_envs=games,
            vectorization_mode="vector_entry_point",
            opponent="still",
            observation="encoded",
            reward=Reward(capture=1.0, failure=1.0, progress=0.3),
        )
    )


class Games(VecEnv):
    """Games of a vector environment, by Stable-Baselines3's own interface."""

    def __init__(self, games: Any) -> None:
        self.games = games
        spaces = games.single_observation_space, games.single_action_space
        super().__init__(games.num_envs, *spaces)

    def reset(self) -> np.ndarray:
        observations, _ = self.games.reset(seed=self.first)
        return np.asarray(observations)

    first = 0

    def seed(self, seed: int | None = None) -> list[int | None]:
        self.first = seed or 0
        return [seed] * self.num_envs

    def step_async(self, actions: np.ndarray) -> None:
        self.actions = actions

    def step_wait(self) -> Any:
        observations, rewards, terminated, truncated, infos = self.games.step(self.actions)
        over = np.asarray(terminated | truncated)
        details: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(over):
            details[index]["terminal_observation"] = np.asarray(infos["final_obs"][index])
            details[index]["TimeLimit.truncated"] = bool(truncated[index] and not terminated[index])
        return np.asarray(observations), np.asarray(rewards), over, details

    def close(self) -> None:
        self.games.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **options: Any
    ) -> list[Any]:
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs


class Evaluations(BaseCallback):
    """Calls the watch after every step of the games, until it says stop."""

    def __init__(self, watch: Any, network: Callable[[], Any]) -> None:
        super().__init__()
        self.watch = watch
        self.network = network

    def _on_step(self) -> bool:
        return not self.watch(self.num_timesteps, self.network())


def layers_of(*modules: torch.nn.Module) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return weights and biases of all linear layers in their order."""
    linear = [
        layer
        for module in modules
        for layer in module.modules()
        if isinstance(layer, torch.nn.Linear)
    ]
    return [
        (layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy())
        for layer in linear
    ]


def _train(
    learner: BaseAlgorithm,
    activation: str,
    modules: Callable[[], Sequence[torch.nn.Module]],
    watch: Any,
) -> None:
    learner.learn(STEPS, callback=Evaluations(watch, lambda: (activation, layers_of(*modules()))))


def train_dqn(seed: int, watch: Any) -> None:
    """Train DQN with three-step returns in 32 games."""
    torch.set_num_threads(1)
    learner = DQN(
        "MlpPolicy",
        still_evaders(32),
        learning_rate=1e-3,
        buffer_size=500_000,
        batch_size=256,
        learning_starts=10_000,
        train_freq=1,
        gradient_steps=1,
        n_steps=3,
        target_update_interval=4_000,
        exploration_fraction=500_000 / STEPS,
        exploration_final_eps=0.02,
        seed=seed,
        policy_kwargs={"net_arch": HIDDEN},
        device="cpu",
    )
    _train(learner, "relu", lambda: [learner.q_net.q_net], watch)


def train_ppo(seed: int, watch: Any) -> None:
    """Train PPO in 256 games."""
    torch.set_num_threads(1)
    learner = PPO(
        "MlpPolicy",
        still_evaders(256),
        learning_rate=1e-3,
        n_steps=32,
        batch_size=2_048,
        n_epochs=4,
        ent_coef=0.01,
        seed=seed,
        policy_kwargs={"net_arch": {"pi": HIDDEN, "vf": HIDDEN}},
        device="cpu",
    )
    policy = learner.policy
    _train(learner, "tanh", lambda: [policy.mlp_extractor.policy_net, policy.action_net], watch)
