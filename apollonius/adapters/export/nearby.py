"""What the package's player sees next to a state: an observation by a chart jumps, and rounding says to which side.

Which stops can be seen is known cell by cell, and an opponent comes into sight at once. On such an edge, to rounding,
two programs see different things, and both are right that see what the player does a hair's breadth from there.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from apollonius.adapters.export.blueprint import Blueprint
from apollonius.arenas.charting import charted
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.observe.registry import observe
from apollonius.replay import as_state

BREADTH = 1e-5
"""How far from a state it is looked, in each of its numbers [m, m/s, rad]: some ten times the rounding of places."""
_STATES = 64


def seen_nearby(blueprint: Blueprint, state: Float32[np.ndarray, "8"]) -> Float32[np.ndarray, "states size"]:
    """Observations of the package in some states around one."""
    moved = np.random.default_rng(0).uniform(-BREADTH, BREADTH, (_STATES, 8))
    rows = jnp.asarray(state + moved, jnp.float32)
    role = Role[blueprint.header.role.upper()]
    return np.asarray(_seen(charted(blueprint.game), rows, role, blueprint.header.observation))


@functools.partial(jax.jit, static_argnames=("role", "name"))
def _seen(game: Game, rows: Float[Array, "states 8"], role: Role, name: str) -> Float[Array, "states size"]:
    """Of one side in states whose own robot comes first."""
    pursuer_first = rows if role == Role.PURSUER else jnp.roll(rows, 4, axis=-1)
    return jax.vmap(lambda row: observe(game, as_state(row, jnp.asarray(0)), role, name))(pursuer_first)
