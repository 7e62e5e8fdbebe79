"""Rejax, which is PureJaxRL's learners as a library: its PPO and its DQN with their defaults."""

# pyright: reportMissingImports=false, reportUntypedBaseClass=false

import functools
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import rejax
from gymnax.environments import spaces
from gymnax.environments.environment import Environment, EnvParams
from jaxtyping import Array, Int, PRNGKeyArray
from rejax.networks import DiscreteQNetwork, EpsilonGreedyPolicy

import apollonius
from apollonius import Role
from apollonius.agents.policy import Memory
from apollonius.game.types import NUM_ACTIONS
from benchmarks.entrants.game import (
    BATCH,
    ENV_STEPS,
    GAME,
    GAMES,
    HIDDEN,
    OBSERVATION,
    REWARD,
    ROLLOUT,
    Layers,
    opponent_of,
)

STARTS = 8192
"""From which a training draws."""


class Running(NamedTuple):
    """A game under way and the memory of the opponent."""

    state: apollonius.GameState
    memory: Memory


class OneGame(Environment):
    """A game from one side, by the interface of gymnax that Rejax calls."""

    def __init__(self, role: Role) -> None:
        self.role = role
        self.game = replace(GAME, reward=REWARD)
        self.opponent = opponent_of(role)
        self.starts = apollonius.reset_batch(self.game, jax.random.key(0), STARTS)

    def reset(self, key: PRNGKeyArray, params: Any = None) -> tuple[Array, Running]:
        number = jax.random.randint(key, (), 0, STARTS)
        state = jax.tree.map(lambda leaf: leaf[number], self.starts)
        return self._observation(state), Running(state, self.opponent.memory)

    def step(
        self, key: PRNGKeyArray, state: Running, action: Int[Array, ""], params: Any = None
    ) -> tuple[Array, Running, Array, Array, dict[str, Any]]:
        start_key, key = jax.random.split(key)
        view = apollonius.look(self.game, state.state, self.role.other)
        answer, memory = self.opponent(view, state.memory, jax.random.bits(key))
        sides = (action, answer) if self.role is Role.PURSUER else (answer, action)
        after = self.game.step(state.state, *sides)
        over = after.terminated | after.truncated
        first = self.reset(start_key)
        running = self._observation(after.state), Running(after.state, memory)
        observation, running = jax.tree.map(
            lambda new, old: jnp.where(over, new, old), first, running
        )
        return observation, running, after.reward[self.role], over, {}

    def _observation(self, state: apollonius.GameState) -> Array:
        return OBSERVATION(apollonius.look(self.game, state, self.role))

    def observation_space(self, params: Any) -> spaces.Box:
        return spaces.Box(-np.inf, np.inf, (OBSERVATION.size,))

    def action_space(self, params: Any = None) -> spaces.Discrete:
        return spaces.Discrete(NUM_ACTIONS)


def _make(algorithm: Any, role: Role, **options: Any) -> Any:
    """Make a learner; it is judged elsewhere, not while it trains."""
    return algorithm.create(
        env=OneGame(role),
        env_params=EnvParams(int(GAME.max_steps)),
        total_timesteps=ENV_STEPS,
        eval_freq=ENV_STEPS,
        skip_initial_evaluation=True,
        num_envs=GAMES,
        **options,
    ).replace(eval_callback=lambda algorithm, state, key: ())


def _dense(*modules: Any) -> Layers:
    return [(np.asarray(module["kernel"]).T, np.asarray(module["bias"])) for module in modules]


@functools.cache
def _ppo(role: Role) -> Any:
    learner = _make(
        rejax.PPO,
        role,
        num_steps=ROLLOUT,
        num_minibatches=GAMES * ROLLOUT // BATCH,
        agent_kwargs={"hidden_layer_sizes": HIDDEN, "activation": "relu"},
    )
    return jax.jit(learner.train)


@functools.cache
def _dqn(role: Role) -> Any:
    """Return the training of DQN; the width of its network is no option, so it is replaced."""
    network = EpsilonGreedyPolicy(DiscreteQNetwork)(
        hidden_layer_sizes=HIDDEN, action_dim=NUM_ACTIONS, activation=jax.nn.relu
    )
    return jax.jit(_make(rejax.DQN, role).replace(agent=network).train)


def ppo(role: Role, seed: int) -> Layers:
    state, _ = _ppo(role)(jax.random.key(seed))
    weights = state.actor_ts.params["params"]
    return _dense(*weights["features"].values(), weights["action_logits"])


def dqn(role: Role, seed: int) -> Layers:
    state, _ = _dqn(role)(jax.random.key(seed))
    return _dense(*state.q_ts.params["params"].values())
