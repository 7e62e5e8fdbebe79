"""The interface of the algorithms: their common numbers, and the functions that a stage calls.

An algorithm is its numbers, a frozen dataclass, so it is static under `jit`. Its learner is a
pytree with a `network`, which plays while it learns, an `average`, which plays in evaluations, and
`updates`, their number so far.
"""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import (
    MOST_LAYERS,
    MOST_WIDTH,
    GaussianActor,
    Network,
    QNetwork,
    scale_outputs,
    widen_inputs,
)
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.trained import load_network
from apollonius.catalogue import find_player, loss_value
from apollonius.game.game import Game
from apollonius.game.types import Real, Role, Scalar
from apollonius.io.errors import require, require_positive, require_within
from apollonius.io.limits import PARALLEL_GAMES, TRANSITIONS
from apollonius.learn.replay_buffer import Row
from apollonius.observe.registry import find_observation

T = TypeVar("T")


def interpolate_linearly(start: Real, end: Real, over: Real, env_steps: Int[Array, ""]) -> Scalar:
    """Interpolate from `start` to `end` over the first `over` env steps; constant from then on."""
    fraction = jnp.clip(env_steps.astype(jnp.float32) / jnp.maximum(over, 1), 0.0, 1.0)
    value: Real = start + (end - start) * fraction
    return value


def descend(weights: T, direction: Any, rate: Real) -> T:
    """Return weights less a direction, a tree like theirs, times the rate."""
    return eqx.apply_updates(weights, jax.tree.map(lambda step: -rate * step, direction))


def require_reward_in_play(game: Game, role: Role) -> None:
    """Refuse to train a team by a reward that comes after its robots can be out of play: in the
    zero-sum profile.

    A robot learns until it is out of play. By that profile it would not learn that its side lost or
    won after that, and leaving early would cost nothing.
    """
    is_paid = len(game.bodies[role]) == 1 or game.reward.profile != "zero-sum"
    require(
        is_paid,
        "reward.profile",
        game.reward.profile,
        "'paper' for a team that learns, which pays robots in play",
    )


@runtime_checkable
class Learner(Protocol):
    """One side's networks and optimisers: `network` plays while it learns, `average` in
    evaluations.
    """

    @property
    def network(self) -> Any: ...
    @property
    def average(self) -> Any: ...
    @property
    def updates(self) -> Int[Array, ""]: ...


L = TypeVar("L", bound=Learner)


class LearningSide(eqx.Module, Generic[L]):
    """One side that learns: its networks, and the replay buffer that it learns from, if it has
    one.
    """

    learner: L
    buffer: Any = None


@dataclass(frozen=True)
class Algorithm:
    """The numbers that all algorithms share. Intervals are in environment steps: one step of one
    game.
    """

    kind: str = ""
    """Name of the algorithm in a config."""
    network: ClassVar[type[QNetwork] | type[GaussianActor]] = QNetwork
    """Class of the networks that it trains."""
    continuous: ClassVar[bool] = False
    """True for actions that are pairs of levels, False for the nine."""
    reads_next_observation: ClassVar[bool] = True
    """False if it learns from observations before actions alone."""
    on_policy: ClassVar[bool] = False
    """True if it learns only from actions that its own network has just chosen."""
    observation: str = "encoded"
    """Name of the observation that the network reads (`apollonius.observe`)."""
    width: int = 256
    """Units of each hidden layer (Fig. 3)."""
    depth: int = 4
    """Number of hidden layers (Fig. 3)."""
    symmetric: bool = False
    """True to train a network that treats left and right alike; needs action values and
    `egocentric` or `team`.
    """
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
    def env_steps_per_chunk(self) -> int:
        """Env steps in one compiled call."""
        return self.iterations_per_chunk * self.env_steps_per_iteration

    @property
    def steps_before_learning(self) -> int:
        """Env steps before the first update."""
        return 0

    @property
    def transitions(self) -> int:
        """Transitions of a side that it keeps at a time."""
        return self.env_steps_per_iteration

    @abstractmethod
    def explorer(self, network: Any, exploration: Scalar) -> AbstractPolicy:
        """Return the player that acts in the games of training and explores, from 0 for not at all
        to 1.
        """

    def exploration(self, first: float, stage_env_steps: int, env_steps: Int[Array, ""]) -> Scalar:
        """Return the amount of exploration, from 0 to 1.

        Args:
            first: amount at the beginning of the stage.
            stage_env_steps: length of the stage.
            env_steps: env steps of the stage so far.
        """
        return jnp.ones(())

    def frozen(self, network: Any) -> AbstractPolicy:
        """Return the player of an earlier version, which does not explore."""
        return self.explorer(network, jnp.zeros(()))

    def noise_block(self, iterations: Int[Array, ""]) -> Int[Array, ""] | None:
        """Return the number of the iterations that share their random bits; None where each step
        has its own.
        """
        return None

    def reward_unit(self, game: Game) -> Real:
        """Return the reward that counts as one."""
        return 1.0

    def loss_value(self, failure: float) -> float | None:
        """Return the value of a lost game in the units of its networks, for what a failure costs in
        training; None where that is nothing, and for networks that do not value games.
        """
        return failure or None

    @abstractmethod
    def init_side(
        self, key: PRNGKeyArray, network: Network | None, robots: int
    ) -> LearningSide[Any]:
        """Make a side of some robots in each game, which starts from a copy of a network, or from
        random weights. The key is consumed.
        """

    @abstractmethod
    def learn(
        self,
        side: LearningSide[Any],
        rows: Row,
        stage_env_steps: int,
        env_steps: Int[Array, ""],
        key: PRNGKeyArray,
    ) -> tuple[LearningSide[Any], Scalar]:
        """Learn from a side's latest transitions.

        Args:
            side: the side before.
            rows: the transitions, leaves `[steps, games]`.
            stage_env_steps: length of the stage, over which step sizes change.
            env_steps: env steps of the stage, these transitions included.
            key: draws the batches; it is consumed.

        Returns:
            The side after that, and the losses of its updates, added up.
        """

    def first_network(
        self, name: str, role: Role, game: Game, unit: float | None, field: str = ""
    ) -> Network:
        """Load the network that a side starts from, an agent's, in the units of the training.

        Args:
            name: name or file of the agent.
            role: the side.
            game: the game of the training.
            unit: value of a lost game in these units; None for the agent's own.
            field: what messages call the agent; the side where it is left out.

        Raises:
            InvalidInput: for an unknown agent, and one that does not fit (`fit_network`).
        """
        network = self.fit_network(load_network(name, role), field or role.name.lower(), name)
        if unit is None or not isinstance(network, QNetwork):
            return network
        return scale_outputs(network, unit / loss_value(find_player(name, role, game), game))

    def fit_network(self, network: Network, name: str, value: object) -> Network:
        """Return a network to go on from; one that reads a part of the observation has weights of 0
        for the rest, and a symmetric one stays so.

        Raises InvalidInput when it does not fit, by the name and value that the user gave.
        """
        reads = find_observation(self.observation)
        bound = (
            f"a {self.network.__name__} of {self.depth} layers of {self.width} that reads "
            f"'{self.observation}', as this config trains, not one that reads "
            f"'{network.observation.name}' or of another size"
        )
        size = len(network.layers) - 1, int(network.layers[0].out_features)
        reads_alike = network.observation.name in {reads.name, reads.extends}
        alike = type(network) is self.network and reads_alike
        require(alike and size == (self.depth, self.width), name, value, bound)
        whole = network if network.observation is reads else widen_inputs(network, reads)
        return replace(whole, symmetric=True) if self.symmetric else whole
