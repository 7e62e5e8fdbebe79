"""Deep Q-learning (section II-B): its numbers, targets, loss (Eq. 3), one update."""

from dataclasses import dataclass
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.network import QNetwork, interpolate_weights, make_network
from apollonius.agents.trained import EpsilonGreedy, Greedy
from apollonius.game.types import Scalar, tree_where
from apollonius.io.errors import require_positive, require_within
from apollonius.learn.algorithm import descend, interpolate_linearly
from apollonius.learn.replay_algorithm import ReplayAlgorithm
from apollonius.learn.replay_buffer import TransitionBatch


class DQNLearner(eqx.Module):
    """One side's networks and optimiser. `updates` counts the updates so far.

    `average` is the running average of the network's weights (Polyak averaging), which plays in
    evaluations.
    """

    network: QNetwork
    target: QNetwork
    average: QNetwork
    optimiser: optax.OptState
    updates: Int[Array, ""]


_adam = optax.scale_by_adam()


def q_target(
    reward: Scalar, discount: Scalar, next_values: Float[Array, "9"], next_choice: Float[Array, "9"]
) -> Scalar:
    """Return `reward + discount * Q_target(s', a*)` (Eq. 3); the discount is 0 where the game ended
    by its rules.

    `a*` is the best action by `next_choice`, the target network's values (Eq. 3) or the online
    network's (double).
    """
    return reward + discount * next_values[jnp.argmax(next_choice)]


def loss(network: QNetwork, target: QNetwork, batch: TransitionBatch, double: bool) -> Scalar:
    """Return the mean squared temporal-difference error of a batch (Eq. 3)."""
    values = network.batch(batch.observation)
    next_values = target.batch(batch.next_observation)
    next_choice = network.batch(batch.next_observation) if double else next_values
    targets = jax.vmap(q_target)(batch.reward, batch.discount, next_values, next_choice)
    chosen = jnp.take_along_axis(values, batch.action[:, None], axis=1)[:, 0]
    errors = (jax.lax.stop_gradient(targets) - chosen) ** 2
    return jnp.mean(jnp.where(batch.active, errors, 0.0))


def adam_step(
    learner: DQNLearner, gradient: Any, learning_rate: Scalar, averaging: float
) -> DQNLearner:
    """Return the learner after one step of Adam along a gradient; the averaged weights go towards
    the network.
    """
    direction, optimiser = _adam.update(gradient, learner.optimiser)
    network = descend(learner.network, direction, learning_rate)
    average = network
    if averaging < 1:
        average = interpolate_weights(learner.average, network, averaging)
    return DQNLearner(network, learner.target, average, optimiser, learner.updates + 1)


@dataclass(frozen=True)
class DQNConfig(ReplayAlgorithm):
    """Deep Q-learning (section II-B), for the nine discrete actions."""

    kind: Literal["dqn"] = "dqn"
    network = QNetwork
    double: bool = True
    """Let the online network choose and the target network value the next action (double
    Q-learning).
    """
    target_period: int = 128_000
    """Env steps between two copies of the network to the target network (C in Algorithms 1 and 2).
    """
    final_epsilon: float = 0.02
    """Share of random actions once exploration has settled."""
    exploration_fraction: float = 0.2
    """Part of a stage over which the share of random actions falls to its final value."""
    exploration_steps: int | None = None
    """Env steps over which it falls, in place of a part of the stage."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "target_period")
        require_within(self, 0, 1, "final_epsilon", "exploration_fraction")
        if self.exploration_steps is not None:
            require_positive(self, "exploration_steps")

    def explorer(self, network: QNetwork, exploration: Scalar) -> EpsilonGreedy:
        """Return the epsilon-greedy player (Algorithm 1, line 7)."""
        return EpsilonGreedy(Greedy(network), exploration)

    def exploration(self, first: float, stage_env_steps: int, env_steps: Int[Array, ""]) -> Scalar:
        """Return the share of random actions, which falls from `first` to `final_epsilon`."""
        over = self.exploration_steps or self.exploration_fraction * stage_env_steps
        return interpolate_linearly(first, self.final_epsilon, over, env_steps)

    def init_learner(self, key: PRNGKeyArray, network: Any = None) -> DQNLearner:
        first = network or make_network(
            self.observation, self.width, self.depth, key, self.symmetric
        )
        own, target, average = (jax.tree.map(jnp.copy, first) for _ in range(3))
        optimiser = _adam.init(eqx.filter(own, eqx.is_array))
        return DQNLearner(own, target, average, optimiser, jnp.zeros((), jnp.int32))

    def update(
        self, learner: DQNLearner, batch: TransitionBatch, learning_rate: Scalar, key: PRNGKeyArray
    ) -> tuple[DQNLearner, Scalar]:
        """Return the learner after one step of Adam on a batch, and the loss before it; no key is
        needed.
        """
        value, gradient = eqx.filter_value_and_grad(loss)(
            learner.network, learner.target, batch, self.double
        )
        return adam_step(learner, gradient, learning_rate, self.averaging), value

    def end_iteration(self, learner: DQNLearner, env_steps: Int[Array, ""]) -> DQNLearner:
        """Copy the network to the target network where that is due (Algorithm 1, line 11)."""
        before = env_steps - self.env_steps_per_iteration
        due = env_steps // self.target_period > before // self.target_period
        target = tree_where(due, learner.network, learner.target)
        return eqx.tree_at(lambda changed: changed.target, learner, target)


PROFILES: dict[str, DQNConfig] = {
    "fast": DQNConfig(),
    "paper": DQNConfig(
        observation="paper",
        double=False,
        n_step=1,
        final_n_step=1,
        learning_rate=1e-4,
        final_learning_rate=1e-4,
        batch=32,
        env_steps_per_update=1,
        averaging=1.0,
        target_period=30_000,
        games=1,
        replay_capacity=1_000_000,
        learning_starts=50_000,
        final_epsilon=0.1,
        exploration_steps=500_000,
    ),
}
"""`fast`: the default. `paper`: plain DQN as printed (Eq. 3, section IV, Algorithms 1 and 2).

Where the paper is silent, replay, first update and last exploration are those of the work that it
cites for DQN (Mnih et al., "Human-level control through deep reinforcement learning", 2015). The
target is copied every 30,000 updates, there every 10,000.
"""
