"""Games of more robots than two: who they are besides the first of either side, and which robot is the nearest."""

from collections.abc import Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

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


def _choose(first: Bool[Array, ""], one: T, other: T) -> T:
    def choose(one: Any, other: Any) -> Any:
        return one if one is other else jnp.where(first, one, other)

    return jax.tree.map(choose, one, other)


def distance_squared(first: RobotState, second: RobotState) -> Scalar:
    """Squared distance [m^2] between two robots' centres."""
    dx, dy = second.x - first.x, second.y - first.y
    return dx * dx + dy * dy
