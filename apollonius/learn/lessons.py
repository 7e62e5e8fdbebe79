"""What a teacher has said: a ring of observations, and what the nine actions are worth there."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int


class Lessons(eqx.Module):
    """A ring of observations and what the nine actions are worth there; `head` is written next, `filled` are there."""

    observation: Float[Array, "rows size"]
    worths: Float[Array, "rows 9"]
    head: Int[Array, ""]
    filled: Int[Array, ""]

    def add(self, observation: Float[Array, "new size"], worths: Float[Array, "new 9"]) -> "Lessons":
        """The same with some more; the oldest go. Their number divides that of the rows."""

        def put(ring: Array, new: Array) -> Array:
            return jax.lax.dynamic_update_slice_in_dim(ring, new, self.head, 0)

        rows, new = len(self.observation), len(observation)
        return Lessons(
            put(self.observation, observation),
            put(self.worths, worths),
            (self.head + new) % rows,
            jnp.minimum(self.filled + new, rows),
        )
