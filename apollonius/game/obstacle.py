"""What every obstacle can say: how far away it is, and whether a straight step touches it."""

from abc import abstractmethod
from typing import TYPE_CHECKING

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool

from apollonius.game.types import Real, RobotState, Scalar

if TYPE_CHECKING:
    from apollonius.game.arena import Arena


def closest_approach_squared(px: Scalar, py: Scalar, dx: Real, dy: Real) -> Scalar:
    """Squared distance [m^2] from the origin to the segment from (px, py) to (px + dx, py + dy)."""
    length_squared = dx * dx + dy * dy
    fraction = jnp.clip(-(px * dx + py * dy) / jnp.maximum(length_squared, 1e-12), 0.0, 1.0)
    nearest_x = px + fraction * dx
    nearest_y = py + fraction * dy
    return nearest_x * nearest_x + nearest_y * nearest_y


Corners = tuple[tuple[Real, Real], ...]
"""Corners x, y [m] of a shape with straight edges, in order."""


class AbstractObstacle(eqx.Module):
    """Something that no robot may touch. Its numbers are data; only how many they are is static."""

    @abstractmethod
    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        """Distance [m] from a point; negative inside."""

    @abstractmethod
    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        """Least clearance [m] on the segment between two states; too short rather than too long."""

    def is_hit(self, before: RobotState, after: RobotState, radius: Real) -> Bool[Array, ""]:
        """Whether a body of this radius [m] touches it anywhere along the segment between two states."""
        return self.clearance_along(before, after) < radius

    def outline(self) -> Corners:
        """What it looks like, for pictures of what is neither a disc nor a map; without corners it is not drawn."""
        return ()

    def check(self, name: str, arena: "Arena") -> None:
        """Refuse one that cannot be.

        Args:
            name: what it is called where it was given.
            arena: its walls are all that is looked at.

        Raises:
            InvalidInput: names value, bound and remedy.
        """
