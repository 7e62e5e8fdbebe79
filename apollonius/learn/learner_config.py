"""Learning in numbers: what all algorithms share, deep Q-learning, soft actor-critic."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.agents.network import (
    MOST_LAYERS,
    MOST_WIDTH,
    GaussianActor,
    Network,
    QNetwork,
    widen_inputs,
)
from apollonius.game.types import Real, Scalar
from apollonius.io.errors import require, require_positive, require_within
from apollonius.io.limits import PARALLEL_GAMES, TRANSITIONS
from apollonius.observe.registry import find_observation

_CHUNK_ENV_STEPS = 8192
"""Env steps between two looks from outside (progress, checkpoints, Ctrl-C), where iterations are small enough."""


def interpolate_linearly(start: Real, end: Real, over: Real, env_steps: Int[Array, ""]) -> Scalar:
    """Interpolate from `start` to `end` over the first `over` env steps; constant from then on."""
    fraction = jnp.clip(env_steps.astype(jnp.float32) / jnp.maximum(over, 1), 0.0, 1.0)
    value: Real = start + (end - start) * fraction
    return value


@dataclass(frozen=True)
class LearnerConfig:
    """The numbers that all algorithms share. Intervals are in environment steps: one step of one game."""

    network: ClassVar[type[QNetwork] | type[GaussianActor]]
    """Class of the networks that it trains."""
    observation: str = "encoded"
    """Name of the observation that the network reads (`apollonius.observe`)."""
    width: int = 256
    """Units of each hidden layer (Fig. 3)."""
    depth: int = 4
    """Number of hidden layers (Fig. 3)."""
    symmetric: bool = False
    """True to train a network that treats left and right alike; needs action values and `egocentric` or `team`."""
    gamma: float = 0.99
    """Discount of a step (section IV)."""
    learning_rate: float = 5e-4
    """Adam's step size at the start of a stage."""
    final_learning_rate: float = 2e-5
    """Adam's step size at the end of a stage, reached in a straight line."""
    batch: int = 256
    """Transitions in an update."""
    games: int = 512
    """Games played at a time."""

    def __post_init__(self) -> None:
        mirrored = (
            self.network is QNetwork and find_observation(self.observation).mirror is not None
        )
        require(
            mirrored or not self.symmetric,
            "symmetric",
            True,
            f"false with '{self.observation}' or with sac",
        )
        require_positive(self, "learning_rate", "final_learning_rate", "batch", "games")
        require_within(self, 1, MOST_WIDTH, "width")
        require_within(self, 1, MOST_LAYERS, "depth")
        require_within(self, 0, 1, "gamma", "learning_rate")
        PARALLEL_GAMES.require("games", self.games)
        TRANSITIONS.require("batch", self.batch)
        falls = self.final_learning_rate <= self.learning_rate
        require(
            falls,
            "final_learning_rate",
            self.final_learning_rate,
            f"at most learning_rate = {self.learning_rate}",
        )

    @property
    @abstractmethod
    def steps_per_iteration(self) -> int:
        """Steps every game plays between two rounds of updates."""

    @property
    @abstractmethod
    def iterations_per_chunk(self) -> int:
        """Rounds of play and updates in one compiled call."""

    @property
    def env_steps_per_iteration(self) -> int:
        """Env steps of all games between two rounds of updates."""
        return self.steps_per_iteration * self.games

    @property
    def steps_before_learning(self) -> int:
        """Env steps before the first update."""
        return 0

    def fit_network(self, network: Network, name: str, value: object) -> Network:
        """Return a network to go on from; one that reads a part of the observation has weights of 0 for the rest, and a
        symmetric one stays so.

        Raises InvalidInput when it does not fit, by the name and value that the user gave.
        """
        wanted = f"{self.network.__name__} of {self.depth} layers of {self.width} that reads '{self.observation}'"
        bound = f"a {wanted}, as this config trains, not one that reads '{network.observation.name}' or of another size"
        reads, size = (
            find_observation(self.observation),
            (len(network.layers) - 1, int(network.layers[0].out_features)),
        )
        alike = type(network) is self.network and network.observation.name in {
            reads.name,
            reads.extends,
        }
        require(alike and size == (self.depth, self.width), name, value, bound)
        whole = network if network.observation is reads else widen_inputs(network, reads)
        return (
            replace(whole, symmetric=True)
            if self.symmetric and isinstance(whole, QNetwork)
            else whole
        )


