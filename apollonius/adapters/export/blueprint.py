"""What an exported policy is made of: a network, the numbers of a game, and what to do when in doubt."""

import re
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32, Float64

from apollonius.adapters.export.chart_file import Parts, chart_parts
from apollonius.agents.classical import BRAKE_STRAIGHT
from apollonius.agents.network import GaussianActor
from apollonius.agents.store import Agent, AgentHeader
from apollonius.arenas.record import to_dict
from apollonius.document import to_json
from apollonius.errors import require
from apollonius.game.arena import Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, Role
from apollonius.observe.registry import OBSERVATIONS

STATE = ("x", "y", "v", "heading")
"""What a robot's four numbers are: metres, metres, m/s along the heading, radians."""
LARGEST = 1e6
"""No number of a state is beyond this. Compared is the sum of their squares: one test, and a NaN fails it too."""
FALLBACK = BRAKE_STRAIGHT
"""The action for what is no state: full braking, straight ahead."""
FALLBACK_GEARS = (-1.0, 0.0)
"""The same as shares of u1_max and u2_max, for a policy whose actions are continuous."""


@dataclass(frozen=True)
class Body:
    """A robot's limits [m/s, m/s^2, rad/s] and its radius [m], as in `Unicycle`."""

    v_min: float
    v_max: float
    u1_max: float
    u2_max: float
    radius: float

    def __str__(self) -> str:
        return (
            f"v from {self.v_min:g} to {self.v_max:g} m/s, |u1| up to {self.u1_max:g} m/s^2, "
            f"|u2| up to {self.u2_max:g} rad/s, radius {self.radius:g} m"
        )


def _plain(body: Unicycle) -> Body:
    return Body(*(float(getattr(body, field.name)) for field in fields(Body)))


@dataclass(frozen=True)
class Blueprint:
    """One side's policy: eight numbers in (own x, y, v, heading, then the opponent's), controls out.

    A discrete policy says its action too: the one of the nine that it values most. A continuous one makes gears, the
    shares of the largest controls, of its network's outputs: their hyperbolic tangents.

    Attributes:
        agent: what the agent is called, without what could end a comment or a string.
        header: what the agent's file says.
        game: whose limits and arena are in the observation.
        layers: weight [out, in] and bias [out] of each layer; the outputs are nine values, or the means of two gears.
    """

    agent: str
    header: AgentHeader
    game: Game
    layers: tuple[tuple[Float32[np.ndarray, "_ _"], Float32[np.ndarray, "_"]], ...]

    @property
    def continuous(self) -> bool:
        """Whether its actions are pairs of gears."""
        return self.header.network == "gaussian"

    @property
    def charted(self) -> bool:
        """Whether its observation reads a chart, so that it plays in any arena that there is one of."""
        return OBSERVATIONS[self.header.observation].charted

    @cached_property
    def chart(self) -> Parts:
        """That of the game's arena."""
        return chart_parts(self.game)

    @cached_property
    def own(self) -> Body:
        """The robot that the policy steers."""
        return _plain(self._bodies[0])

    @cached_property
    def opponent(self) -> Body:
        """The other robot."""
        return _plain(self._bodies[1])

    @property
    def _bodies(self) -> tuple[Unicycle, Unicycle]:
        pursuer, evader = self.game.pursuer, self.game.evader
        return (pursuer, evader) if self.header.role == Role.PURSUER.name.lower() else (evader, pursuer)

    @cached_property
    def walls(self) -> tuple[float, float, float, float]:
        """x_min, x_max, y_min, y_max [m]."""
        arena = self.game.arena
        return float(arena.x_min), float(arena.x_max), float(arena.y_min), float(arena.y_max)

    @cached_property
    def discs(self) -> list[tuple[float, float, float]]:
        """Centre x, y and radius [m] of each obstacle."""
        return [(float(disc.x), float(disc.y), float(disc.radius)) for disc in self.game.arena.discs]

    @cached_property
    def controls(self) -> Float32[np.ndarray, "9 2"]:
        """Acceleration u1 [m/s^2] and turn rate u2 [rad/s] of each action (Eq. 4, 5)."""
        both = [self._bodies[0].controls(jnp.asarray(action)) for action in range(NUM_ACTIONS)]
        return np.asarray(both, np.float32)

    @cached_property
    def largest_controls(self) -> Float32[np.ndarray, "2"]:
        """The largest acceleration u1 [m/s^2] and turn rate u2 [rad/s], either sign."""
        return np.array([self.own.u1_max, self.own.u2_max], np.float32)

    def values(self, observation: Float32[np.ndarray, " size"]) -> Float64[np.ndarray, "9"]:
        """The network's action values for an observation, in double precision."""
        hidden = observation.astype(float)
        for weight, bias in self.layers[:-1]:
            hidden = np.maximum(weight @ hidden + bias, 0)
        weight, bias = self.layers[-1]
        return weight @ hidden + bias

    @property
    def title(self) -> str:
        """What this is, in half a sentence."""
        return f"The {self.header.role} {self.agent} of a pursuit-evasion game"

    @property
    def about(self) -> list[str]:
        """Lines that say what is built in."""
        header, (x_min, x_max, y_min, y_max) = self.header, self.walls
        discs = ", ".join(f"({x:g}, {y:g}; {radius:g})" for x, y, radius in self.discs) or "none"
        obstacles = (
            f"Capture   when the robots are nearer to each other than {self.game.capture_distance:g} m"
            if self.charted
            else f"Discs     (x, y; radius) in m: {discs}"
        )
        return [
            f"Agent     plays the {header.role}; observation {header.observation} ({header.observation_size} numbers), "
            f"{header.depth} hidden layers of {header.width} units",
            f"Arena     x from {x_min:g} to {x_max:g} m, y from {y_min:g} to {y_max:g} m",
            obstacles,
            f"Own       {self.own}",
            f"Opponent  {self.opponent}",
            f"Step      controls are held for {self.game.dt:g} s",
        ]

    def metadata(self) -> dict[str, str]:
        """The agent's header, the game that is built in, and the one that it was trained for."""
        said: dict[str, Any] = asdict(self.header)
        said |= {"agent": self.agent, "trained_game": said["game"], "game": to_dict(self.game)}
        return {key: value if isinstance(value, str) else to_json(value) for key, value in said.items()}


