"""Environments pickle, before their first game and in the middle of one, and their copies go on alike."""

import pickle

import gymnasium
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


@pytest.mark.slow
def test_spawned_processes_take_a_game_under_way():
    """As `AsyncVectorEnv` sends it: what each process tells is what the game here tells."""
    env = OneSide(Role.PURSUER, opponent="E_scratch")
    env.reset(seed=3)
    for _ in range(5):
        env.step(8)
    many = gymnasium.vector.AsyncVectorEnv([lambda: env] * 2, context="spawn")
    try:
        seen, _ = many.reset(seed=[11, 12])
        told = [many.step(np.array([8, 8])) for _ in range(10)]
    finally:
        many.close()
    for index, seed in enumerate((11, 12)):
        np.testing.assert_array_equal(seen[index], env.reset(seed=seed)[0])
        for step in told:
            np.testing.assert_array_equal(step[0][index], env.step(8)[0])
