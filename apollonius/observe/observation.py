"""What a player reads of a view: the view itself, or a row of numbers that an observation makes of it."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.types import GameState, Real, Role, Scalar
from apollonius.observe.view import Robot, View, look_from, rows_of


@dataclass(frozen=True)
class Whole:
    """The view itself, for players that follow a rule."""

    charted: ClassVar[bool] = False
    """Whether it reads the arena's chart (`apollonius.arenas.charting`)."""

    def __call__(self, view: View) -> Any:
        """What is read of a view."""
        return view


WHOLE = Whole()


@dataclass(frozen=True)
class AbstractObservation(Whole):
    """The numbers that a network reads."""

    name: ClassVar[str]
    """What files call it."""
    size: ClassVar[int]
    """How many numbers they are."""
    measures: ClassVar[bool] = True
    """Whether the arena is in them by more than its walls."""
    extends: ClassVar[str | None] = None
    """Name of the observation that the first of these numbers are, if they are one: its networks can go on here."""

    @abstractmethod
    def __call__(self, view: View) -> Float[Array, " size"]:
        """The numbers for a view."""


def perceive(observation: Whole, game: Game, states: GameState, role: Role) -> tuple[Callable[[Any], Any], Any]:
    """Return the function from a row to what a player reads, and a row for each robot of a side in each game.

    Numbers are made here, for all rows at once. A whole view is made where a player reads it: outside, all that games
    have in common would be stored once for each of them.

    Args:
        states: of the games, leaves `[games]`.
    """
    rows, view = rows_of(states, role), partial(look_from, game, role)
    if observation == WHOLE:
        return view, rows
    return lambda numbers: numbers, jax.vmap(lambda row: observation(view(row)))(rows)


def scaled(value: Scalar, low: Real, high: Real) -> Scalar:
    """A number mapped from [low, high] to [-1, 1]."""
    return (2 * value - (low + high)) / jnp.maximum(high - low, 1e-6)


def position_and_speed(arena: Arena, robot: Robot) -> list[Scalar]:
    """A robot's x, y and v, mapped from their limits to [-1, 1]."""
    body, state = robot.body, robot.state
    return [
        scaled(state.x, arena.x_min, arena.x_max),
        scaled(state.y, arena.y_min, arena.y_max),
        scaled(state.v, body.v_min, body.v_max),
    ]