@dataclass(frozen=True)
class ReplayConfig(LearnerConfig):
    """The numbers of the algorithms that learn from a replay buffer."""

    n_step: int = 16
    """Rewards summed before a value is bootstrapped, at the start of a stage: far-reaching, but of high variance."""
    final_n_step: int = 4
    """Rewards summed at the end of a stage, reached in a straight line: less noise, and closer to the value of the best
    action than of the explored one (annealed as in Schwarzer et al., "Bigger, Better, Faster", 2023)."""
    averaging: float = 3e-4
    """Part of the way that the averaged weights go towards the network at each update; 1 plays the network itself."""
    env_steps_per_update: int = 512
    """Env steps between two updates of each learner."""
    replay_capacity: int = 524_288
    """Transitions kept, of teams those of each robot."""
    learning_starts: int = 40_000
    """Env steps before the first update."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(
            self, "n_step", "final_n_step", "averaging", "env_steps_per_update", "replay_capacity"
        )
        require_within(self, 0, 1, "averaging")
        TRANSITIONS.require("replay_capacity", self.replay_capacity)
        require(
            self.final_n_step <= self.n_step,
            "final_n_step",
            self.final_n_step,
            f"at most n_step = {self.n_step}",
        )
        steps, bound = self.env_steps_per_update, f"a multiple or a divisor of games = {self.games}"
        require(
            max(self.games, steps) % min(self.games, steps) == 0,
            "env_steps_per_update",
            steps,
            bound,
        )
        rows = 2 * (self.n_step + self.steps_per_iteration)
        bound = f"at least {rows * self.games} for these games and n_step"
        require(self.rows >= rows, "replay_capacity", self.replay_capacity, bound)

    @property
    def steps_per_iteration(self) -> int:
        return max(1, self.env_steps_per_update // self.games)

    @property
    def iterations_per_chunk(self) -> int:
        return max(8, _CHUNK_ENV_STEPS // self.env_steps_per_iteration)

    @property
    def updates_per_iteration(self) -> int:
        """Updates in a round."""
        return max(1, self.games // self.env_steps_per_update)

    @property
    def rows(self) -> int:
        """Time steps the replay holds: the capacity, rounded down to whole iterations."""
        return self.replay_capacity // self.env_steps_per_iteration * self.steps_per_iteration

    @property
    def steps_before_learning(self) -> int:
        return self.learning_starts


@dataclass(frozen=True)
class DQNConfig(ReplayConfig):
    """Deep Q-learning (section II-B), for the nine discrete actions."""

    network = QNetwork
    double: bool = True
    """Let the online network choose and the target network value the next action (double Q-learning)."""
    target_period: int = 128_000
    """Env steps between two copies of the network to the target network (C in Algorithms 1 and 2)."""
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

    def epsilon(self, first: float, stage: int, env_steps: Int[Array, ""]) -> Scalar:
        """Return the share of random actions, from `first` at the beginning of a stage of this many env steps."""
        over = self.exploration_steps or self.exploration_fraction * stage
        return interpolate_linearly(first, self.final_epsilon, over, env_steps)


@dataclass(frozen=True)
class SACConfig(ReplayConfig):
    """Soft actor-critic (Haarnoja et al., "Soft actor-critic algorithms and applications", 2018), for pairs of action
    levels; n-step returns as in deep Q-learning.
    """

    network = GaussianActor
    depth: int = 3
    final_n_step: int = 8
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-4
    averaging: float = 1e-3
    env_steps_per_update: int = 256
    target_averaging: float = 2e-2
    """Part of the way that the target critics go towards the critics at each update (tau)."""
    target_entropy: float = -1.0
    """Mean entropy of a state's actions that the temperature is tuned to [nats, of action levels in [-1, 1]]; uniformly
    random ones have 1.39. The paper's rule, minus the number of controls, would be -2: too sure too early of the side
    on which to pass a disc."""
    first_temperature: float = 0.1
    """The temperature before the first update."""
    noise_steps: int = 16
    """Steps for which a game holds the noise of its actions (as in gSDE: Raffin et al., "Smooth exploration for robotic
    reinforcement learning", 2021): a robot of bounded acceleration averages away what is new every 0.1 s."""
    critics_first: int = 500
    """Updates of the critics alone before the actor learns: they begin from random weights even where it does not."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "target_averaging", "first_temperature")
        require_within(self, 0, 1, "target_averaging")
        require_within(
            self, -1_000, 1.38, "target_entropy"
        )  # of uniformly random actions it is 2 log(2) = 1.386
        require_within(self, 0, 2**31, "critics_first")
        whole = self.noise_steps >= 1 and self.noise_steps % self.steps_per_iteration == 0
        bound = f"a multiple of env_steps_per_update / games = {self.steps_per_iteration}"
        require(whole, "noise_steps", self.noise_steps, bound)


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

Where the paper is silent, replay, first update and last exploration are those of the work that it cites for DQN (Mnih
et al., "Human-level control through deep reinforcement learning", 2015). The target is copied every 30,000 updates,
there every 10,000.
"""
