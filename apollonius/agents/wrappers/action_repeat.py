"""A player that decides once in a while and holds its action in between, for one whose decisions
are expensive.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from apollonius.accelerate.batch_rule import broadcast_rows, with_batch_function
from apollonius.accelerate.few_rows import compute_where
from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.game.types import Action, RandomBits
from apollonius.observe.observation import RawView

_DECIDE = 16
"""Rows of a batch that decide at a time."""


class ActionRepeat(AbstractWrapper[AbstractPolicy]):
    """A player that is asked in every n-th step of a game, and whose action is held in between."""

    steps: int = eqx.field(static=True)

    @property
    def observation(self) -> RawView:
        return self.policy.observation

    @property
    def memory(self) -> Memory:
        """The memory of the player inside, its action, and the number of steps for which that is
        still held.
        """
        action = jnp.zeros(2) if self.continuous else jnp.int32(0)
        return {"own": self.policy.memory, "action": action, "left": jnp.int32(0)}

    def __call__(self, observation: Any, memory: Memory, bits: RandomBits) -> tuple[Action, Memory]:
        action, own_memory = _repeat(self.policy, observation, memory, bits)
        remaining = jnp.where(memory["left"] == 0, self.steps, memory["left"]) - 1
        return action, {"own": own_memory, "action": action, "left": remaining}


def _repeat_in_batch(
    size: int, batched: Any, policy: AbstractPolicy, observation: Any, memory: Memory, bits: Array
) -> tuple[Array, Memory]:
    memory = broadcast_rows(size, batched[2], memory)
    bits = broadcast_rows(size, batched[3], bits)

    def some(rows: Array) -> tuple[Array, Memory]:
        their_views = jax.tree.map(
            lambda leaf, has: leaf[rows] if has else leaf, observation, batched[1]
        )
        axes = jax.tree.map(lambda has: 0 if has else None, batched[1])
        memories, random_bits = jax.tree.map(lambda leaf: leaf[rows], (memory["own"], bits))
        return jax.vmap(policy, in_axes=(axes, 0, 0))(their_views, memories, random_bits)

    return compute_where(memory["left"] == 0, some, (memory["action"], memory["own"]), _DECIDE)


@with_batch_function(_repeat_in_batch)
def _repeat(
    policy: AbstractPolicy, observation: Any, memory: Memory, bits: RandomBits
) -> tuple[Action, Memory]:
    """Return the action that is held, decided now if that is due, and the memory of the player that
    decides.
    """
    last = memory["action"], memory["own"]
    return jax.lax.cond(
        memory["left"] == 0, lambda: policy(observation, memory["own"], bits), lambda: last
    )
