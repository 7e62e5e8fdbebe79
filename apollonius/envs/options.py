"""The options of environments, by name or as objects: sides, spaces, players, observations,
rewards, actions.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import Pool, single_player
from apollonius.arenas.charting import with_chart
from apollonius.catalogue import find_player
from apollonius.envs.batch import ExternalPolicy
from apollonius.game.game import Game
from apollonius.game.reward import Reward
from apollonius.game.types import NUM_ACTIONS, ROLES, BySide, GameState, Role, Scalar, Timestep
from apollonius.io.errors import InvalidInput, closest_names, require, unknown_name
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.registry import OWN, find_observation, observation_names
from apollonius.observe.view import View, look

PlayerOption = str | AbstractPolicy
"""A player as an option: a name or a file, as of `find_player`, or a policy."""
ObservationOption = str | AbstractObservation | Callable[[View], Any]
"""An observation as an option: a name, an object, or a function from a view to numbers."""
RewardOption = Reward | Callable[[GameState, Timestep], Any] | None
"""Rewards as an option: those of the game, the package's with other weights, or a function of the
state before a step and of the step, without a batch: it returns the reward of the side that acts
from outside, or a `BySide` of both."""


@dataclass(frozen=True)
class OwnObservation(AbstractObservation):
    """The numbers that a function makes of a view."""

    function: Callable[[View], Any]
    size: int  # pyright: ignore[reportIncompatibleVariableOverride]

    def __call__(self, view: View) -> Float[Array, " size"]:
        return _numbers(self.function, view)


def _numbers(function: Callable[[View], Any], view: View) -> Float[Array, "..."]:
    return _as_array("observation", function(view), "a row of numbers")


def _as_array(name: str, value: Any, bound: str) -> Float[Array, "..."]:
    try:
        return jnp.asarray(value, jnp.float32)
    except (TypeError, ValueError):  # of text, of None, of rows of several lengths
        require(False, name, value, bound)
        raise


@dataclass(frozen=True)
class OwnReward:
    """The rewards of all robots by a function of the state before a step and of the step.

    What it returns is of the side `role`, unless it is a `BySide`; on either side it is one number
    for all robots, or a tuple of one for each.
    """

    function: Callable[[GameState, Timestep], Any]
    role: Role | None

    def __call__(self, before: GameState, after: Timestep) -> BySide[tuple[Scalar, ...]]:
        """Return every robot's reward; raises InvalidInput for what are no rewards."""
        value = self.function(before, after)
        of_both = isinstance(value, BySide)
        bound = "of both sides, as apollonius.BySide(pursuer, evader)"
        require(of_both or self.role is not None, "reward", f"of one side, {value}", bound)
        sides = value if of_both else BySide.of(self.role or Role.PURSUER, value, 0.0)

        def of_each(role: Role) -> tuple[Scalar, ...]:
            count = len(before.robots[role])
            value = sides[role]
            name = f"reward of the {role.name.lower()}"
            bound = f"a number, or a tuple of {count}, one a robot"
            values = value if isinstance(value, tuple | list) else (value,) * count
            require(len(values) == count, name, value, bound)
            numbers = tuple(_as_array(name, number, bound) for number in values)
            for number in numbers:
                require(number.ndim == 0, name, f"an array of shape {number.shape}", bound)
            return numbers

        return ROLES.map(of_each)


@dataclass(frozen=True)
class Contest:
    """A game, with a chart if a player reads one, its players, and a user's reward."""

    game: Game
    players: BySide[Pool]
    reads: AbstractObservation
    reward: OwnReward | None


def make_contest(
    game: Game,
    observation: object,
    actions: str,
    reward: object,
    inside: Mapping[Role, PlayerOption],
) -> Contest:
    """Make a game and its players: the package's where `inside` has one, and `ExternalPolicy` on
    other sides.

    Args:
        game: The game.
        observation: Observation of the side from outside (`ObservationOption`).
        actions: `discrete` or `continuous`.
        reward: Rewards (`RewardOption`).
        inside: The package's players by side.

    Raises:
        InvalidInput: For options that are unknown or of a wrong kind.
    """
    outside = [role for role in Role if role not in inside]
    game, own = _reward(game, reward, outside[0] if len(outside) == 1 else None)
    policies = {role: find_player(player, role, game).policy for role, player in inside.items()}
    reads = _observation(game, observation, outside[0])
    first = jnp.zeros((), jnp.int32) if actions == "discrete" else jnp.zeros(2)
    outsider = ExternalPolicy(first, reads)
    players = ROLES.map(lambda role: single_player(policies.get(role, outsider)))
    reads_chart = reads.needs_chart or any(policy.needs_chart for policy in policies.values())
    return Contest(with_chart(game, reads_chart).packed(), players, reads, own)


