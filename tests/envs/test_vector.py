"""Gymnasium's vector interface: many games at once, each the very same game, ended ones begun again."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import apollonius.envs.gymnasium  # noqa: F401 (registers the environments)
from apollonius.envs.vector import ManyGames
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput

GAMES = 64


@pytest.fixture(scope="module")
def env():
    return ManyGames(Role.EVADER, GAMES, opponent="still")


@pytest.fixture(scope="module")
def course(env):
    """What 250 steps of speeding up told, seeded: `(observation before, actions, what the step returned)`."""
    rng, steps = np.random.default_rng(0), []
    seen, _ = env.reset(seed=3)
    for _ in range(250):
        actions = rng.integers(6, 9, size=GAMES)
        told = env.step(actions)
        steps.append((seen, actions, told))
        seen = told[0]
    return steps


def test_gymnasium_makes_it_without_complaint():
    env = gymnasium.make_vec("apollonius/Pursuit-v0", num_envs=3, vectorization_mode="vector_entry_point")
    assert isinstance(env.unwrapped, ManyGames)
    assert env.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    seen, _ = env.reset(seed=0)
    assert env.observation_space.contains(seen)
    seen, rewards, terminated, truncated, _ = env.step(env.action_space.sample())
    assert env.observation_space.contains(seen)
    assert rewards.shape == terminated.shape == truncated.shape == (3,)
    assert (rewards.dtype, terminated.dtype, truncated.dtype) == (np.float32, np.bool_, np.bool_)


def test_an_ended_game_begins_again_in_the_same_step_from_a_start_of_its_own(course):
    starts = []
    for _, _, (now, _, terminated, truncated, infos) in course:
        over = terminated | truncated
        assert ("final_obs" in infos) == over.any()
        if over.any():
            assert (infos["_final_obs"] == over).all()
            assert (infos["final_obs"][~over] == now[~over]).all()
            assert (infos["final_obs"][over] != now[over]).any(axis=1).all()
            outcomes = infos["final_info"]["outcome"]
            assert ((outcomes != Outcome.ONGOING) == over).all()
            assert (now[over, 2] == -1).all()  # at rest
            starts.append(now[over])
    starts = np.concatenate(starts)
    assert len(starts) > 3 * GAMES  # more than one pile of them
    assert len(np.unique(starts, axis=0)) == len(starts)


def test_one_seed_gives_the_same_games_and_another_others(env, course):
    seen, _ = env.reset(seed=3)
    assert (seen == course[0][0]).all()
    for _, actions, told in course[:30]:
        assert (env.step(actions)[0] == told[0]).all()
    assert (env.reset(seed=4)[0] != course[0][0]).any()


def test_what_is_told_stays_as_it_was(env):
    seen, _ = env.reset(seed=1)
    before = seen.copy()
    seen_next, *_ = env.step(np.full(GAMES, 8))
    next_before = seen_next.copy()
    env.step(np.full(GAMES, 6))
    assert (seen == before).all()
    assert (seen_next == next_before).all()


def test_bad_input_is_refused(env):
    with pytest.raises(gymnasium.error.ResetNeeded):
        ManyGames(Role.PURSUER, 2).step(np.zeros(2, int))
    env.reset()
    with pytest.raises(InvalidInput, match=r"shape of actions = \(3,\) .* \(64,\)"):
        env.step(np.zeros(3, int))
    with pytest.raises(InvalidInput, match=r"actions = 0 to 9 .* from 0 to 8"):
        env.step(np.r_[np.zeros(GAMES - 1, int), 9])
    with pytest.raises(InvalidInput, match="num_envs = 0"):
        ManyGames(Role.PURSUER, 0)
    with pytest.raises(InvalidInput, match="seed = "):
        env.reset(seed=[1, 2])


@pytest.mark.slow
def test_an_opponent_that_reads_a_chart_is_given_it():
    """The environment's own observation reads none."""
    env = ManyGames(Role.PURSUER, 4, opponent="E_any")
    env.reset(seed=0)
    assert env.observation_space.contains(env.step(np.full(4, 4))[0])
