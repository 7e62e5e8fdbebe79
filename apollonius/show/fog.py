"""Fog: where the opponents of a side with sensors could be, as far as it knew, in a recorded game."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, UInt32

from apollonius.arenas.charting import charted
from apollonius.evaluate.match import keys_of
from apollonius.game.game import Game
from apollonius.game.types import GameState, Role
from apollonius.observe import tracking
from apollonius.play.random_bits import random_bits_of
from apollonius.play.replay import Replay


def fog(replay: Replay) -> tuple[Role, Bool[np.ndarray, "states rows columns"]] | None:
    """Return a side and the coarse cells of the chart in which its robots could be in each state, as the other knew.

    The other side is the pursuer's or, if that sees everything, the evader's; None if both do.
    """
    game = replay.game
    role = next((role for role in Role if game.sensors and game.sensors[role]), None)
    if role is None:
        return None
    states, key = replay.trajectory().states, keys_of(np.uint32(replay.seed))[1]
    bits = random_bits_of(key, jnp.full(len(replay.states), replay.index), states.steps)
    return role.other, np.asarray(_beliefs(charted(game), states, bits[role], role)) >= 0


@functools.partial(jax.jit, static_argnames="role")
def _beliefs(game: Game, states: GameState, bits: UInt32[Array, " states"], role: Role) -> Array:
    def one(track: Any, now: tuple[GameState, UInt32[Array, ""]]) -> tuple[Any, Any]:
        state, own_bits = now
        track, known = tracking.update(game, role, track, state, own_bits)
        return track, known.sight and known.sight.belief

    first = tracking.begin(game, jax.tree.map(lambda leaf: leaf[0], states), role)
    return jax.lax.scan(one, first, (states, bits))[1]
