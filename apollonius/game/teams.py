"""Games of more than two robots: the mates of either side's first robot, and the order of robots by
distance.
"""

import functools
import operator
from collections.abc import Sequence
from typing import TypeVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Flag, RobotState, Scalar, tree_where

T = TypeVar("T")


class Teams(eqx.Module):
    """The limits of either side's robots besides its first one, and whether mates that touch are
    out of play.
    """

    pursuers: tuple[Unicycle, ...] = ()
    evaders: tuple[Unicycle, ...] = ()
    mates_collide: bool = eqx.field(static=True, default=False)


def nearest(
    origin: RobotState,
    robots: Sequence[RobotState],
    active: Sequence[Flag | bool],
    values: Sequence[T],
) -> T:
    """Return the value of the active robot nearest to a robot.

    The first of equally near robots counts, and the first of all if none is active.

    Args:
        origin: the robot from which distances are measured.
        robots, active: the other robots, one at least, and whether each is in play.
        values: a value for each, pytrees of one structure.
    """
    best, least = values[0], jnp.where(active[0], distance_squared(origin, robots[0]), jnp.inf)
    for robot, is_active, value in zip(robots[1:], active[1:], values[1:], strict=True):
        distance = jnp.where(is_active, distance_squared(origin, robot), jnp.inf)
        nearer = distance < least
        best, least = tree_where(nearer, value, best), jnp.minimum(distance, least)
    return best


def by_distance(
    origin: RobotState,
    robots: Sequence[RobotState],
    active: Sequence[Flag | bool],
    values: Sequence[T],
) -> list[T]:
    """Return all values, those of active robots first, from the nearest to the farthest.

    Args:
        origin, robots, active, values: as in `nearest`.
    """
    distances = [
        jnp.where(is_active, distance_squared(origin, robot), jnp.inf)
        for robot, is_active in zip(robots, active, strict=True)
    ]

    def comes_before(other: int, number: int) -> Flag:
        if other < number:
            return distances[other] <= distances[number]
        return distances[other] < distances[number]

    def rank_of(number: int) -> Int[Array, ""]:
        """Count the robots that come before one."""
        nearer = [comes_before(other, number) for other in range(len(distances)) if other != number]
        return functools.reduce(
            operator.add, (flag.astype(jnp.int32) for flag in nearer), jnp.zeros((), jnp.int32)
        )

    ranks = [rank_of(number) for number in range(len(distances))]

    def at_rank(rank: int) -> T:
        ranked = values[0]
        for value, own_rank in zip(values[1:], ranks[1:], strict=True):
            ranked = tree_where(own_rank == rank, value, ranked)
        return ranked

    return [at_rank(rank) for rank in range(len(distances))]


def distance_squared(first: RobotState, second: RobotState) -> Scalar:
    """Return the squared distance [m^2] between two robots' centres."""
    dx, dy = second.x - first.x, second.y - first.y
    return dx * dx + dy * dy


def separation(first: RobotState, second: RobotState) -> Scalar:
    """Return the distance [m] between two robots' centres."""
    return jnp.hypot(second.x - first.x, second.y - first.y)
