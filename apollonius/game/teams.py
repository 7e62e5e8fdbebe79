"""Games of more robots than two: who they are besides the first of either side, and which robot is the nearest."""

import functools
import operator
from collections.abc import Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import RobotState, Scalar

T = TypeVar("T")


class Teams(eqx.Module):
    """The robots of either side besides its first one.

    Attributes:
        pursuers, evaders: the limits of each.
        mates_collide: whether robots of one side whose bodies touch are out of play.
    """

    pursuers: tuple[Unicycle, ...] = ()
    evaders: tuple[Unicycle, ...] = ()
    mates_collide: bool = eqx.field(static=True, default=False)


def nearest(
    here: RobotState, robots: Sequence[RobotState], active: Sequence[Bool[Array, ""] | bool], values: Sequence[T]
) -> T:
    """Of values, one for each of some robots, that of the active robot whose centre is nearest.

    Of two that are equally near it is the first one's, and where none is active that of the first robot.

    Args:
        here: from where it is looked.
        robots: at least one.
        active: which of them count.
        values: pytrees of one structure.
    """
    best, least = values[0], jnp.where(active[0], distance_squared(here, robots[0]), jnp.inf)
    for robot, counts, value in zip(robots[1:], active[1:], values[1:], strict=True):
        away = jnp.where(counts, distance_squared(here, robot), jnp.inf)
        nearer = away < least
        best, least = _choose(nearer, value, best), jnp.minimum(away, least)
    return best


def by_distance(
    here: RobotState, robots: Sequence[RobotState], active: Sequence[Bool[Array, ""] | bool], values: Sequence[T]
) -> list[T]:
    """All of these values, those of the active robots from the nearest to the farthest first, then the rest.

    Of two that are equally near the first one comes first; the first of all is that of `nearest`.

    Args:
        here, robots, active, values: as `nearest` has them, but there may be none.
    """
    away = [
        jnp.where(counts, distance_squared(here, robot), jnp.inf) for robot, counts in zip(robots, active, strict=True)
    ]

    def place(number: int) -> Int[Array, ""]:
        """How many come before the robot of this number."""
        before = [
            away[other] <= away[number] if other < number else away[other] < away[number]
            for other in range(len(away))
            if other != number
        ]
        return functools.reduce(operator.add, (flag.astype(jnp.int32) for flag in before), jnp.zeros((), jnp.int32))

    places = [place(number) for number in range(len(away))]

    def at(wanted: int) -> T:
        found = values[0]
        for value, here in zip(values[1:], places[1:], strict=True):
            found = _choose(here == wanted, value, found)
        return found

    return [at(wanted) for wanted in range(len(away))]


def _choose(first: Bool[Array, ""], one: T, other: T) -> T:
    def choose(one: Any, other: Any) -> Any:
        return one if one is other else jnp.where(first, one, other)

    return jax.tree.map(choose, one, other)


def distance_squared(first: RobotState, second: RobotState) -> Scalar:
    """Squared distance [m^2] between two robots' centres."""
    dx, dy = second.x - first.x, second.y - first.y
    return dx * dx + dy * dy
