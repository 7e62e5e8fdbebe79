"""What a player reads of a view: the view itself, or a row of numbers that an observation makes of it."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.arena import Arena
from apollonius.game.types import Real, Scalar
from apollonius.observe.view import Robot, View, Views


@dataclass(frozen=True)
class Whole:
    """The view itself, for players that follow a rule."""

    charted: ClassVar[bool] = False
    """Whether it reads the arena's chart (`apollonius.arenas.charting`)."""

    def __call__(self, view: View) -> Any:
        """What is read of a view."""
        return view

    def together(self, views: Views) -> Any:
        """The same of the views in many games."""
        return views


WHOLE = Whole()


@dataclass(frozen=True)
class AbstractObservation(Whole):
    """The numbers that a network reads."""

    name: ClassVar[str]
    """What files call it."""
    size: ClassVar[int]
    """How many numbers they are."""
    exported: ClassVar[bool] = False
    """Whether exported policies can make them: there is a file for each format."""
    measures: ClassVar[bool] = True
    """Whether the arena is in them by more than its walls."""
    extends: ClassVar[str | None] = None
    """Name of the observation that the first of these numbers are, if they are one: its networks can go on here."""

    @abstractmethod
    def __call__(self, view: View) -> Float[Array, " size"]:
        """The numbers for a view."""

    def together(self, views: Views) -> Float[Array, "games size"]:
        """Those for the views in many games."""
        return views.each(self)


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
