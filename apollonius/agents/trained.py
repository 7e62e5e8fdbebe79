"""Players by trained networks, at their best or exploring, and where such agents are found: the
zoo, runs, files.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.classical import uniform_action
from apollonius.agents.names import AGENTS, FROM_ZOO, ZOO, agents_folders, zoo_names
from apollonius.agents.network import GaussianActor, Network, QNetwork
from apollonius.agents.policy import (
    AbstractActionValuePolicy,
    AbstractContinuous,
    AbstractPolicy,
    AbstractWrapper,
    Memory,
)
from apollonius.agents.source import NamedPlayer, PlayerSource, unknown_player
from apollonius.agents.store import Agent, load_agent, load_header
from apollonius.agents.wrappers.clearance_penalty import ClearancePenalty, action_penalties
from apollonius.agents.wrappers.departure import Departing
from apollonius.arenas.file import from_dict, to_dict
from apollonius.game.game import Game
from apollonius.game.types import BySide, RandomBits, Role, Scalar
from apollonius.io.errors import InvalidInput
from apollonius.observe.observation import AbstractObservation, RawView
from apollonius.observe.registry import find_observation

ANY = BySide("pursuer", "evader")
"""Agents that play in any arena."""


class AbstractByNetwork(AbstractPolicy):
    """A player by a network, which reads that network's observation."""

    network: eqx.AbstractVar[Any]

    @property
    def observation(self) -> AbstractObservation:
        return self.network.observation


class Greedy(AbstractByNetwork, AbstractActionValuePolicy):
    """A player with a network of action values, which takes the action of highest value; of equals
    the first.
    """

    network: QNetwork

    def values(self, observation: Float[Array, " size"]) -> Float[Array, "9"]:
        """Return the network's action values."""
        return self.network(observation)


class EpsilonGreedy(AbstractWrapper[AbstractActionValuePolicy]):
    """A uniformly random action with probability `epsilon` (to 1.5e-5), else that of a player that
    values actions.
    """

    epsilon: Scalar

    @property
    def observation(self) -> RawView:
        return self.policy.observation

    def __call__(
        self, observation: Any, memory: Memory, bits: RandomBits
    ) -> tuple[Int[Array, ""], Memory]:
        best, memory = self.policy(observation, memory, bits)
        explore = (bits & 0xFFFF).astype(jnp.float32) < self.epsilon * 65536
        return jnp.where(explore, uniform_action(bits), best), memory


class SquashedMean(AbstractByNetwork, AbstractContinuous):
    """The hyperbolic tangents of the means: what a trained agent does when it counts."""

    network: GaussianActor

    def __call__(
        self, observation: Float[Array, " size"], memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "2"], Memory]:
        return jnp.tanh(self.network(observation)[0]), memory


class SquashedGaussian(AbstractByNetwork, AbstractContinuous):
    """Drawn from the distributions, their standard deviations multiplied by `spread`: by 0 it is
    `SquashedMean`.
    """

    network: GaussianActor
    spread: Scalar

    def __call__(
        self, observation: Float[Array, " size"], memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "2"], Memory]:
        mean, deviation = self.network(observation)
        noise = jax.random.normal(jax.random.key(bits), (2,))
        return jnp.tanh(mean + self.spread * deviation * noise), memory


class SamplingPolicy(AbstractByNetwork):
    """The action drawn by a network's values as logits, less the costs of missing clearance.

    The random number that chooses it is held for some steps: each action keeps its probability, and
    what is tried lasts long enough to lead somewhere (Hollenstein, Martius and Piater, "Colored
    noise in PPO", 2024).

    Attributes:
        clearance_margin: clearance after braking [m], or 0.
        loss_value: what a lost game costs in the values.
        hold: steps for which a number is held, on average.
    """

    network: QNetwork
    clearance_margin: float = eqx.field(static=True)
    loss_value: float = eqx.field(static=True)
    hold: float = eqx.field(static=True)

    @property
    def memory(self) -> RandomBits:
        """The number that is held; 0 where none is."""
        return jnp.zeros((), jnp.uint32)

    def __call__(
        self, observation: Float[Array, " size"], noise_memory: RandomBits, bits: RandomBits
    ) -> tuple[Int[Array, ""], RandomBits]:
        below = jnp.cumsum(jax.nn.softmax(self.penalise(self.network(observation), observation)))
        lasts = ((bits & 0xFF).astype(jnp.float32) >= 256 / self.hold) & (noise_memory > 0)
        action_bits = jnp.where(lasts, noise_memory, bits)
        drawn = (action_bits >> 8).astype(jnp.float32) / 2**24
        return jnp.minimum(jnp.sum(drawn >= below), below.size - 1).astype(jnp.int32), action_bits

    def log_probabilities(self, observations: Float[Array, "rows size"]) -> Float[Array, "rows 9"]:
        return jax.nn.log_softmax(self.penalise(self.network.batch(observations), observations))

    def penalise(
        self, values: Float[Array, "*rows 9"], observations: Float[Array, "*rows size"]
    ) -> Array:
        return (
            values - action_penalties(observations, self.clearance_margin, self.loss_value)
            if self.clearance_margin
            else values
        )