def _observation(game: Game, option: object, role: Role) -> AbstractObservation:
    """Return an observation; one by a function has the size of what that makes of a view of the
    game.
    """
    if isinstance(option, str | AbstractObservation):
        return find_observation(option)
    bound = (
        f"one of {', '.join(observation_names())}, an AbstractObservation, or a function of a view"
    )
    _require_function("observation", option, 1, bound)
    assert callable(option)
    numbers = jax.eval_shape(
        lambda: _numbers(option, look(game, game.reset(jax.random.key(0)), role))
    )
    require(
        numbers.ndim == 1, "observation", f"an array of shape {numbers.shape}", "a row of numbers"
    )
    return OwnObservation(function=option, size=numbers.size)


def _reward(game: Game, option: object, role: Role | None) -> tuple[Game, OwnReward | None]:
    """Return a game with other weights of its rewards, and the rewards by a function."""
    if option is None:
        return game, None
    if isinstance(option, Reward):
        return replace(game, reward=option), None
    _require_function(
        "reward", option, 2, "a Reward, or a function of the state before a step and of the step"
    )
    assert callable(option)
    own = OwnReward(option, role)

    def example_rewards() -> BySide[tuple[Scalar, ...]]:
        state = game.reset(jax.random.key(0))
        return own(state, game.step(state, *([0] * len(side) for side in game.bodies)))

    jax.eval_shape(example_rewards)
    return game, own


def _require_function(name: str, option: object, count: int, bound: str) -> None:
    """Refuse what is no function of this number of arguments, such as a class."""
    if not callable(option) or isinstance(option, type):
        require(False, name, option, bound)
        return
    try:
        inspect.signature(option).bind(*[None] * count)
    except TypeError as error:
        require(False, name, getattr(option, "__name__", option), f"{bound}: {error}")


def as_role(name: object) -> Role:
    """Return a side, or that of a name, which an environment's specification in JSON has; raises
    InvalidInput.
    """
    sides = {str(role).lower(): role for role in Role}
    require(str(name).lower() in sides, "role", name, f"one of {', '.join(sides)}")
    return sides[str(name).lower()]


def require_option(environment: type, unknown: dict[str, Any]) -> None:
    """Refuse arguments that an environment does not have."""
    names = list(inspect.signature(environment).parameters)[:-1]
    for name in unknown:
        remedy = f"the arguments are {', '.join(names)}"
        raise InvalidInput(unknown_name("argument", name, remedy, closest_names(name, names)))


def require_no_options(options: dict[str, Any] | None) -> None:
    """Refuse options of a reset."""
    require(not options, "options", options, "left out, as this environment has none")


def observation_space(reads: AbstractObservation) -> gymnasium.spaces.Box:
    """Return the space of a robot's observations.

    The package's observations are within 2 of 0, unless a robot goes half an arena beyond the walls
    in one step; others may have all numbers.
    """
    most = 2.0 if reads in OWN else np.inf
    return gymnasium.spaces.Box(-most, most, (reads.size,), np.float32)


def action_space(actions: str) -> gymnasium.spaces.Space[Any]:
    """Return the space of a robot's actions of a kind; raises InvalidInput if it is unknown."""
    require(
        actions in ("discrete", "continuous"), "actions", actions, "one of discrete, continuous"
    )
    continuous = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    return continuous if actions == "continuous" else gymnasium.spaces.Discrete(NUM_ACTIONS)


def as_actions(value: Any, kind: str, batch: tuple[int, ...] = ()) -> np.ndarray:
    """Convert one action of a kind, or a batch, to its number type; raises InvalidInput outside of
    the space.
    """
    discrete = kind == "discrete"
    name = "actions" if batch else "action"
    numbers = "a whole number" if discrete else "numbers"
    shape = batch if discrete else (*batch, 2)
    least, most = (0, NUM_ACTIONS - 1) if discrete else (-1, 1)
    try:
        actions = np.asarray(value)
    except ValueError:  # of lists of several lengths
        actions = np.asarray(None)
    # A message costs as much as a step of the game.
    if actions.dtype.kind not in ("iu" if discrete else "iuf"):
        require(False, name, value, f"{numbers} from {least} to {most}")
    if actions.shape != shape:
        require(False, f"shape of {name}", actions.shape, str(shape))
    low, high = (actions.min(), actions.max()) if shape else (actions, actions)
    if not (least <= low and high <= most):
        require(False, name, low if low == high else f"{low} to {high}", f"from {least} to {most}")
    return actions.astype(np.int32 if discrete else np.float32)


def random_bits(random: np.random.Generator) -> np.uint32:
    return np.uint32(random.integers(2**32, dtype=np.uint64))
