"""A best response learns to do better against a player that stays as it is; one seed gives one response."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.evaluate.match import play_match
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Role
from apollonius.learn.best_response import best_response
from apollonius.learn.state import Plan
from tests.learn.tiny import CHUNK, DQN, GAME, STAGE

PLAN = Plan(
    replace(
        DQN,
        learning_starts=2_000,
        final_epsilon=0.1,
        env_steps_per_update=32,
        target_period=2_048,
        averaging=0.02,
        gamma=0.95,
    ),
    replace(STAGE, env_steps=4 * CHUNK),
)


@pytest.mark.slow
def test_an_evader_that_cannot_stop_learns_not_to_crash():
    """The pursuer stays, so all that the evader loses it loses by itself."""
    game = replace(GAME, pursuer=Unicycle(), evader=Unicycle(v_min=0.6))
    untrained = make_network("paper", 16, 1, jax.random.key(9))

    def escapes(network):
        return 1 - play_match(game, Still(), Greedy(network), 500, seed=0).pursuer_win_rate

    response = best_response(PLAN, game, Still(), Role.EVADER, seed=0, first=untrained)
    assert escapes(untrained) < 0.3
    assert escapes(response) > 0.5


def test_the_network_it_goes_on_from_is_kept():
    first = make_network("paper", 16, 1, jax.random.key(9))
    before = jax.tree.map(np.array, first)
    best_response(PLAN, GAME, Still(), Role.PURSUER, seed=0, first=first)
    assert jax.tree.all(jax.tree.map(np.array_equal, first, before))


@pytest.mark.slow
def test_seeds_differ_and_repeat():
    one, again, other = (best_response(PLAN, GAME, Still(), Role.PURSUER, seed) for seed in (0, 0, 1))
    same = jax.tree.map(np.array_equal, one, again)
    assert jax.tree.all(same)
    assert not jax.tree.all(jax.tree.map(np.array_equal, one, other))
