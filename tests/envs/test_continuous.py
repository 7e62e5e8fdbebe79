"""Continuous actions through every interface: what the checkers say, and that it is the very same game."""

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

import apollonius
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.vector import ManyGames
from apollonius.game.dynamics import gears
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput

PAPER = make_game("paper")


def test_gymnasiums_checker_has_no_complaint():
    """Warnings are errors here."""
    env = gymnasium.make("apollonius/Pursuit-v0", actions="continuous")
    assert env.action_space == gymnasium.spaces.Box(-1, 1, (2,), np.float32)
    check_env(env.unwrapped)


def test_pettingzoos_parallel_test_has_no_complaint():
    parallel_api_test(apollonius.parallel_env(actions="continuous"), num_cycles=100)


def both_of(make):
    """An interface with discrete actions and one with continuous ones, reset alike."""
    envs = [make(actions) for actions in ("discrete", "continuous")]
    return envs, [env.reset(seed=3)[0] for env in envs]


def as_pair(actions):
    return np.stack(jax.vmap(gears)(jnp.asarray(actions)), axis=-1) if np.ndim(actions) else np.stack(gears(actions))


@pytest.mark.slow
def test_gears_of_discrete_actions_play_the_same_game():
    """To rounding, as they are compiled apart: one game from outside, and many in one call."""
    for make, shape in (
        (lambda actions: OneSide(Role.PURSUER, opponent="still", actions=actions), ()),
        (lambda actions: ManyGames(Role.PURSUER, 5, opponent="still", actions=actions), (5,)),
    ):
        envs, seen = both_of(make)
        np.testing.assert_array_equal(*seen)
        for turn in np.random.default_rng(0).integers(6, 9, (20, *shape)):
            told = [env.step(action) for env, action in zip(envs, (turn, as_pair(jnp.asarray(turn))), strict=True)]
            for discrete, continuous in zip(*(parts[:4] for parts in told), strict=True):
                np.testing.assert_allclose(discrete, continuous, atol=1e-5)


def test_parts_of_the_largest_controls_move_the_robot_by_these_parts():
    env = apollonius.parallel_env(actions="continuous", observation="paper")
    env.reset(seed=0)
    for _ in range(4):
        seen, *_ = env.step({"pursuer_0": np.float32([0.5, 0.0]), "evader_0": np.float32([0.25, 1.0])})
    pursuer, evader = seen["pursuer_0"][:4], seen["evader_0"][:4]
    assert pursuer[2] == pytest.approx(2 * 4 * 0.1 * 0.5 * 0.3 / 1.2 - 1, abs=1e-5)
    assert evader[2] == pytest.approx(2 * 4 * 0.1 * 0.25 * 0.3 / 1.2 - 1, abs=1e-5)


def test_what_is_no_such_action_is_refused():
    env = OneSide(Role.EVADER, actions="continuous")
    env.reset(seed=0)
    for action in ([0.0, 1.5], [np.nan, 0.0]):
        with pytest.raises(InvalidInput, match="from -1 to 1"):
            env.step(np.float32(action))
    with pytest.raises(InvalidInput, match="shape of action"):
        env.step(np.float32([0.0, 0.0, 0.0]))
    with pytest.raises(InvalidInput, match="actions = analogue"):
        OneSide(Role.EVADER, actions="analogue")
