"""Teams by Gymnasium's vector interface: every game as the rules say, with an axis of robots."""

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import apollonius.envs.gymnasium  # noqa: F401 (registers the environments)
from apollonius.catalogue import find_player
from apollonius.envs.vector import ManyGames
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.registry import find_observation
from apollonius.observe.view import look
from tests.acting import act

GAME = make_game("team-3v2")
GAMES = 32
FLEE = find_player("flee", Role.EVADER, GAME).policy
READS = find_observation("paper")


@pytest.fixture(scope="module")
def course():
    """What 120 steps told, seeded: `(state before, actions, what the step returned)`; ended games wait for a reset."""
    env = ManyGames(Role.PURSUER, GAMES, opponent="flee", game=GAME, observation="paper", autoreset_mode="Disabled")
    rng, steps = np.random.default_rng(0), []
    seen, _ = env.reset(seed=3)
    assert env.observation_space.contains(seen)
    for _ in range(120):
        assert env._now is not None
        state, actions = env._now.state, rng.integers(5, 9, size=(GAMES, 3))
        told = env.step(actions)
        steps.append((state, actions, told))
        if (over := told[2] | told[3]).any():
            env.reset(options={"reset_mask": over})
    return steps


def test_every_game_goes_as_the_rules_say(course):
    """Each robot's reward is its own, the game's is their mean, and evaders answer each for itself."""

    @jax.jit
    def follow(state, actions):
        evaders = [act(FLEE, look(GAME, state, Role.EVADER, number), jnp.uint32(0)) for number in range(2)]
        after = GAME.step(state, list(actions), evaders)
        seen = [READS(look(GAME, after.state, Role.PURSUER, number)) for number in range(3)]
        return after, seen

    for state, actions, (seen, reward, terminated, truncated, infos) in course:
        after, should_see = jax.vmap(follow)(state, actions)
        rewards = np.stack(after.rewards.pursuer, axis=1)
        np.testing.assert_allclose(infos["rewards"], rewards, atol=1e-4)
        np.testing.assert_allclose(reward, rewards.mean(axis=1), atol=1e-4)
        np.testing.assert_array_equal(infos["status"], np.stack(after.state.status.pursuer, axis=1))
        np.testing.assert_array_equal(infos["outcome"], after.outcome)
        np.testing.assert_array_equal(terminated, after.terminated)
        np.testing.assert_array_equal(truncated, after.truncated)
        np.testing.assert_allclose(seen, np.stack(should_see, axis=1), atol=1e-5)
    ended = np.concatenate([infos["outcome"] for *_, (*_, infos) in course])
    lost = np.concatenate([infos["status"] for *_, (*_, infos) in course])
    assert {Outcome.ONGOING, Outcome.PURSUER_OUT_OF_RANGE, Outcome.EVADER_OUT_OF_RANGE} <= set(ended.tolist())
    assert {RobotStatus.HIT_OBSTACLE, RobotStatus.OUT_OF_RANGE} <= set(lost.ravel().tolist())


def test_gymnasium_makes_it_and_games_begin_again():
    """By the names that it registers; games that end tell what was seen before they began again."""
    make = {"num_envs": 4, "vectorization_mode": "vector_entry_point", "game": "team-3v1", "opponent": "random"}
    env = gymnasium.make_vec("apollonius/Pursuit-v0", **make)
    assert env.single_action_space == gymnasium.spaces.MultiDiscrete([9, 9, 9])
    env.action_space.seed(0)
    seen, _ = env.reset(seed=0)
    ended = 0
    for _ in range(200):
        seen, rewards, terminated, truncated, infos = env.step(env.action_space.sample())
        assert env.observation_space.contains(seen)
        assert rewards.shape == (4,)
        assert infos["status"].shape == infos["rewards"].shape == (4, 3)
        if (over := terminated | truncated).any():
            ended += int(over.sum())
            np.testing.assert_array_equal(infos["_final_obs"], over)
            assert infos["final_obs"].shape == seen.shape
    assert ended > 0


def test_the_step_that_begins_a_game_again_tells_nothing():
    env = ManyGames(Role.PURSUER, 8, opponent="still", game="team-2v1", autoreset_mode=AutoresetMode.NEXT_STEP)
    env.reset(seed=1)
    ended, begun = np.zeros(8, bool), 0
    for _ in range(80):
        _, rewards, terminated, truncated, infos = env.step(np.full((8, 2), 7))
        assert (rewards[ended] == 0).all()
        assert (infos["rewards"][ended] == 0).all()
        assert (infos["status"][ended] == RobotStatus.ACTIVE).all()
        begun += int(ended.sum())
        ended = terminated | truncated
    assert begun > 0


def test_one_evader_acts_against_a_team_without_an_axis_of_robots():
    env = ManyGames(Role.EVADER, 8, opponent="pure-pursuit", game="team-3v1", actions="continuous")
    seen, _ = env.reset(seed=2)
    assert seen.ndim == 2
    caught = 0
    for _ in range(100):
        _, rewards, *_, infos = env.step(np.zeros((8, 2), np.float32))
        assert rewards.shape == (8,)
        assert infos["status"].shape == (8, 1)
        caught += int((infos["status"] == RobotStatus.CAPTURED).sum())
    assert caught > 0


def test_actions_of_a_team_have_its_shape():
    env = ManyGames(Role.PURSUER, 2, game="team-3v1", actions="continuous")
    env.reset(seed=0)
    assert env.single_action_space.shape == (3, 2)
    with pytest.raises(InvalidInput, match=r"shape of actions = \(2, 2\) is not possible: it must be \(2, 3, 2\)"):
        env.step(np.zeros((2, 2), np.float32))
