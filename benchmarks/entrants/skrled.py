"""skrl's PPO and DQN, with their defaults where they have any."""

# pyright: reportMissingImports=false, reportUntypedBaseClass=false

import tempfile
from typing import Any

import torch
from skrl.agents.torch.dqn import DQN, DQN_CFG
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import CategoricalMixin, DeterministicMixin, Model
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed

from apollonius import Role
from apollonius.game.types import NUM_ACTIONS
from benchmarks.entrants.game import (
    BATCH,
    BUFFER,
    ENV_STEPS,
    EXPLORATION,
    GAMES,
    LEAST_RANDOM,
    ROLLOUT,
    Layers,
    make_games,
)
from benchmarks.entrants.torch_networks import make_layers
from benchmarks.peers_sb3 import layers_of


class Actor(CategoricalMixin, Model):
    """Logits of the actions."""

    def __init__(self, **spaces: Any) -> None:
        Model.__init__(self, **spaces)
        CategoricalMixin.__init__(self)
        self.layers = make_layers(NUM_ACTIONS)

    def compute(self, inputs: dict[str, Any], role: str = "") -> Any:
        return self.layers(inputs["observations"]), {}


class Values(DeterministicMixin, Model):
    """The value of an observation, or of each action."""

    def __init__(self, outputs: int, **spaces: Any) -> None:
        Model.__init__(self, **spaces)
        DeterministicMixin.__init__(self)
        self.layers = make_layers(outputs)

    def compute(self, inputs: dict[str, Any], role: str = "") -> Any:
        return self.layers(inputs["observations"]), {}


def _train(learner: Any, games: Any) -> None:
    options = {
        "timesteps": ENV_STEPS // GAMES,
        "headless": True,
        "disable_progressbar": True,
        "close_environment_at_exit": False,
    }
    SequentialTrainer(env=games, agents=learner, cfg=options).train()


def _start(role: Role, seed: int) -> tuple[Any, dict[str, Any]]:
    """Return the games of a side and the arguments that describe them."""
    torch.set_num_threads(1)
    set_seed(seed)
    games = wrap_env(make_games(role), wrapper="gymnasium")
    spaces = {"observation_space": games.observation_space, "action_space": games.action_space}
    return games, spaces | {"device": "cpu"}


def _silent(config: Any) -> Any:
    config.experiment.write_interval = 0
    config.experiment.checkpoint_interval = 0
    config.experiment.directory = tempfile.gettempdir()
    return config


def ppo(role: Role, seed: int) -> Layers:
    games, spaces = _start(role, seed)
    actor = Actor(**spaces)
    learner = PPO(
        models={"policy": actor, "value": Values(1, **spaces)},
        memory=RandomMemory(memory_size=ROLLOUT, num_envs=GAMES, device="cpu"),
        cfg=_silent(PPO_CFG(rollouts=ROLLOUT, mini_batches=GAMES * ROLLOUT // BATCH)),
        **spaces,
    )
    _train(learner, games)
    return layers_of(actor.layers)


def dqn(role: Role, seed: int) -> Layers:
    """Train DQN: a gradient step, of 64 env steps, for each step of all games."""
    games, spaces = _start(role, seed)
    values = Values(NUM_ACTIONS, **spaces)
    learner = DQN(
        models={"q_network": values, "target_q_network": Values(NUM_ACTIONS, **spaces)},
        memory=RandomMemory(memory_size=BUFFER // GAMES, num_envs=GAMES, device="cpu"),
        cfg=_silent(DQN_CFG(exploration_scheduler=_random_share)),
        **spaces,
    )
    _train(learner, games)
    return layers_of(values.layers)


def _random_share(step: int, steps: int) -> float:
    return max(LEAST_RANDOM, 1 - step / (EXPLORATION * steps))
