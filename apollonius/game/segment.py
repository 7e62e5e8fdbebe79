"""How near a straight step comes to a point: what capture and every contact are judged by."""

import jax.numpy as jnp

from apollonius.game.types import Real, Scalar


def closest_approach_squared(px: Scalar, py: Scalar, dx: Real, dy: Real) -> Scalar:
    """Squared distance [m^2] from the origin to the segment from (px, py) to (px + dx, py + dy)."""
    length_squared = dx * dx + dy * dy
    fraction = jnp.clip(-(px * dx + py * dy) / jnp.maximum(length_squared, 1e-12), 0.0, 1.0)
    nearest_x = px + fraction * dx
    nearest_y = py + fraction * dy
    return nearest_x * nearest_x + nearest_y * nearest_y
