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


def in_fog(game: Game) -> Role | None:
    """Return the side whose fog is drawn: the pursuer or, if it sees everything, the evader; None if both do."""
    return next((role for role in Role if game.sensors and game.sensors[role]), None)


def fog(replay: Replay) -> Bool[np.ndarray, "states rows columns"] | None:
    """Return the coarse cells of the chart in which that side believed opponents possible, in each state of a game."""
    role = in_fog(replay.game)
    if role is None:
        return None
    states, key = replay.trajectory().states, keys_of(np.uint32(replay.seed))[1]
    bits = random_bits_of(key, jnp.full(len(replay.states), replay.index), states.steps)
    return np.asarray(_beliefs(charted(replay.game), states, bits[role], role)) >= 0


@functools.partial(jax.jit, static_argnames="role")
def _beliefs(game: Game, states: GameState, bits: UInt32[Array, " states"], role: Role) -> Array:
    def one(track: Any, now: tuple[GameState, UInt32[Array, ""]]) -> tuple[Any, Any]:
        state, own_bits = now
        track = tracking.follow(game, track, state, role, own_bits)
        sight = tracking.believed(game, track, state, role).sight
        return track, sight and sight.belief

    first = tracking.begin(game, jax.tree.map(lambda leaf: leaf[0], states), role)
    return jax.lax.scan(one, first, (states, bits))[1]
