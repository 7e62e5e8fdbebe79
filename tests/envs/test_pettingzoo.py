"""PettingZoo's interface: no complaint from its own tests, a game by the rules, and agents of teams that leave."""

import copy

import gymnasium
import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
from pettingzoo.utils.conversions import parallel_to_aec

import apollonius
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput

AGENTS = {"pursuer_0": Role.PURSUER, "evader_0": Role.EVADER}
PAPER = make_game("paper")
SHORT = Game(arena=PAPER.arena, max_steps=3)
STAY = dict.fromkeys(AGENTS, 4)


@pytest.fixture(scope="module")
def env():
    return apollonius.parallel_env()


@pytest.fixture(scope="module")
def team():
    return apollonius.parallel_env("team-3v2", render_mode="rgb_array")


@pytest.mark.parametrize("players", ["env", "team"])
def test_pettingzoos_tests_have_no_complaint(players, request):
    """Warnings are errors here. A copy has the compilation of what it is a copy of."""
    env = request.getfixturevalue(players)
    parallel_api_test(env, num_cycles=100)
    parallel_seed_test(lambda: copy.deepcopy(env), num_cycles=25)
    api_test(parallel_to_aec(copy.deepcopy(env)), num_cycles=100)
    seed_test(lambda: parallel_to_aec(copy.deepcopy(env)), num_cycles=25)


def test_parts_of_the_largest_controls_move_the_robot_by_these_parts():
    env = apollonius.parallel_env(actions="continuous", observation="paper")
    env.reset(seed=0)
    for _ in range(4):
        seen, *_ = env.step({"pursuer_0": np.float32([0.5, 0.0]), "evader_0": np.float32([0.25, 1.0])})
    speeds = [seen[agent][2] for agent in AGENTS]
    assert speeds == pytest.approx([2 * 4 * 0.1 * part * 0.3 / 1.2 - 1 for part in (0.5, 0.25)], abs=1e-5)


def test_the_time_limit_truncates_and_does_not_terminate():
    env = apollonius.parallel_env(SHORT, observation="paper")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(STAY)
    env.reset(seed=0)
    for left in (2, 1, 0):
        _, _, terminations, truncations, infos = env.step(STAY)
        assert set(terminations.values()) == {False}
        assert set(truncations.values()) == {left == 0}
    assert infos["pursuer_0"]["outcome"] == "no_result"
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(STAY)


def test_bad_input_is_refused(env):
    env.reset()
    with pytest.raises(InvalidInput, match=r"action = 9 .* from 0 to 8"):
        env.step({"pursuer_0": 9, "evader_0": 0})
    with pytest.raises(InvalidInput, match=r"action = None .* from 0 to 8"):
        env.step({"pursuer_0": 0})
    for bad in ({"game": "chess"}, {"observation": "eyes"}, {"render_mode": "hologram"}):
        with pytest.raises(InvalidInput, match=next(iter(bad.values()))):
            apollonius.parallel_env(**bad)


def test_agents_leave_when_they_are_out_and_the_game_goes_on(team):
    """All drive on straight until one after the other leaves the walls or hits something."""
    env, left, steps = team, {}, 0
    seen, infos = env.reset(seed=3)
    assert list(seen) == env.agents == ["pursuer_0", "pursuer_1", "pursuer_2", "evader_0", "evader_1"]
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
            if gone:
                left[agent] = infos[agent]["status"], rewards[agent], steps
        assert not any(truncations.values())
    assert len({step for _, _, step in left.values()}) >= 2
    assert {status for status, _, _ in left.values()} <= {"captured", "hit_obstacle", "out_of_range"}
    assert all(reward == -10 for status, reward, _ in left.values() if status != "captured")
    assert (env.render() != first).any()