def make_blueprint(name: str, agent: Agent, game: Game) -> Blueprint:
    """The policy of a trained agent in a game.

    Raises:
        InvalidInput: for an observation that is not exported, a game in several arenas, clearances from other obstacles
            than discs, a robot whose braking does not end at rest, and a network with numbers that are none.
    """
    layers = tuple((np.asarray(layer.weight), np.asarray(layer.bias)) for layer in agent.network.layers)
    finite = all(np.isfinite(part).all() for layer in layers for part in layer)
    require(finite, "weights", "NaN or infinite", "finite; train the agent again")
    if isinstance(agent.network, GaussianActor):
        *hidden, (weight, bias) = layers
        layers = (*hidden, (weight[:2], bias[:2]))  # the means; how far it explores is of no use on a robot
    reads = agent.network.observation
    known = ", ".join(name for name, one in OBSERVATIONS.items() if one.exported)
    require(reads.exported, "observation", reads.name, f"one that exported policies can make: {known}")
    game.require_one_arena("an exported policy")
    game.require_two("an exported policy")
    bound = "discs, the only ones that an exported policy measures the clearances in its observation from"
    if reads.measures and not reads.charted:
        game.arena.require_only((Disc,), bound)
    blueprint = Blueprint(re.sub(r"[^\w.-]", "_", name), agent.header, game, layers)
    own = blueprint.own
    bound = "0 m/s, so that braking, the answer to a broken state, ends at rest"
    require(own.v_min == 0, "v_min", own.v_min, bound)
    require(own.u1_max > 0, "u1_max", own.u1_max, "more than 0 m/s^2, or the robot cannot brake")
    return blueprint


def identifier(out: Path) -> str:
    """Return what the policy of a file is called in C: the file's name without its ending.

    Raises:
        InvalidInput: for a name that C does not allow.
    """
    allowed = re.fullmatch("[A-Za-z][A-Za-z0-9_]*", out.stem)
    require(allowed, "file", out, "a file whose name begins with a letter and goes on with letters, digits and _")
    return out.stem
