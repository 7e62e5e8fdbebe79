"""Quantities that change in the course of a stage, as functions of environment steps."""

import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.game.types import Real, Scalar


def linear(start: Real, end: Real, over: Real, env_steps: Int[Array, ""]) -> Scalar:
    """From `start` to `end` in a straight line over the first `over` env steps, then constant."""
    fraction = jnp.clip(env_steps.astype(jnp.float32) / jnp.maximum(over, 1), 0.0, 1.0)
    value: Real = start + (end - start) * fraction
    return value
