"""OpenSpiel's PPO, which is CleanRL's single file, with its defaults."""

# pyright: reportMissingImports=false, reportUntypedBaseClass=false

from typing import Any, NamedTuple

import numpy as np
import torch
from open_spiel.python.pytorch.ppo import PPO, PPOAgent, layer_init

from apollonius import Role
from apollonius.game.types import NUM_ACTIONS
from benchmarks.entrants.game import ENV_STEPS, GAMES, OBSERVATION, ROLLOUT, Layers, make_games
from benchmarks.entrants.torch_networks import make_layers
from benchmarks.peers_sb3 import layers_of

LEARNING_RATE = 2.5e-4


class Step(NamedTuple):
    """What a learner of OpenSpiel sees of a game."""

    observations: dict[str, Any]


class Agent(PPOAgent):
    """The agent of OpenSpiel, as wide as all entrants."""

    def __init__(self, num_actions: int, observation_shape: tuple[int, ...], device: str) -> None:
        super().__init__(num_actions, observation_shape, device)
        self.actor = make_layers(num_actions, layer_init)
        self.critic = make_layers(1, layer_init)


def ppo(role: Role, seed: int) -> Layers:
    """Train as its example does: the learning rate falls to 0."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    np.random.seed(seed)  # noqa: NPY002 - which it draws from
    games = make_games(role)
    learner = PPO(
        (OBSERVATION.size,),
        NUM_ACTIONS,
        num_players=1,
        num_envs=GAMES,
        steps_per_batch=ROLLOUT,
        learning_rate=LEARNING_RATE,
        agent_fn=Agent,
    )
    steps = _steps(games.reset(seed=seed)[0])
    updates = ENV_STEPS // (GAMES * ROLLOUT)
    for update in range(updates):
        learner.optimizer.param_groups[0]["lr"] = LEARNING_RATE * (1 - update / updates)
        for _ in range(ROLLOUT):
            actions = np.array([output.action for output in learner.step(steps)])
            observations, rewards, terminated, truncated, _ = games.step(actions)
            learner.post_step(rewards, terminated | truncated)
            steps = _steps(observations)
        learner.learn(steps)
    return layers_of(learner.network.actor)


def _steps(observations: np.ndarray) -> list[Step]:
    actions = [list(range(NUM_ACTIONS))]
    return [Step({"info_state": [row], "legal_actions": actions}) for row in observations]