def greedy_policy(
    network: Network, clearance_margin: float = 0.0, loss_value: float | None = None
) -> Greedy | SquashedMean | ClearancePenalty:
    """Return the player that does what the network values most.

    Args:
        network: the network.
        clearance_margin: the clearance that an action should leave a robot that then brakes [m],
            or 0.
        loss_value: value of a lost game in the network's units; not needed without a margin.
    """
    if not isinstance(network, QNetwork):
        return SquashedMean(network)
    policy = Greedy(network)
    if clearance_margin == 0:
        return policy
    assert loss_value is not None
    return ClearancePenalty(policy, clearance_margin, loss_value)


def agent_policy(agent: Agent) -> Greedy | SquashedMean | ClearancePenalty:
    """Return the player of an agent, greedy and with the clearance margin of its header."""
    header = agent.header
    return greedy_policy(agent.network, header.clearance_margin, header.loss_value)


class Trained(PlayerSource):
    """The agents of the zoo, of training runs and of files, at their best."""

    syntax = "a .safetensors file, or RUN/NAME for an agent of a training run"

    def names(self) -> Sequence[str]:
        return zoo_names()

    def fits(self, name: str, role: Role, game: Game) -> bool:
        return load_header(ZOO / f"{name}.safetensors").role == role.name.lower()

    def find(self, name: str, role: Role, game: Game) -> NamedPlayer | None:
        if agent_path(name) is None:
            return None
        agent, path = find_trained(name, role)
        policy = agent_policy(agent)
        values_actions = isinstance(policy, AbstractActionValuePolicy)
        if role is Role.PURSUER and policy.needs_chart and values_actions:
            policy = Departing(policy)
        return NamedPlayer(
            name if name.startswith(FROM_ZOO) else display_name(path), policy, agent.header
        )


TRAINED = Trained()


def find_trained(name: str, role: Role | None = None) -> tuple[Agent, Path]:
    """Return the trained agent of a name and its file; raises InvalidInput for an unknown name, a
    bad file, and one of another side than is wanted.
    """
    path = agent_path(name)
    if path is None:
        raise unknown_player(name, TRAINED)
    agent = load_agent(path)
    if role is not None and agent.header.role != role.name.lower():
        side = role.name.lower()
        own_side = agent.header.role
        raise InvalidInput(f"'{name}' plays the {own_side}, not the {side}: take another there.")
    return agent, path


def trained_elsewhere(player: NamedPlayer, game: Game) -> bool:
    """Check whether an agent was trained in other arenas only than those of a game; an agent that
    reads a chart fits every arena.
    """
    header = player.header
    if header is None or not header.game or find_observation(header.observation).needs_chart:
        return False
    arena = from_dict(Game, header.game, f"the header of '{player.name}'").arena
    return game.scenario is not None or to_dict(arena) != to_dict(game.arena)


def load_network(name: str, role: Role) -> Network:
    """Return the network of a trained agent of a side; raises InvalidInput without one."""
    return find_trained(name, role)[0].network


def display_name(path: Path) -> str:
    """Return the name of the agent of a file: RUN/NAME in the folder of a run, where many are
    called alike.
    """
    if path.parent.name != AGENTS:
        return path.stem
    return f"{path.resolve().parents[1].name}/{path.stem}"


def agent_path(name: str) -> Path | None:
    """Return the file of a name, if it has one."""
    in_zoo = name.removeprefix(FROM_ZOO)
    if in_zoo in zoo_names():
        return ZOO / f"{in_zoo}.safetensors"
    if name.lower().endswith(".safetensors") or os.path.exists(name):
        return Path(name)
    run, _, agent = name.rpartition("/")
    in_run = [folder / f"{agent}.safetensors" for folder in agents_folders(run) if run and agent]
    return next((file for file in in_run if os.path.isfile(file)), None)
