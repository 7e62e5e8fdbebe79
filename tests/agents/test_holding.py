"""A player that decides once in a while and holds its action in between."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.classical import Uniform
from apollonius.agents.holding import Holding
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import Apart, solo
from apollonius.game.by_side import BySide
from apollonius.game.game import sample_starts
from apollonius.play.playout import play_out
from apollonius.play.replay import trace
from apollonius.play.rollout import begin, collect
from tests.solve.small import SMALL

GAME = replace(SMALL, max_steps=120)
RUNNER = Uniform()
STARTS, KEY = sample_starts(GAME, jax.random.key(0), 40), jax.random.key(1)


class Drifting(AbstractPolicy):
    """Speeds up every other time that it is asked, and turns by its random bits."""

    @property
    def memory(self):
        return jnp.int32(0)

    def __call__(self, seen, memory, bits):
        return 3 * (1 + memory % 2) + bits.astype(jnp.int32) % 3, memory + 1


def test_what_was_decided_is_held_from_the_start_of_each_game():
    """Games begin as others end; its own memory goes on as it decides."""
    players = BySide(solo(Holding(Drifting(), 7)), solo(RUNNER))
    results = play_out(GAME, players, STARTS, KEY, slots=16)
    for game in (0, 39):
        course = trace(GAME, players, STARTS, KEY, game)
        actions = np.asarray(course.actions)[:, 0]
        assert len(actions) == results.steps[game] > 14
        decided = actions[::7]
        np.testing.assert_array_equal(actions, np.repeat(decided, 7)[: len(actions)])
        np.testing.assert_array_equal(decided // 3, 1 + np.arange(len(decided)) % 2)
        assert len(set(decided % 3)) > 1


def test_players_of_several_kinds_have_games_of_their_own():
    """Each plays its part of a batch as it would play all of it, with a memory of its own."""
    kinds, games = (Holding(Drifting(), 2), Drifting()), (2, 3)
    starts = jax.tree.map(lambda leaf: leaf[:5], STARTS)

    @jax.jit
    def played(pursuers):
        players = BySide(pursuers, solo(RUNNER))
        begun = begin(GAME, starts, players, jnp.zeros((2, 5), jnp.uint32))
        return collect(GAME, players, begun, jax.tree.map(lambda leaf: leaf[None], starts), KEY, 6)[1].sides.pursuer

    together = played(Apart(kinds, games))
    assert together.member[-1].tolist() == [0, 0, 1, 1, 1]
    for number, one in enumerate(kinds):
        own = np.repeat([0, 1], games) == number
        np.testing.assert_array_equal(together.action[:, own], played(solo(one)).action[:, own])
