"""Proximal policy optimisation (Schulman et al., 2017): its numbers, advantages, loss, one update.

The network's values of the nine actions, taken as logits, are a policy that draws its actions;
where it counts, the best one is played. In an update no action becomes much more or less likely
than in the games that it is learned from.

Where both sides learn, a **magnet** keeps them from chasing each other round: a copy of the
network, renewed now and then, from which the policy departs at a price (Yu et al., "NashPG: A
policy gradient method with iteratively refined regularization for finding Nash equilibria", 2026).
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.agents.network import (
    Layers,
    Network,
    QNetwork,
    apply_to_batch,
    make_layers,
    make_network,
)
from apollonius.agents.trained import SamplingPolicy
from apollonius.game.game import Game
from apollonius.game.types import Real, Scalar, tree_where
from apollonius.io.errors import require, require_positive, require_within
from apollonius.io.limits import TRANSITIONS
from apollonius.learn.algorithm import Algorithm, LearningSide, descend, interpolate_linearly
from apollonius.learn.replay_buffer import Row

_adam, _critic_adam = (
    optax.chain(optax.clip_by_global_norm(most), optax.scale_by_adam()) for most in (0.5, 1.0)
)


class PPOLearner(eqx.Module):
    """One side's network, whose values are logits, the critic of its observations, the magnet if
    there is one, and the optimisers.

    `updates` counts the updates so far.
    """

    network: QNetwork
    critic: Layers
    magnet: QNetwork | None
    optimiser: optax.OptState
    critic_optimiser: optax.OptState
    updates: Int[Array, ""]

    @property
    def average(self) -> QNetwork:
        """The network itself: a round changes it little."""
        return self.network


@dataclass(frozen=True)
class PPOConfig(Algorithm):
    """Proximal policy optimisation (Schulman et al., 2017), for the nine discrete actions."""

    kind: Literal["ppo"] = "ppo"
    network = QNetwork
    reads_next_observation = False
    on_policy = True
    observation: str = "egocentric"
    gamma: float = 0.998
    learning_rate: float = 2e-4
    final_learning_rate: float = 1e-5
    batch: int = 4096
    games: int = 256
    steps: int = 128
    """Steps that every game plays in a round, after which all transitions are learned from."""
    epochs: int = 2
    """Times that a round learns from each transition."""
    clip: float = 0.2
    """Change of an action's probability, as a share, beyond which an update gains nothing."""
    trace: float = 0.95
    """Decay of a step in the estimate of advantages (lambda: Schulman et al., 2016)."""
    entropy: float = 1e-3
    """Weight of the entropy of actions."""
    hold: float = 1.0
    """Steps for which the random number that chooses an action is held, on average."""
    temperature: float = 3e-3
    """Difference between two actions of the first network [lost games] that makes one e times as
    likely: for one whose values lie closer together, a lower one.
    """
    critic_learning_rate: float = 5e-4
    """Adam's step size for the critic, at the start of a stage."""
    critic_first: int = 15
    """Rounds in which the critic alone learns: it begins from random weights."""
    magnet: float = 0.0
    """Weight of the divergence from the magnet; 0 for no magnet."""
    magnet_rounds: int = 25
    """Rounds after which the magnet becomes a copy of the network."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_within(self, 1, 256, "hold")
        require_within(self, 1e-9, 10**9, "temperature")
        require_positive(self, "steps", "epochs", "clip", "critic_learning_rate", "magnet_rounds")
        require_within(self, 0, 10**9, "magnet")
        require_within(self, 0, 1, "clip", "trace", "entropy", "critic_learning_rate")
        require_within(self, 0, 2**31 - 1, "critic_first")
        TRANSITIONS.require("games x steps", self.env_steps_per_iteration)
        whole = self.env_steps_per_iteration % self.batch == 0
        require(
            whole,
            "batch",
            self.batch,
            f"a divisor of games x steps = {self.env_steps_per_iteration:,}",
        )

    @property
    def steps_per_iteration(self) -> int:
        return self.steps

    @property
    def iterations_per_chunk(self) -> int:
        return 1

    def reward_unit(self, game: Game) -> Real:
        """Return the reward of a capture."""
        return game.reward.capture if game.reward.profile == "paper" else 1.0

    def loss_value(self, failure: float) -> float:
        """Return the value of a lost game in the logits, whatever it costs in training."""
        return 1 / self.temperature

    def init_side(
        self, key: PRNGKeyArray, network: Network | None, robots: int
    ) -> LearningSide[PPOLearner]:
        network_key, critic_key = jax.random.split(key)
        return LearningSide(self.init_learner(network_key, critic_key, network))

    def init_learner(
        self, network_key: PRNGKeyArray, critic_key: PRNGKeyArray, network: Any = None
    ) -> PPOLearner:
        """Make a learner that starts from a copy of a network, or from random weights; its critic,
        two layers as wide as the network's, begins from random weights. Both keys are consumed.
        """
        first = network or make_network(
            self.observation, self.width, self.depth, network_key, self.symmetric
        )
        own = jax.tree.map(jnp.copy, first)
        critic = make_layers([first.observation.size, self.width, self.width, 1], critic_key)
        return PPOLearner(
            own,
            critic,
            jax.tree.map(jnp.copy, first) if self.magnet else None,
            _adam.init(eqx.filter(own, eqx.is_array)),
            _critic_adam.init(eqx.filter(critic, eqx.is_array)),
            jnp.zeros((), jnp.int32),
        )

    def explorer(self, network: QNetwork, exploration: Scalar) -> SamplingPolicy:
        return self.sampler(network)

    def sampler(self, network: QNetwork, clearance_margin: float = 0.0) -> SamplingPolicy:
        """Return the player that draws its actions."""
        return SamplingPolicy(network, clearance_margin, 1 / self.temperature, self.hold)

    def learning_rates(
        self, rounds: Int[Array, ""], env_steps: Int[Array, ""], stage_env_steps: int
    ) -> tuple[Scalar, Scalar]:
        """Return the learning rates of the network, which waits for the critic at first, and of the
        critic, after some rounds and env steps.
        """
        last = self.final_learning_rate
        rate = interpolate_linearly(self.learning_rate, last, stage_env_steps, env_steps)
        critic_rate = interpolate_linearly(
            self.critic_learning_rate, last, stage_env_steps, env_steps
        )
        return jnp.where(rounds < self.critic_first, 0.0, rate), critic_rate

    def learn(
        self,
        side: LearningSide[PPOLearner],
        rows: Row,
        stage_env_steps: int,
        env_steps: Int[Array, ""],
        key: PRNGKeyArray,
        clearance_margin: float = 0.0,
    ) -> tuple[LearningSide[PPOLearner], Scalar]:
        """Learn from a round, several times from each of its transitions.

        Args:
            side: the side before.
            rows: the transitions, leaves `[steps, games]`.
            stage_env_steps: length of the stage, over which step sizes change.
            env_steps: env steps of the stage, these transitions included.
            key: draws the order; it is consumed.
            clearance_margin: clearance that actions keep in the games [m].

        Returns:
            The side after it, and the critic's errors, added up over the updates.
        """
        learner = side.learner
        rounds = env_steps // self.env_steps_per_iteration - 1
        learning_rates = self.learning_rates(rounds, env_steps, stage_env_steps)
        flat = jax.tree.map(lambda leaf: leaf.reshape(rows.reward.size, *leaf.shape[2:]), rows)
        values = apply_to_batch(learner.critic, flat.observation)[:, 0]
        gained = advantages(self, rows, values.reshape(rows.reward.shape)).ravel()
        logarithms = self.sampler(learner.network, clearance_margin).log_probabilities(
            flat.observation
        )
        round_batch = LearnBatch(
            observation=flat.observation,
            action=flat.action,
            log_probability=_of_actions(logarithms, flat.action),
            advantage=gained,
            value=gained + values,
            active=flat.active,
            log_magnet=self._log_probabilities_of(
                learner.magnet, clearance_margin, flat.observation
            ),
        )
        keys = jax.random.split(key, self.epochs)
        order = jnp.concatenate([jax.random.permutation(key, len(values)) for key in keys])

        def update(learner: PPOLearner, rows: Int[Array, " batch"]) -> tuple[PPOLearner, Scalar]:
            batch = jax.tree.map(lambda leaf: leaf[rows], round_batch)
            return self.update(learner, batch, learning_rates, clearance_margin)

        batches = order.reshape(-1, self.batch)
        learner, errors = jax.lax.scan(update, learner, batches)
        return LearningSide(self._renew_magnet(learner, len(batches))), jnp.sum(errors)

    def _log_probabilities_of(
        self,
        magnet: QNetwork | None,
        clearance_margin: float,
        observations: Float[Array, "rows size"],
    ) -> Float[Array, "rows 9"] | None:
        if magnet is None:
            return None
        return self.sampler(magnet, clearance_margin).log_probabilities(observations)

    def _renew_magnet(self, learner: PPOLearner, updates_per_round: int) -> PPOLearner:
        """Copy the network to the magnet where that is due."""
        if learner.magnet is None:
            return learner
        is_due = learner.updates // updates_per_round % self.magnet_rounds == 0
        return replace(learner, magnet=tree_where(is_due, learner.network, learner.magnet))

    def update(
        self,
        learner: PPOLearner,
        batch: "LearnBatch",
        learning_rates: tuple[Scalar, Scalar],
        clearance_margin: float,
    ) -> tuple[PPOLearner, Scalar]:
        """Return the learner after one step of Adam on a batch, and the critic's error before
        it.
        """
        networks = learner.network, learner.critic
        (_, error), gradients = eqx.filter_value_and_grad(clipped_loss, has_aux=True)(
            networks, self, batch, clearance_margin
        )
        of_network, of_critic = gradients
        rate, critic_rate = learning_rates
        direction, optimiser = _adam.update(of_network, learner.optimiser)
        critic_direction, critic_optimiser = _critic_adam.update(
            of_critic, learner.critic_optimiser
        )
        network = descend(learner.network, direction, rate)
        critic = descend(learner.critic, critic_direction, critic_rate)
        after = PPOLearner(
            network, critic, learner.magnet, optimiser, critic_optimiser, learner.updates + 1
        )
        return after, error


def advantages(
    config: PPOConfig, rows: Row, values: Float[Array, "steps games"]
) -> Float[Array, "steps games"]:
    """Estimate the advantages of actions by generalised advantage estimation (Schulman et al.,
    2016).

    A game that is truncated, and one that the last step leaves under way, is worth what it was
    before that step.
    """
    following = jnp.concatenate([values[1:], values[-1:]])
    following = jnp.where(rows.terminated, 0.0, jnp.where(rows.truncated, values, following))
    errors = rows.reward + config.gamma * following - values

    def earlier(later: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
        error, ended = step
        advantage = error + config.gamma * config.trace * jnp.where(ended, 0.0, later)
        return advantage, advantage

    ended = rows.terminated | rows.truncated
    return jax.lax.scan(earlier, jnp.zeros_like(values[0]), (errors, ended), reverse=True)[1]


class LearnBatch(eqx.Module):
    """The rows that updates learn from: observations and actions, their logarithmic probabilities
    in the games, their advantages, the critic's targets, whether they count, and the logarithmic
    probabilities of all actions by the magnet, if there is one.
    """

    observation: Float[Array, "rows size"]
    action: Int[Array, " rows"]
    log_probability: Float[Array, " rows"]
    advantage: Float[Array, " rows"]
    value: Float[Array, " rows"]
    active: Bool[Array, " rows"]
    log_magnet: Float[Array, "rows 9"] | None = None


def clipped_loss(
    networks: tuple[QNetwork, Layers], config: PPOConfig, batch: LearnBatch, clearance_margin: float
) -> tuple[Scalar, Scalar]:
    """Return the loss of both networks on a batch, and the critic's mean squared error in it."""
    network, critic = networks
    logarithms = config.sampler(network, clearance_margin).log_probabilities(batch.observation)
    ratio = jnp.exp(_of_actions(logarithms, batch.action) - batch.log_probability)
    count = jnp.maximum(jnp.sum(batch.active), 1)

    def mean(values: Float[Array, " rows"]) -> Scalar:
        return jnp.sum(values, where=batch.active) / count

    above_mean = batch.advantage - mean(batch.advantage)
    gain = above_mean / (jnp.sqrt(mean(above_mean**2)) + 1e-6)
    clipped = jnp.clip(ratio, 1 - config.clip, 1 + config.clip)
    gains = mean(jnp.minimum(ratio * gain, clipped * gain))
    probabilities = jnp.exp(logarithms)
    entropy = -mean(jnp.sum(probabilities * logarithms, axis=1))
    error = mean((apply_to_batch(critic, batch.observation)[:, 0] - batch.value) ** 2)
    loss = error - gains - config.entropy * entropy
    if batch.log_magnet is not None:
        divergence = mean(jnp.sum(probabilities * (logarithms - batch.log_magnet), axis=1))
        loss = loss + config.magnet * divergence
    return loss, error


def _of_actions(
    logarithms: Float[Array, "rows 9"], actions: Int[Array, " rows"]
) -> Float[Array, " rows"]:
    return jnp.take_along_axis(logarithms, actions[:, None], axis=1)[:, 0]
