"""Shields of robots that differ, made alike: one structure for all, and the same room for each."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.shield import BRAKING, Shielded
from apollonius.agents.uniform import Uniform
from apollonius.catalogue import find_player
from apollonius.evaluate.shields import alike
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.types import RobotState, Role

SQUARES = tuple(
    Polygon(((x, y), (x + 0.5, y), (x + 0.5, y + 0.5), (x, y + 0.5))) for x, y in ((3.0, 3.0), (6.0, 3.0), (3.0, 6.0))
)
GAME = Game(arena=Arena(polygons=SQUARES))


def shielded(v_max):
    """A random pursuer of this top speed [m/s] behind a shield."""
    policy = find_player("shielded:random", Role.PURSUER, replace(GAME, pursuer=Unicycle(v_max=v_max))).policy
    assert isinstance(policy, Shielded)
    return policy


def test_shields_get_one_structure_and_leave_as_much_room_as_before():
    before = [shielded(v_max) for v_max in (0.6, 1.8)]
    after = alike(before)
    shapes = [jax.tree.map(jnp.shape, policy) for policy in after]
    assert jax.tree.structure(after[0]) == jax.tree.structure(after[1])
    assert shapes[0] == shapes[1] != jax.tree.map(jnp.shape, before[0])
    places = np.random.default_rng(0).uniform((1, 1, -3), (9, 9, 3), (200, 3)).astype(np.float32)

    @jax.jit
    def rooms(backup, places):
        return jax.vmap(lambda at: backup.rooms(RobotState(at[0], at[1], jnp.float32(0.6), at[2])))(places)

    for old, new in zip(before, after, strict=True):
        found = np.asarray(rooms(old.backup, places))
        assert found.shape == (200, len(BRAKING))
        np.testing.assert_allclose(rooms(new.backup, places), found, atol=1e-5)


def test_players_without_a_shield_are_left_as_they_are():
    players = [Uniform(), Uniform()]
    assert all(one is other for one, other in zip(alike(players), players, strict=True))
