"""Games of more than two robots: the mates of either side's first robot, and the order of robots by distance."""

import functools
import operator
from collections.abc import Sequence
from typing import TypeVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Flag, RobotState, Scalar, choose

T = TypeVar("T")
Body = Unicycle
"""The class of all robots. Another kind extends it by fields that are 0 in the robots so far, and is named here."""


class Teams(eqx.Module):
    """The limits of either side's robots besides its first one, and whether mates that touch are out of play."""

    pursuers: tuple[Body, ...] = ()
    evaders: tuple[Body, ...] = ()
    mates_collide: bool = eqx.field(static=True, default=False)


def nearest(here: RobotState, robots: Sequence[RobotState], active: Sequence[Flag | bool], values: Sequence[T]) -> T:
    """Return the value of the active robot nearest to one: of two equally near the first one's, without any the first.

    Each of the robots, one at least, has a value, pytrees of one structure.
    """
    best, least = values[0], jnp.where(active[0], distance_squared(here, robots[0]), jnp.inf)
    for robot, counts, value in zip(robots[1:], active[1:], values[1:], strict=True):
        away = jnp.where(counts, distance_squared(here, robot), jnp.inf)
        nearer = away < least
        best, least = choose(nearer, value, best), jnp.minimum(away, least)
    return best


def by_distance(
    here: RobotState, robots: Sequence[RobotState], active: Sequence[Flag | bool], values: Sequence[T]
) -> list[T]:
    """Return all values, those of active robots first, from the nearest to the farthest; arguments as of `nearest`."""
    away = [
        jnp.where(counts, distance_squared(here, robot), jnp.inf) for robot, counts in zip(robots, active, strict=True)
    ]

    def place(number: int) -> Int[Array, ""]:
        """Return the number of robots that come before one."""
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
            found = choose(here == wanted, value, found)
        return found

    return [at(wanted) for wanted in range(len(away))]


def distance_squared(first: RobotState, second: RobotState) -> Scalar:
    """Return the squared distance [m^2] between two robots' centres."""
    dx, dy = second.x - first.x, second.y - first.y
    return dx * dx + dy * dy


def separation(first: RobotState, second: RobotState) -> Scalar:
    """Return the distance [m] between two robots' centres."""
    return jnp.hypot(second.x - first.x, second.y - first.y)
