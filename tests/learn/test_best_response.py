"""A best response beats a player that can be beaten, and only the side that responds learns."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.evaluate.match import play_match
from apollonius.game.types import Role
from apollonius.learn.best_response import best_response
from apollonius.learn.state import Plan
from tests.learn.tiny import CHUNK, DQN, GAME, STAGE

PLAN = Plan(
    replace(DQN, learning_starts=2_000, final_epsilon=0.1, env_steps_per_update=16, target_period=2_048),
    replace(STAGE, env_steps=6 * CHUNK),
)


@pytest.mark.parametrize("role", Role)
def test_a_response_wins_more_than_it_did(role):
    opponent = Greedy(make_network("paper", 16, 1, jax.random.key(8)))
    untrained = make_network("paper", 16, 1, jax.random.key(9))

    def wins(network):
        pursuer, evader = (Greedy(network), opponent) if role == Role.PURSUER else (opponent, Greedy(network))
        result = play_match(GAME, pursuer, evader, 500, seed=0)
        return result.pursuer_win_rate if role == Role.PURSUER else 1 - result.pursuer_win_rate

    response = best_response(PLAN, GAME, opponent, role, seed=0, first=untrained)
    assert wins(response) > wins(untrained) + 0.15


def test_seeds_differ_and_repeat():
    one, again, other = (best_response(PLAN, GAME, Still(), Role.PURSUER, seed) for seed in (0, 0, 1))
    same = jax.tree.map(np.array_equal, one, again)
    assert jax.tree.all(same)
    assert not jax.tree.all(jax.tree.map(np.array_equal, one, other))
