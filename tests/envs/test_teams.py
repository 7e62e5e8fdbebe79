"""Teams from outside: PettingZoo's own tests for three against two, agents that leave, and one robot against a team."""

import copy

import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
from pettingzoo.utils.conversions import parallel_to_aec

import apollonius
from apollonius.envs.gymnasium import OneSide
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput

AGENTS = ["pursuer_0", "pursuer_1", "pursuer_2", "evader_0", "evader_1"]


@pytest.fixture(scope="module")
def env():
    return apollonius.parallel_env("team-3v2", render_mode="rgb_array")


def test_pettingzoos_tests_have_no_complaint(env):
    """Warnings are errors here. A copy has the compilation of what it is a copy of."""
    parallel_api_test(env, num_cycles=100)
    parallel_seed_test(lambda: copy.deepcopy(env), num_cycles=25)
    api_test(parallel_to_aec(copy.deepcopy(env)), num_cycles=100)
    seed_test(lambda: parallel_to_aec(copy.deepcopy(env)), num_cycles=25)


def test_agents_leave_when_they_are_out_and_the_game_goes_on(env):
    """All drive on straight until one after the other leaves the walls or hits something."""
    left, steps = {}, 0
    seen, infos = env.reset(seed=3)
    assert list(seen) == env.agents == env.possible_agents == AGENTS
    assert infos["evader_1"] == {"outcome": "ongoing", "status": "active"}
    first = env.render()
    while env.agents:
        before, steps = list(env.agents), steps + 1
        seen, rewards, terminations, truncations, infos = env.step(dict.fromkeys(before, 7))
        assert list(seen) == list(rewards) == list(terminations) == list(truncations) == list(infos) == before
        over = {info["outcome"] for info in infos.values()} != {"ongoing"}
        for agent in before:
            gone = infos[agent]["status"] != "active"
            assert terminations[agent] == (gone or over)
            assert (agent in env.agents) == (not gone and not over)
            assert np.isfinite(seen[agent]).all()
            if gone:
                left[agent] = infos[agent]["status"], rewards[agent], steps
        assert not any(truncations.values())
    assert len(left) >= 3
    assert len({step for _, _, step in left.values()}) >= 2
    assert {status for status, _, _ in left.values()} <= {"captured", "hit_obstacle", "out_of_range"}
    assert all(reward == -10 for status, reward, _ in left.values() if status != "captured")
    assert (env.render() != first).any()


def test_one_robot_acts_against_a_team_and_a_team_is_for_pettingzoo():
    env = OneSide(Role.EVADER, opponent="pure-pursuit", game="team-3v1")
    env.reset(seed=0)
    over, total = False, 0.0
    while not over:
        _, reward, over, _, info = env.step(4)
        total += reward
    assert info["outcome"] == "captured"
    assert total < -10
    with pytest.raises(InvalidInput, match=r"pursuers = 3 is not possible: .* by PettingZoo"):
        OneSide(Role.PURSUER, game="team-3v1")
