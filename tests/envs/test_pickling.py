"""Environments pickle, before their first game and in the middle of one, and their copies go on alike."""

import pickle

import numpy as np
import pytest

import apollonius
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.vector import ManyGames
from apollonius.game.types import Role

MAKE = {
    "both sides": lambda: apollonius.parallel_env(render_mode="rgb_array"),
    "one side, shielded opponent, continuous": lambda: OneSide(
        Role.EVADER, opponent="shielded:random", game="territory", actions="continuous"
    ),
    "many games": lambda: ManyGames(Role.PURSUER, 16, autoreset_mode="NextStep"),
}


def follow(env, first_turn, turns):
    """What an environment tells for some turns of random actions, begun anew after an end."""
    told = []
    for turn in range(first_turn, first_turn + turns):
        rng = np.random.default_rng(turn)
        if hasattr(env, "possible_agents"):
            heard = env.step({agent: rng.integers(6, 9) for agent in env.possible_agents})
            over = not env.agents
        elif hasattr(env, "num_envs"):
            heard, over = env.step(rng.integers(6, 9, env.num_envs)), False
        else:
            heard = env.step(np.float32(rng.uniform(-1, 1, 2)))
            over = heard[2] or heard[3]
        told += [heard, env.reset() if over else None]
    return told, env.render() if env.render_mode else None


@pytest.mark.parametrize("name", [pytest.param(one, marks=pytest.mark.slow) if "," in one else one for one in MAKE])
def test_a_copy_goes_on_alike(name):
    env = MAKE[name]()
    untouched = pickle.loads(pickle.dumps(env))
    env.reset(seed=7)
    until_here = follow(env, 0, 25)
    copied = pickle.loads(pickle.dumps(env))
    np.testing.assert_equal(follow(copied, 25, 40), follow(env, 25, 40))
    untouched.reset(seed=7)
    np.testing.assert_equal(follow(untouched, 0, 25), until_here)
