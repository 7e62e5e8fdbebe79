"""Gymnasium's vector interface: many games at once, each by the rules, ended ones begun again as Gymnasium does it."""

from dataclasses import replace

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from apollonius.catalogue import find_player
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.vector import ManyGames
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.sensing import Drive, Drives, Sensing, Sensors
from apollonius.game.starts import Starts
from apollonius.game.types import GameState, Outcome, RobotState, RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.io.limits import PARALLEL_GAMES
from apollonius.observe.registry import find_observation
from apollonius.observe.view import look
from tests.acting import act

GAMES = 64
MODES = [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP]


class OneStart(Starts):
    """Every game begins with the pursuer in front of a wall, so that whoever draws it, draws the same."""

    def sample(self, key, arena, bodies):
        places = [RobotState(*(jnp.float32(number) for number in place)) for place in ((0.2, 5, 0, 3.1), (7, 7, 0, 0))]
        return GameState.of_two(*places, jnp.int32(0))


OPTIONS = {"opponent": "still", "observation": "paper"}
WALL = OPTIONS | {"game": Game(arena=make_game("paper").arena, max_steps=13, starts=OneStart())}


def same(ours, theirs):
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.fixture(scope="module")
def one_by_one():
    return [OneSide(Role.PURSUER, **WALL) for _ in range(3)]


def test_a_robot_with_sensors_sees_late_and_one_with_a_drive_moves_late_in_every_interface():
    """The evader flees the same way in all, as it sees everything."""
    options = WALL | {"opponent": "flee"}
    late = replace(WALL["game"], drives=Drives(pursuer=Drive(lag=3)))
    delayed = replace(late, sensors=Sensing(pursuer=Sensors(delay=2)))
    seen = []
    for game in (delayed, late):
        many, one = (
            ManyGames(Role.PURSUER, 2, **options | {"game": game}),
            OneSide(Role.PURSUER, **options | {"game": game}),
        )
        both = [(many.reset(seed=0)[0][1], one.reset(seed=0)[0])]
        both += [(many.step(np.full(2, 7))[0][1], one.step(7)[0]) for _ in range(10)]
        np.testing.assert_allclose(*zip(*both, strict=True), atol=1e-5)
        seen.append(np.array(both)[:, 0])
    (now, then), still = seen, np.abs(seen[0][:, 2] - seen[0][0, 2]) < 1e-6
    np.testing.assert_array_equal(still, np.arange(11) < 4)
    np.testing.assert_allclose(now[:, :4], then[:, :4], atol=1e-5)
    np.testing.assert_allclose(now[2:, 4:], then[:-2, 4:], atol=1e-5)
    assert np.abs(now[:, 4:6] - then[:, 4:6]).max() > 0.01


