"""PettingZoo's interface: what its own tests say, and that it is the very same game."""

import functools

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, render_test, seed_test
from pettingzoo.utils.conversions import parallel_to_aec

import apollonius
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.registry import observe

AGENTS = {"pursuer_0": Role.PURSUER, "evader_0": Role.EVADER}
PAPER = make_game("paper")
SHORT = Game(arena=PAPER.arena, max_steps=3)


@pytest.fixture(scope="module")
def env():
    return apollonius.parallel_env()


def test_pettingzoos_parallel_test_has_no_complaint(env):
    """Warnings are errors here."""
    parallel_api_test(env, num_cycles=300)


def test_parts_of_the_largest_controls_move_the_robot_by_these_parts():
    env = apollonius.parallel_env(actions="continuous", observation="paper")
    parallel_api_test(env, num_cycles=100)
    env.reset(seed=0)
    for _ in range(4):
        seen, *_ = env.step({"pursuer_0": np.float32([0.5, 0.0]), "evader_0": np.float32([0.25, 1.0])})
    pursuer, evader = seen["pursuer_0"][:4], seen["evader_0"][:4]
    assert pursuer[2] == pytest.approx(2 * 4 * 0.1 * 0.5 * 0.3 / 1.2 - 1, abs=1e-5)
    assert evader[2] == pytest.approx(2 * 4 * 0.1 * 0.25 * 0.3 / 1.2 - 1, abs=1e-5)


def test_pettingzoos_seed_tests_have_no_complaint():
    parallel_seed_test(apollonius.parallel_env, num_cycles=50)
    seed_test(lambda: parallel_to_aec(apollonius.parallel_env()), num_cycles=50)


def test_as_an_aec_environment_it_passes_pettingzoos_test(env):
    api_test(parallel_to_aec(env), num_cycles=300)


def test_pettingzoos_render_test_has_no_complaint(monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    make = functools.lru_cache(apollonius.parallel_env)  # one compilation for each mode
    render_test(lambda render_mode: parallel_to_aec(make(render_mode=render_mode)))
    assert "ongoing" in capsys.readouterr().out


def test_a_game_goes_as_the_rules_say(env):
    seen, infos = env.reset(seed=5)
    assert infos == {agent: {"outcome": "ongoing"} for agent in AGENTS}
    bits = np.random.Generator(np.random.PCG64(5)).integers(2**32, dtype=np.uint64)
    state = PAPER.reset(jax.random.key(np.uint32(bits)))
    step = jax.jit(PAPER.step)
    rng = np.random.default_rng(0)
    for _ in range(400):
        for agent, role in AGENTS.items():
            np.testing.assert_allclose(seen[agent], observe(PAPER, state, role, "encoded"), atol=1e-4)
        pursuer, evader = rng.integers(3, 9), rng.integers(9)
        seen, rewards, terminations, truncations, infos = env.step({"pursuer_0": pursuer, "evader_0": evader})
        after = step(state, jnp.int32(pursuer), jnp.int32(evader))
        expected = {"pursuer_0": after.reward.pursuer, "evader_0": after.reward.evader}
        assert rewards == pytest.approx({agent: float(reward) for agent, reward in expected.items()}, abs=1e-4)
        assert terminations == dict.fromkeys(AGENTS, bool(after.terminated))
        assert truncations == dict.fromkeys(AGENTS, False)
        assert infos["evader_0"] == infos["pursuer_0"] == {"outcome": Outcome(int(after.outcome)).name.lower()}
        state = after.state
        if after.terminated:
            break
    assert after.terminated
    assert env.agents == []


def test_the_time_limit_truncates_and_does_not_terminate():
    env = apollonius.parallel_env(SHORT, observation="paper")
    env.reset(seed=0)
    for left in (2, 1, 0):
        _, _, terminations, truncations, infos = env.step({"pursuer_0": 4, "evader_0": 4})
        assert set(terminations.values()) == {False}
        assert set(truncations.values()) == {left == 0}
    assert infos["pursuer_0"]["outcome"] == "no_result"
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step({"pursuer_0": 4, "evader_0": 4})


def test_seed_zero_is_a_seed_and_later_games_follow_from_it(env):
    def two_games(seed):
        return np.concatenate([env.reset(seed=seed)[0]["pursuer_0"], env.reset()[0]["pursuer_0"]])

    assert (two_games(0) == two_games(0)).all()
    assert (two_games(0)[:17] != two_games(0)[17:]).any()
    assert (two_games(0) != two_games(1)).any()
    env.reset(seed=None)


def test_what_is_told_stays_as_it_was(env):
    seen, _ = env.reset(seed=1)
    before = {agent: numbers.copy() for agent, numbers in seen.items()}
    env.step({"pursuer_0": 8, "evader_0": 6})
    assert all((seen[agent] == before[agent]).all() for agent in AGENTS)


def test_bad_input_is_refused(env):
    with pytest.raises(gymnasium.error.ResetNeeded):
        apollonius.parallel_env(SHORT).step({"pursuer_0": 0, "evader_0": 0})
    env.reset()
    with pytest.raises(InvalidInput, match=r"action = 9 .* from 0 to 8"):
        env.step({"pursuer_0": 9, "evader_0": 0})
    with pytest.raises(InvalidInput, match=r"action = None .* from 0 to 8"):
        env.step({"pursuer_0": 0})
    for bad in ({"game": "chess"}, {"observation": "eyes"}, {"render_mode": "hologram"}):
        with pytest.raises(InvalidInput, match=next(iter(bad.values()))):
            apollonius.parallel_env(**bad)
    assert env.possible_agents == list(AGENTS)
