"""Observations: the view itself, or a row of numbers that is made of it."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.types import Real, Role, Scalar
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.surroundings import Surroundings
from apollonius.observe.view import Robot, View, look_from_row, robot_rows


@dataclass(frozen=True)
class RawView:
    """The view itself, for players that follow a rule."""

    needs_chart: ClassVar[bool] = False
    """True for an observation that needs the arena's chart (`apollonius.arenas.charting`)."""

    def __call__(self, view: View) -> Any:
        """Return the observation of a view."""
        return view


RAW_VIEW = RawView()


@dataclass(frozen=True)
class Mirror:
    """The change from the numbers of a view to those of its mirror image: a permutation and some
    flipped signs.
    """

    order: tuple[int, ...]
    signs: tuple[int, ...]

    def __call__(self, numbers: Float[Array, "*rows size"]) -> Float[Array, "*rows size"]:
        """Return the numbers of the mirror images."""
        return numbers[..., np.array(self.order)] * jnp.broadcast_to(
            np.array(self.signs, np.float32), numbers.shape
        )


@dataclass(frozen=True)
class AbstractObservation(RawView):
    """The numbers that a network reads."""

    name: ClassVar[str]
    """Its name in files."""
    size: ClassVar[int]
    """The number of numbers."""
    extends: ClassVar[str | None] = None
    """Name of the observation that the first numbers are, if any: its networks can be trained
    further with this one.
    """

    mirror: ClassVar[Mirror | None] = None
    """The change from its numbers to those of the mirror image; None if it has no such change."""

    @abstractmethod
    def __call__(self, view: View) -> Float[Array, " size"]:
        """Return the numbers of a view."""


def observation_rows(
    observation: RawView, game: Game, knowledge: Knowledge, role: Role
) -> tuple[Callable[[Any], Any], Any]:
    """Return a function that reads a player's observation from a row, and the rows of a side.

    There is a row for each robot of the side in each game. Numbers are computed here, for all rows
    at once. A whole view is made inside the player's `vmap`: outside, all that games have in common
    would be stored once for each.

    Args:
        observation: what the player reads.
        game: the rules.
        knowledge: that of the side, leaves `[games, ...]`.
        role: the side.
    """
    rows, view = robot_rows(knowledge, role), partial(look_from_row, game, role)
    if observation == RAW_VIEW:
        return view, rows
    return lambda numbers: numbers, jax.vmap(lambda row: observation(view(row)))(rows)


def rescale(value: Scalar, low: Real, high: Real) -> Scalar:
    """Map a number from [low, high] to [-1, 1]."""
    return (2 * value - (low + high)) / jnp.maximum(high - low, 1e-6)


@fusion_barrier
def cos_sin(heading: Scalar) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of a heading, which several numbers share."""
    return jnp.cos(heading), jnp.sin(heading)


def clearances_ahead(
    surroundings: Arena | Surroundings, robot: Robot, cos: Scalar, sin: Scalar
) -> list[Scalar]:
    """Return a body's clearances, clipped to [-1, 1] m: now, and at rest after straight braking.

    Args:
        surroundings: the arena, or its chart and movers.
        robot: the robot.
        cos, sin: cosine and sine of its heading.
    """
    body, state = robot.body, robot.state
    braking = state.v * jnp.abs(state.v) / jnp.maximum(2 * body.u1_max, 1e-6)
    clearance_now = surroundings.clearance(state.x, state.y)
    clearance_at_rest = surroundings.clearance(state.x + braking * cos, state.y + braking * sin)
    clearances = (clearance_now, clearance_at_rest)
    return [jnp.clip(clearance - body.radius, -1.0, 1.0) for clearance in clearances]