@pytest.mark.parametrize("mode", MODES)
def test_every_step_tells_what_gymnasiums_own_vector_tells(mode, one_by_one):
    ours = ManyGames(Role.PURSUER, 3, autoreset_mode=mode.value, **WALL)
    theirs = SyncVectorEnv([lambda env=env: env for env in one_by_one], autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"] == mode
    same(ours.reset(seed=0)[:1], theirs.reset(seed=0)[:1])
    rng, terminations, truncations = np.random.default_rng(0), 0, 0
    for _ in range(120):
        actions = rng.choice([5, 7, 7, 8], 3)
        *told, infos = ours.step(actions)
        *expected, their_infos = theirs.step(actions)
        same(told, expected)
        over = told[2] | told[3]
        terminations, truncations = terminations + told[2].sum(), truncations + told[3].sum()
        if mode == AutoresetMode.NEXT_STEP:
            assert (infos["_outcome"] == their_infos["_outcome"]).all()
            assert names(infos["outcome"]).tolist() == their_infos["outcome"].tolist()
            continue
        assert ("final_obs" in infos) == ("final_obs" in their_infos) == over.any()
        if over.any():
            assert (infos["_final_obs"] == their_infos["_final_obs"]).all()
            assert (infos["_final_info"] == their_infos["_final_info"]).all()
            same(infos["final_obs"][over], their_infos["final_obs"][over])
            found, wanted = names(infos["final_info"]["outcome"]), their_infos["final_info"]["outcome"]
            assert found[over].tolist() == wanted[over].tolist()
    assert terminations > 3
    assert truncations > 3


def names(outcomes):
    return np.array([Outcome(outcome).name.lower() for outcome in outcomes], object)


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
        steps.append((seen, actions, told, np.copy(told[0])))
        seen = told[0]
    return steps


def test_an_ended_game_begins_again_in_the_same_step_from_a_start_of_its_own(course):
    starts = []
    for _, _, (now, _, terminated, truncated, infos), kept in course:
        assert (now == kept).all(), "what was returned stays as it was"
        if (over := terminated | truncated).any():
            assert (infos["final_obs"][~over] == now[~over]).all()
            assert (infos["final_obs"][over] != now[over]).any(axis=1).all()
            assert (now[over, 2] == -1).all()  # at rest
            starts.append(now[over])
    starts = np.concatenate(starts)
    assert len(starts) > 3 * GAMES  # more than one pile of them
    assert len(np.unique(starts, axis=0)) == len(starts)


def test_bad_input_is_refused(env):
    with pytest.raises(gymnasium.error.ResetNeeded):
        ManyGames(Role.PURSUER, 2).step(np.zeros(2, int))
    env.reset()
    with pytest.raises(InvalidInput, match=r"shape of actions = \(3,\) .* \(64,\)"):
        env.step(np.zeros(3, int))
    with pytest.raises(InvalidInput, match=r"actions = 0 to 9 .* from 0 to 8"):
        env.step(np.r_[np.zeros(GAMES - 1, int), 9])
    with pytest.raises(InvalidInput, match="seed = "):
        env.reset(seed=[1, 2])
    for bad, named in (
        ({"num_envs": 0}, "num_envs = 0"),
        ({"autoreset_mode": "Disabled"}, "NextStep, SameStep|SameStep, NextStep"),
    ):
        with pytest.raises(InvalidInput, match=named):
            ManyGames(Role.PURSUER, **bad)
    for games in (2**40, True, 2.5, "many", None):
        with pytest.raises(InvalidInput, match="num_envs"):
            PARALLEL_GAMES.require("num_envs", games)


@pytest.mark.slow
def test_an_opponent_that_reads_a_chart_is_given_it():
    """The environment's own observation reads none."""
    env = ManyGames(Role.PURSUER, 4, opponent="evader")
    env.reset(seed=0)
    assert env.observation_space.contains(env.step(np.full(4, 4))[0])


TEAM = make_game("team-2v2")


def test_every_game_of_teams_goes_as_the_rules_say():
    """Each robot's reward is its own, the game's is their mean, and evaders answer each for itself."""
    flee, reads = find_player("flee", Role.EVADER, TEAM).policy, find_observation("paper")
    make = {"num_envs": 32, "vectorization_mode": "vector_entry_point", "game": TEAM, "opponent": "flee"}
    env = gymnasium.make_vec("apollonius.envs.gymnasium:apollonius/Pursuit-v0", observation="paper", **make)
    assert env.single_action_space == gymnasium.spaces.MultiDiscrete([9, 9])
    own, rng = env.unwrapped, np.random.default_rng(0)
    seen, _ = env.reset(seed=3)
    assert env.observation_space.contains(seen)

    @jax.jit
    @jax.vmap
    def follow(state, actions):
        evaders = [act(flee, look(TEAM, state, Role.EVADER, number), jnp.uint32(0)) for number in range(2)]
        after = TEAM.step(state, list(actions), evaders)
        return after, [reads(look(TEAM, after.state, Role.PURSUER, number)) for number in range(2)]

    outcomes, lost = set(), set()
    for _ in range(120):
        state, actions = own._now.state, rng.integers(5, 9, size=(32, 2))
        seen, reward, terminated, truncated, infos = env.step(actions)
        assert env.observation_space.contains(seen)
        after, should_see = follow(state, actions)
        rewards = np.stack(after.rewards.pursuer, axis=1)
        np.testing.assert_allclose(infos["rewards"], rewards, atol=1e-4)
        np.testing.assert_allclose(reward, rewards.mean(axis=1), atol=1e-4)
        np.testing.assert_array_equal(infos["status"], np.stack(after.state.status.pursuer, axis=1))
        np.testing.assert_array_equal(terminated, after.terminated)
        np.testing.assert_array_equal(truncated, after.truncated)
        np.testing.assert_allclose(infos.get("final_obs", seen), np.stack(should_see, axis=1), atol=1e-5)
        if "final_info" in infos:
            np.testing.assert_array_equal(infos["final_info"]["outcome"], after.outcome)
        outcomes |= set(np.asarray(after.outcome).tolist())
        lost |= set(infos["status"].ravel().tolist())
    assert {Outcome.ONGOING, Outcome.PURSUER_OUT_OF_RANGE, Outcome.EVADER_OUT_OF_RANGE} <= outcomes
    assert {RobotStatus.HIT_OBSTACLE, RobotStatus.OUT_OF_RANGE} <= lost


def test_a_team_with_continuous_actions_drives_each_robot_by_its_own():
    env = ManyGames(
        Role.PURSUER, 2, game="team-2v1", observation="paper", actions="continuous", **{"opponent": "still"}
    )
    env.reset(seed=0)
    seen, *_ = env.step(np.float32([[[1, 0], [0.5, 0]], [[0, 0], [0.25, 0]]]))
    np.testing.assert_allclose((seen[..., 2] + 1) * 0.6, [[0.03, 0.015], [0, 0.0075]], atol=1e-6)
    with pytest.raises(InvalidInput, match=r"shape of actions"):
        env.step(np.zeros((2, 2), np.float32))


def test_one_evader_acts_against_a_team_without_an_axis_of_robots():
    env = ManyGames(Role.EVADER, 8, opponent="pure-pursuit", game="team-2v1", autoreset_mode="NextStep")
    assert env.reset(seed=2)[0].ndim == 2
    ended, caught = np.zeros(8, bool), 0
    for _ in range(100):
        _, rewards, terminated, truncated, infos = env.step(np.full(8, 4))
        assert rewards.shape == (8,)
        assert infos["rewards"].shape == (8, 1)
        assert (infos["rewards"][ended] == 0).all(), "the step that begins a game again"
        assert (infos["status"][ended] == RobotStatus.ACTIVE).all()
        caught += int((infos["status"] == RobotStatus.CAPTURED).sum())
        ended = terminated | truncated
    assert caught > 0
