"""The games in which outside agents train, and the agents that their networks make."""

import functools
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import apollonius
from apollonius import BySide, Role
from apollonius.agents.network import QNetwork
from apollonius.agents.policy import Memory
from apollonius.agents.store import Agent, describe
from apollonius.arenas.file import to_dict
from apollonius.game.types import NUM_ACTIONS, Action, RandomBits

GAME = apollonius.make_game("paper")
OBSERVATION = apollonius.find_observation("encoded")
ENV_STEPS = 102_400
"""Of each training."""
GAMES = 64
"""Played at a time."""
ROLLOUT = 32
"""Steps of every game between two updates of an on-policy learner."""
BATCH = 512
"""Steps of a gradient of PPO, a quarter of a rollout."""
BUFFER = 131_072
"""Env steps that DQN keeps, where its library names no number."""
EXPLORATION = 0.1
"""Share of a training in which random actions become rare, where its library names none."""
LEAST_RANDOM = 0.05
"""Probability of a random action after that."""
HIDDEN = (128, 128)
"""Units of the hidden layers, with ReLU."""
REWARD = apollonius.Reward(capture=1.0, failure=1.0, progress=0.3)
"""The paper's, divided by ten."""
OPPONENTS = BySide(pursuer=("still", "flee-aware"), evader=("pure-pursuit", "P_curriculum"))
"""Against whom a side trains: an easy and a difficult one, each in half of the games."""
Layers = Sequence[tuple[Any, Any]]
"""Weights `[out, in]` and biases `[out]` of a network whose largest output is the action."""


class EitherOpponent(apollonius.AbstractPolicy):
    """One of two players, drawn at the start of each game."""

    first: apollonius.AbstractPolicy
    second: apollonius.AbstractPolicy

    @property
    def memory(self) -> Memory:
        return jnp.int32(-1), self.first.memory, self.second.memory

    def __call__(self, observation: Any, memory: Memory, bits: RandomBits) -> tuple[Action, Memory]:
        choice, *memories = memory
        drawn = (bits >> 16 & 1).astype(jnp.int32)
        choice = jnp.where(choice < 0, drawn, choice)
        players = (self.first, self.second)
        (action, memory_of_first), (other_action, memory_of_second) = (
            player(player.observation(observation), own_memory, bits)
            for player, own_memory in zip(players, memories, strict=True)
        )
        action = jnp.where(choice == 0, action, other_action)
        return action, (choice, memory_of_first, memory_of_second)


def opponent_of(role: Role) -> EitherOpponent:
    """Return the opponent of a side's trainings."""
    names = OPPONENTS[role]
    return EitherOpponent(
        *(apollonius.find_player(name, role.other, GAME).policy for name in names)
    )


@functools.cache
def make_games(role: Role) -> Any:
    """Make the vector environment in which a side trains, compiled; all trainings of a process
    share it, so each begins with a reset.
    """
    name = BySide("Pursuit", "Evasion")[role]
    games = gymnasium.make_vec(
        f"apollonius.envs.gymnasium:apollonius/{name}-v0",
        num_envs=GAMES,
        vectorization_mode="vector_entry_point",
        opponent=opponent_of(role),
        observation="encoded",
        reward=REWARD,
    )
    games.reset(seed=0)
    games.step(np.zeros(GAMES, int))
    return games


def network_of(layers: Layers) -> QNetwork:
    """Return the package's network with these weights; the largest of logits or action values is
    the action.

    Raises:
        ValueError: For layers that do not fit each other, the observation or the actions.
    """
    sizes = [OBSERVATION.size, *(len(bias) for _, bias in layers)]
    shapes = [np.shape(weight) for weight, _ in layers]
    if shapes != list(zip(sizes[1:], sizes, strict=False)) or sizes[-1] != NUM_ACTIONS:
        raise ValueError(f"weights of shapes {shapes}, which make no action of an observation")
    return QNetwork(tuple(_linear(*layer) for layer in layers), OBSERVATION)


def _linear(weight: Any, bias: Any) -> eqx.nn.Linear:
    outputs, inputs = np.shape(weight)
    blank = eqx.nn.Linear(inputs, outputs, key=jax.random.key(0))
    weights: tuple[Array, Array] = jnp.asarray(weight, float), jnp.asarray(bias, float)
    return eqx.tree_at(lambda layer: (layer.weight, layer.bias), blank, weights)


def agent_of(layers: Layers, role: Role, training: dict[str, Any]) -> Agent:
    """Return the agent of a network, with a record of its training."""
    return describe(network_of(layers), role, to_dict(GAME), training)
