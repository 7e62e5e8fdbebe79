"""The interfaces of Gymnasium and PettingZoo: no complaint from their checkers, games by the rules."""

import copy
import pickle

import gymnasium
import jax
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
from pettingzoo.utils.conversions import parallel_to_aec

import apollonius
from apollonius.arenas.charting import charted
from apollonius.arenas.file import as_game
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.live import as_actions
from apollonius.envs.vector import ManyGames
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.show.palette import EVADER, PURSUER
from tests.acting import observe


@pytest.mark.parametrize(
    ("name", "options"), [("Pursuit", {"observation": "paper"}), ("Evasion", {"actions": "continuous"})]
)
def test_gymnasiums_checker_has_no_complaint(name, options):
    """Warnings are errors here. The module before the name needs no import."""
    env = gymnasium.make(f"apollonius.envs.gymnasium:apollonius/{name}-v0", opponent="random", **options)
    shares = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    assert env.action_space == (shares if options.get("actions") else gymnasium.spaces.Discrete(9))
    check_env(env.unwrapped)


def test_an_observation_that_reads_a_chart_is_that_of_the_charted_game():
    env, game = OneSide(Role.PURSUER, opponent="still", observation="egocentric"), charted(make_game("paper"))
    seen, info = env.reset(seed=5)
    assert info == {"outcome": "ongoing"}
    bits = np.random.Generator(type(env.np_random.bit_generator)(5)).integers(2**32, dtype=np.uint64)
    expected = jax.jit(lambda key: observe(game, game.reset(key), Role.PURSUER, "egocentric"))
    np.testing.assert_allclose(seen, expected(jax.random.key(np.uint32(bits))), atol=1e-5)


def test_one_robot_acts_against_a_team_and_a_team_is_for_pettingzoo():
    env = OneSide(Role.EVADER, opponent="pure-pursuit", game="team-2v1")
    env.reset(seed=0)
    over, total = False, 0.0
    while not over:
        _, reward, over, _, info = env.step(4)
        total += reward
    assert info["outcome"] == "captured"
    assert total < -10
    with pytest.raises(InvalidInput, match=r"pursuers = 3 is not possible: .* by PettingZoo"):
        OneSide(Role.PURSUER, game="team-3v1")


def test_the_picture_shows_the_robots_where_they_are_and_the_trail_behind_the_one_that_drives():
    env = OneSide(Role.PURSUER, "still", Game(arena=Arena(-2.0, 6.0, 1.0, 5.0)), "paper", "rgb_array")

    def pixels_of(colour):
        wanted = [int(colour[start : start + 2], 16) for start in (1, 3, 5)]
        return np.argwhere((np.abs(env.render().astype(int) - wanted) < 12).all(axis=-1))

    x, y = (env.reset(seed=0)[0][:2] + 1) / 2 * (8, 4) + (-2, 1)
    assert env.render().shape == (240, 480, 3)
    before = [pixels_of(colour) for colour in (PURSUER, EVADER)]
    row, column = before[0].mean(axis=0)
    assert abs(column / 60 - 2 - x) < 0.2
    assert abs(5 - row / 60 - y) < 0.2
    for _ in range(30):
        env.step(7)
    after = [pixels_of(colour) for colour in (PURSUER, EVADER)]
    assert len(after[0]) > len(before[0]) + 30
    assert abs(len(after[1]) - len(before[1])) < 30
    env.reset(seed=0)
    assert len(pixels_of(PURSUER)) == len(before[0]), "no trail of the last game"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("observation", "eyes"), ("opponent", "nobody"), ("actions", "analogue"), ("render_mode", "human"),
    ],
)  # fmt: skip
def test_unknown_options_are_refused(name, value):
    with pytest.raises(InvalidInput, match="game = 3"):
        as_game(3)
    with pytest.raises(InvalidInput, match=value if name == "opponent" else f"{name} = {value}"):
        OneSide(Role.PURSUER, **{name: value})


@pytest.mark.parametrize("kind", ["discrete", "continuous"])
def test_what_is_no_action_is_refused(kind):
    for action in (None, float("nan"), 4.5, True, 9, 2**40, 2**80, "left", [1, 2], [[1], [2, 3]]):
        with pytest.raises(InvalidInput, match="action"):
            as_actions(action, kind)


def test_a_forked_process_is_refused_with_the_remedy(monkeypatch):
    """Where it would wait for ever."""
    env = OneSide(Role.PURSUER)
    monkeypatch.setattr("os.getpid", lambda: 0)
    for begin in (env.reset, lambda: OneSide(Role.PURSUER), lambda: ManyGames(Role.PURSUER, 2)):
        with pytest.raises(InvalidInput, match="context='spawn'"):
            begin()


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
    parallel_api_test(env, num_cycles=25)
    parallel_seed_test(lambda: copy.deepcopy(env), num_cycles=10)
    api_test(parallel_to_aec(copy.deepcopy(env)), num_cycles=25)
    seed_test(lambda: parallel_to_aec(copy.deepcopy(env)), num_cycles=10)


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
    with pytest.raises(InvalidInput, match="hologram"):
        apollonius.parallel_env(render_mode="hologram")


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
