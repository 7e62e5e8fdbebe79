"""Gymnasium's vector interface: many games at once, each the very same game, ended ones begun again."""

from dataclasses import replace

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import apollonius.envs.gymnasium  # noqa: F401 (registers the environments)
from apollonius.arenas.charting import charted
from apollonius.catalogue import find_player
from apollonius.envs.vector import ManyGames
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, Outcome, RobotState, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.registry import observe
from apollonius.observe.view import look
from tests.acting import act

PAPER = make_game("paper")
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


def test_every_game_goes_as_the_rules_say(course):
    """Followed with the rules themselves, from states read back from what was seen."""

    @jax.jit
    @jax.vmap
    def follow(seen, action):
        evader, pursuer = (
            RobotState(5 * (x + 1), 5 * (y + 1), 0.6 * (v + 1), jnp.arctan2(sin, cos))
            for x, y, v, cos, sin in (seen[:5], seen[5:10])
        )
        after = PAPER.step(GameState.of_two(pursuer, evader, jnp.int32(0)), jnp.int32(1), action)
        return observe(PAPER, after.state, Role.EVADER, "encoded"), after

    ended = 0
    for seen, actions, (now, rewards, terminated, _, infos) in course:
        expected, after = follow(jnp.asarray(seen), jnp.asarray(actions, jnp.int32))
        led_to = infos.get("final_obs", now)
        np.testing.assert_allclose(led_to, expected, atol=1e-4)
        sure = np.asarray(after.terminated) == terminated  # but for a touch within rounding of one
        assert sure.mean() > 0.98
        np.testing.assert_allclose(rewards[sure], np.asarray(after.reward.evader)[sure], atol=1e-3)
        ended += terminated.sum()
    assert ended > GAMES


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


def test_the_time_limit_truncates():

    env = ManyGames(Role.PURSUER, 5, opponent="still", game=replace(PAPER, max_steps=2))
    env.reset(seed=0)
    for truncates in (False, True, False, True):
        _, _, terminated, truncated, infos = env.step(np.full(5, 1))
        assert not terminated.any()
        assert truncated.tolist() == [truncates] * 5
        if truncates:
            assert set(infos["final_info"]["outcome"].tolist()) == {Outcome.NO_RESULT}


def test_one_seed_gives_the_same_games_and_another_others(env, course):
    seen, _ = env.reset(seed=3)
    assert (seen == course[0][0]).all()
    for _, actions, told in course[:30]:
        assert (env.step(actions)[0] == told[0]).all()
    assert (env.reset(seed=4)[0] != course[0][0]).any()


def test_wrappers_of_gymnasium_count_its_episodes():
    env = RecordEpisodeStatistics(ManyGames(Role.PURSUER, 8, opponent="random"))
    env.reset(seed=0)
    lengths = []
    for _ in range(80):
        *_, infos = env.step(np.full(8, 7))
        lengths += infos["episode"]["l"][infos["_episode"]].tolist() if "episode" in infos else []
    assert len(lengths) >= 8
    assert sum(lengths) <= 8 * 80
    assert min(lengths) >= 1


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
def test_an_opponent_that_reads_a_chart_plays_as_it_would_in_the_charted_game():
    """The environment's own observation reads none."""
    env = ManyGames(Role.PURSUER, 4, opponent="E_any")
    seen, _ = env.reset(seed=0)
    player = find_player("E_any", Role.EVADER, game := charted(PAPER)).policy

    @jax.jit
    @jax.vmap
    def follow(seen):
        pursuer, evader = (
            RobotState(5 * (x + 1), 5 * (y + 1), 0.6 * (v + 1), jnp.arctan2(sin, cos))
            for x, y, v, cos, sin in (seen[:5], seen[5:10])
        )
        state = GameState.of_two(pursuer, evader, jnp.int32(0))
        action = act(player, player.observation(look(game, state, Role.EVADER)), jnp.uint32(0))
        return observe(game, game.step(state, jnp.int32(4), action).state, Role.PURSUER, "encoded")

    for _ in range(20):
        after = env.step(np.full(4, 4))[0]
        np.testing.assert_allclose(after, follow(jnp.asarray(seen)), atol=1e-3)
        seen = after
