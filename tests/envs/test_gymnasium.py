"""The interfaces of Gymnasium and PettingZoo, of one game and of many: their checkers do not complain; games go by the
rules."""

import copy
import pickle
from dataclasses import replace
from functools import partial

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
from pettingzoo.utils.conversions import parallel_to_aec

import apollonius
from apollonius.agents.policy import AbstractPolicy
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import as_game
from apollonius.catalogue import find_player
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.options import as_actions, make_contest
from apollonius.envs.vector import ManyGames
from apollonius.game.arena import Arena
from apollonius.game.drive import Drive, Drives
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.reward import Reward
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.starts import Starts
from apollonius.game.types import GameState, Outcome, RobotState, RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.io.limits import PARALLEL_GAMES
from apollonius.observe.registry import find_observation
from apollonius.observe.view import look
from apollonius.show.palette import EVADER, PURSUER
from tests.acting import act, observe
from tests.bearing import BEARING

GAMES = 64
PURSUIT = "apollonius.envs.gymnasium:apollonius/Pursuit-v0"


@pytest.mark.parametrize(("name", "actions"), [("Pursuit", "discrete"), ("Evasion", "continuous")])
def test_environments_pass_the_gymnasium_checker(name, actions):
    """Warnings are errors here. The module before the name needs no import."""
    made = f"apollonius.envs.gymnasium:apollonius/{name}-v0"
    env = gymnasium.make(made, opponent="random", observation="paper", actions=actions)
    shares = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    assert env.action_space == (gymnasium.spaces.Discrete(9) if actions == "discrete" else shares)
    check_env(env.unwrapped)


@pytest.mark.slow
def test_egocentric_observation_is_that_of_the_charted_game():
    env, game = OneSide(Role.PURSUER, opponent="still", observation="egocentric"), with_chart(make_game("paper"))
    seen, info = env.reset(seed=5)
    assert info == {"outcome": "ongoing"}
    bits = np.random.Generator(type(env.np_random.bit_generator)(5)).integers(2**32, dtype=np.uint64)
    expected = jax.jit(lambda key: observe(game, game.reset(key), Role.PURSUER, "egocentric"))
    np.testing.assert_allclose(seen, expected(jax.random.key(np.uint32(bits))), atol=1e-5)


def test_single_robot_environment_plays_a_team_but_refuses_to_control_one():
    env = OneSide(Role.EVADER, opponent="pure-pursuit", game="team-2v1", observation="paper")
    env.reset(seed=0)
    over, total = False, 0.0
    while not over:
        _, reward, over, _, info = env.step(4)
        total += reward
    assert info["outcome"] == "captured"
    assert total < -10
    with pytest.raises(InvalidInput, match=r"pursuers = 3 is not possible: .* by PettingZoo"):
        OneSide(Role.PURSUER, game="team-3v1")


def test_render_shows_the_robots_and_the_trail_of_the_moving_one():
    env = OneSide(Role.PURSUER, "still", Game(arena=Arena(-2.0, 6.0, 1.0, 5.0)), "paper", "rgb_array")

    def pixels_of(colour):
        wanted = [int(colour[start : start + 2], 16) for start in (1, 3, 5)]
        return np.argwhere((np.abs(env.render().astype(int) - wanted) < 12).all(axis=-1))

    x, y = (env.reset(seed=0)[0][:2] + 1) / 2 * (8, 4) + (-2, 1)
    assert env.render().shape == (560, 1120, 3)
    before = [pixels_of(colour) for colour in (PURSUER, EVADER)]
    row, column = before[0].mean(axis=0)
    assert abs(column / 140 - 2 - x) < 0.2
    assert abs(5 - row / 140 - y) < 0.2
    for _ in range(30):
        env.step(7)
    after = [pixels_of(colour) for colour in (PURSUER, EVADER)]
    assert len(after[0]) > len(before[0]) + 30
    assert abs(len(after[1]) - len(before[1])) < 30
    env.reset(seed=0)
    assert len(pixels_of(PURSUER)) == len(before[0]), "no trail of the last game"


def test_unknown_options_are_refused():
    with pytest.raises(InvalidInput, match="game = 3"):
        as_game(3)
    for name, value in (("observation", "eyes"), ("opponent", "nobody"), ("actions", "some"), ("render_mode", "me")):
        with pytest.raises(InvalidInput, match=value if name == "opponent" else f"{name}.*{value}"):
            OneSide(Role.PURSUER, **{name: value})


class Accelerating(AbstractPolicy):
    """Speeds up straight on."""

    def __call__(self, seen, memory, bits):
        return jnp.int32(7), memory


def speeds(view):
    """Own speed and the opponent's [m/s]."""
    return [view.own.state.v, view.opponent.state.v]


def thrift(before, after):
    """Ten times the speed before the step, and a share of the game's own reward."""
    return 10 * before.pursuer.v + after.reward.pursuer / 4


@pytest.mark.slow
def test_opponent_observation_and_reward_can_be_objects():
    """The same in one game and in many, and after pickling."""
    given = {"opponent": Accelerating(), "observation": speeds, "reward": thrift}
    env, known = gymnasium.make(PURSUIT, **given), OneSide("pursuer", Accelerating(), observation="paper")
    many = pickle.loads(pickle.dumps(ManyGames("pursuer", 2, **given)))
    assert env.observation_space == gymnasium.spaces.Box(-np.inf, np.inf, (2,))
    for one in (env, many, known):
        one.reset(seed=0)
    for step in range(3):
        seen, reward, *_ = env.step(8)
        np.testing.assert_allclose(seen, [0.03 * (step + 1)] * 2, atol=1e-6)
        own, expected = known.step(8)[:2]
        assert seen[0] == pytest.approx(0.6 * (own[2] + 1), abs=1e-5)
        assert reward == pytest.approx(0.3 * step + expected / 4, abs=1e-5)
        seen, rewards, *_ = many.step(np.array([8, 4]))
        np.testing.assert_allclose(seen, [[0.03 * (step + 1)] * 2, [0, 0.03 * (step + 1)]], atol=1e-6)
        assert rewards[0] > 0.3 * step - 0.1


def test_reward_function_pays_each_robot_of_a_team():
    env = apollonius.parallel_env("team-2v1", BEARING, reward=lambda before, after: apollonius.BySide((1, 2.5), -3))
    assert env.observation_space("evader_0").shape == (6,)
    env.reset(seed=0)
    assert env.step(dict.fromkeys(env.agents, 4))[1] == {"pursuer_0": 1, "pursuer_1": 2.5, "evader_0": -3}


def test_reward_option_replaces_the_reward_of_the_game():
    env = ManyGames("evader", 1, "still", reward=Reward(profile="zero-sum"), observation="paper")
    env.reset(seed=0)
    assert env.step(np.array([4]))[1].tolist() == [0]
    with pytest.raises(InvalidInput, match=r"max_episode_steps = 2 .* wins by time"):
        ManyGames("evader", 1, reward=Reward(profile="zero-sum"), max_episode_steps=2)


DEFAULTS = {"observation": "paper", "actions": "discrete", "reward": None}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"observation": type(BEARING)}, "observation = <class .* encoded, .* an AbstractObservation, or a function"),
        ({"observation": lambda: 3}, "observation = <lambda> .* a function of a view: too many"),
        ({"observation": lambda view: 3.0}, r"observation = an array of shape \(\) .* a row of numbers"),
        ({"observation": lambda view: ["x"]}, r"observation = \['x'\] .* a row of numbers"),
        ({"observation": "encodd"}, "unknown observation 'encodd'; did you mean 'encoded'"),
        ({"reward": "paper"}, "reward = paper .* a Reward, or a function"),
        ({"reward": lambda after: 1}, "reward = <lambda> .* of the state before a step and of the step: too"),
        ({"reward": lambda *step: None}, "reward of the pursuer = None .* a number"),
        ({"reward": lambda *step: jnp.ones(3)}, r"reward of the pursuer = an array of shape \(3,\) .* a number"),
        ({"reward": lambda *step: apollonius.BySide((1, 2), 0)}, r"= \(1, 2\) .* a tuple of 1, one a robot"),
    ],
    ids=range(10),
)
def test_objects_of_a_wrong_kind_are_refused_in_one_line(options, said):
    with pytest.raises(InvalidInput, match=said) as refusal:
        make_contest(make_game("paper"), *(DEFAULTS | options).values(), {Role.EVADER: "still"})
    assert "\n" not in str(refusal.value)


def test_parallel_env_refuses_a_reward_of_one_side():
    with pytest.raises(InvalidInput, match=r"reward = of one side, 1.0 .* of both sides, as apollonius.BySide"):
        apollonius.parallel_env(reward=lambda *step: 1.0)


def spec_again(made):
    """From its specification as JSON."""
    return gymnasium.make(EnvSpec.from_json(made.spec.to_json()))


def test_environment_specification_survives_json():
    env = spec_again(gymnasium.make(PURSUIT, opponent="still", observation="paper", max_episode_steps=7))
    assert isinstance(env.unwrapped, OneSide)
    assert env.spec.max_episode_steps == 7
    assert env.reset(seed=0)[0].shape == (8,)


@pytest.mark.parametrize("kind", ["gymnasium", "one by one", "many", "pettingzoo"])
def test_every_interface_refuses_bad_options_by_name_in_one_line(kind):
    make = {
        "gymnasium": partial(gymnasium.make, PURSUIT),
        "one by one": partial(gymnasium.make_vec, PURSUIT, vectorization_mode="sync"),
        "many": partial(gymnasium.make_vec, PURSUIT),
        "pettingzoo": apollonius.parallel_env,
    }[kind]
    refused = {"opponnent": "still", "game": "chess", "observation": "eyes", "actions": "some", "render_mode": "smell"}
    if kind == "many":
        refused |= {"autoreset_mode": "Disabled", "render_mode": "rgb_array", "max_episode_steps": 0, "copy": False}
    if kind != "pettingzoo":
        refused |= {"role": "goalkeeper"}
    for name, value in refused.items():
        if (kind, name) in (("gymnasium", "render_mode"), ("one by one", "render_mode")):
            continue  # Gymnasium itself looks at it, as text
        about = "" if name in ("opponnent", "copy") else value
        with pytest.raises(InvalidInput, match=f"(?i){name}'?.*{about}") as refusal:
            make(**{name: value})
        assert "\n" not in str(refusal.value)


def test_vector_env_truncates_at_max_episode_steps_and_renders_nothing():
    env = gymnasium.make_vec(PURSUIT, num_envs=3, opponent="still", observation="paper", max_episode_steps=2)
    env.reset(seed=0)
    assert [env.step(np.full(3, 4))[3].tolist() for _ in range(4)] == [[False] * 3, [True] * 3] * 2
    assert env.render() is None
    for wrong, said in (
        (lambda: ManyGames("evader", game="zero-sum", max_episode_steps=2), "max_episode_steps = 2 .* wins by time"),
        (lambda: env.reset(options={"reset_mask": np.ones(3, bool)}), "options = "),
        (lambda: env.reset(seed=[1, 2, 3]), r"seed = \[1, 2, 3\] .* vectorization_mode='sync'"),
    ):
        with pytest.raises(InvalidInput, match=said):
            wrong()


def test_step_needs_a_reset_after_the_end_and_refuses_unknown_agents(env):
    one = OneSide("pursuer", "still", Game(max_steps=2), "paper")
    one.reset(seed=0)
    assert [one.step(4)[3] for _ in range(2)] == [False, True]
    with pytest.raises(gymnasium.error.ResetNeeded):
        one.step(4)
    with pytest.raises(InvalidInput, match=r"options = .* left out"):
        one.reset(options={"start": 3})
    env.reset(seed=0)
    with pytest.raises(InvalidInput, match=r"agents = evadr_0 .* among pursuer_0, evader_0"):
        env.step({"pursuer_0": 0, "evader_0": 0, "evadr_0": 1})


@pytest.mark.parametrize("kind", ["discrete", "continuous"])
def test_as_actions_refuses_values_that_are_no_action(kind):
    for action in (None, float("nan"), 4.5, True, 9, 2**40, 2**80, "left", [1, 2], [[1], [2, 3]]):
        with pytest.raises(InvalidInput, match="action"):
            as_actions(action, kind)


def test_forked_process_is_refused_with_the_remedy(monkeypatch):
    """Where it would wait for ever."""
    env = OneSide(Role.PURSUER)
    monkeypatch.setattr("os.getpid", lambda: 0)
    for begin in (env.reset, lambda: OneSide(Role.PURSUER), lambda: ManyGames(Role.PURSUER, 2)):
        with pytest.raises(InvalidInput, match="context='spawn'"):
            begin()


@pytest.fixture(scope="module")
def env():
    return apollonius.parallel_env()


@pytest.fixture(scope="module")
def team():
    return apollonius.parallel_env("team-3v2", observation="paper", render_mode="rgb_array")


def test_parallel_envs_pass_the_pettingzoo_tests(env, team):
    """Warnings are errors here. A copy has the compilation of what it is a copy of."""
    for one in (env, team):
        parallel_api_test(one, num_cycles=25)
        parallel_seed_test(partial(copy.deepcopy, one), num_cycles=10)
        api_test(parallel_to_aec(copy.deepcopy(one)), num_cycles=25)
        seed_test(lambda one=one: parallel_to_aec(copy.deepcopy(one)), num_cycles=10)


def test_time_limit_truncates_and_continuous_actions_scale_the_controls():
    game = replace(make_game("paper"), max_steps=3)
    env = apollonius.parallel_env(game, observation="paper", actions="continuous")
    actions = {"pursuer_0": np.float32([0.5, 0.0]), "evader_0": np.float32([0.25, 1.0])}
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(actions)
    env.reset(seed=0)
    for left in (2, 1, 0):
        seen, _, terminations, truncations, infos = env.step(actions)
        assert set(terminations.values()) == {False}
        assert set(truncations.values()) == {left == 0}
    assert infos["pursuer_0"]["outcome"] == "no_result"
    speeds = [seen[agent][2] for agent in actions]
    assert speeds == pytest.approx([2 * 3 * 0.1 * part * 0.3 / 1.2 - 1 for part in (0.5, 0.25)], abs=1e-5)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(actions)


def test_parallel_env_refuses_bad_actions_and_render_modes(env):
    env.reset()
    with pytest.raises(InvalidInput, match=r"action = 9 .* from 0 to 8"):
        env.step({"pursuer_0": 9, "evader_0": 0})
    with pytest.raises(InvalidInput, match=r"action = None .* from 0 to 8"):
        env.step({"pursuer_0": 0})
    with pytest.raises(InvalidInput, match="hologram"):
        apollonius.parallel_env(render_mode="hologram")


def test_agents_leave_when_they_are_out_and_the_game_continues(team):
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


SHIELDED = partial(OneSide, Role.EVADER, opponent="shielded:random", game="territory", actions="continuous")


@pytest.mark.parametrize(
    "make",
    [
        partial(apollonius.parallel_env, observation="paper", render_mode="rgb_array"),
        partial(ManyGames, Role.PURSUER, 16, observation="paper", autoreset_mode="NextStep"),
        pytest.param(SHIELDED, marks=pytest.mark.slow),
    ],
    ids=["both sides", "many games", "one side"],
)
def test_copied_environment_continues_with_the_same_steps(make):
    env = make()
    untouched = pickle.loads(pickle.dumps(env))
    env.reset(seed=7)
    until_here = follow(env, 0, 25)
    copied = pickle.loads(pickle.dumps(env))
    np.testing.assert_equal(follow(copied, 25, 40), follow(env, 25, 40))
    untouched.reset(seed=7)
    np.testing.assert_equal(follow(untouched, 0, 25), until_here)


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


def test_sensor_delay_and_drive_lag_are_the_same_in_every_interface():
    """The evader flees the same way in all, as it sees everything. It is believed to have driven straight on."""
    late = replace(WALL["game"], drives=Drives(pursuer=Drive(lag=3)))
    delayed = replace(late, sensors=Sensing(pursuer=Sensors(delay=2)))
    seen = []
    for game in (delayed, late):
        options = WALL | {"opponent": "flee", "game": game}
        many, one = ManyGames(Role.PURSUER, 2, **options), OneSide(Role.PURSUER, **options)
        both = [(many.reset(seed=0)[0][1], one.reset(seed=0)[0])]
        both += [(many.step(np.full(2, 7))[0][1], one.step(7)[0]) for _ in range(10)]
        np.testing.assert_allclose(*zip(*both, strict=True), atol=1e-5)
        seen.append(np.array(both)[:, 0])
    (now, then), still = seen, np.abs(seen[0][:, 2] - seen[0][0, 2]) < 1e-6
    np.testing.assert_array_equal(still, np.arange(11) < 4)
    np.testing.assert_allclose(now[:, :4], then[:, :4], atol=1e-5)
    x, y, speed, heading = then[:-2, 4:].T
    driven = 0.2 * 0.6 * (speed + 1) / 5
    reckoned = [x + driven * np.cos(np.pi * heading), y + driven * np.sin(np.pi * heading), speed, heading]
    np.testing.assert_allclose(now[2:, 4:].T, reckoned, atol=1e-5)
    assert np.abs(now[:, 4:6] - then[:, 4:6]).max() > 0.01


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_vector_env_matches_gymnasium_sync_vector_env(mode, one_by_one):
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
def many():
    return ManyGames(Role.EVADER, GAMES, opponent="still")


def test_ended_games_restart_in_the_same_step_from_distinct_starts(many):
    rng, starts, course = np.random.default_rng(0), [], []
    many.reset(seed=3)
    for _ in range(250):
        told = many.step(rng.integers(6, 9, size=GAMES))
        course.append((told, np.copy(told[0])))
    for (now, _, terminated, truncated, infos), kept in course:
        assert (now == kept).all(), "what was returned stays as it was"
        if (over := terminated | truncated).any():
            assert (infos["final_obs"][~over] == now[~over]).all()
            assert (infos["final_obs"][over] != now[over]).any(axis=1).all()
            assert (now[over, 2] == -1).all()  # at rest
            starts.append(now[over])
    starts = np.concatenate(starts)
    assert len(starts) > 3 * GAMES  # more than one pile of them
    assert len(np.unique(starts, axis=0)) == len(starts)


def test_vector_env_refuses_bad_input(many):
    with pytest.raises(gymnasium.error.ResetNeeded):
        ManyGames(Role.PURSUER, 2).step(np.zeros(2, int))
    many.reset()
    with pytest.raises(InvalidInput, match=r"shape of actions = \(3,\) .* \(64,\)"):
        many.step(np.zeros(3, int))
    with pytest.raises(InvalidInput, match=r"actions = 0 to 9 .* from 0 to 8"):
        many.step(np.r_[np.zeros(GAMES - 1, int), 9])
    with pytest.raises(InvalidInput, match="seed = "):
        many.reset(seed=[1, 2])
    with pytest.raises(InvalidInput, match="num_envs = 0"):
        ManyGames(Role.PURSUER, 0)
    with pytest.raises(InvalidInput, match=r"NextStep, SameStep|SameStep, NextStep"):
        ManyGames(Role.PURSUER, autoreset_mode="Disabled")
    for games in (2**40, True, 2.5, "many", None):
        with pytest.raises(InvalidInput, match="num_envs"):
            PARALLEL_GAMES.require("num_envs", games)


@pytest.mark.slow
def test_opponent_gets_a_chart_that_the_observation_does_not_read():
    """The environment's own observation reads none."""
    env = ManyGames(Role.PURSUER, 4, opponent="evader", observation="paper")
    env.reset(seed=0)
    assert env.observation_space.contains(env.step(np.full(4, 4))[0])


TEAM = make_game("team-2v2")


def test_vector_env_of_teams_follows_the_rules():
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


def test_continuous_team_actions_drive_each_robot_separately():
    env = ManyGames(Role.PURSUER, 2, game="team-2v1", actions="continuous", **OPTIONS)
    env.reset(seed=0)
    seen, *_ = env.step(np.float32([[[1, 0], [0.5, 0]], [[0, 0], [0.25, 0]]]))
    np.testing.assert_allclose((seen[..., 2] + 1) * 0.6, [[0.03, 0.015], [0, 0.0075]], atol=1e-6)
    with pytest.raises(InvalidInput, match=r"shape of actions"):
        env.step(np.zeros((2, 2), np.float32))


def test_single_evader_against_a_team_has_no_robot_axis():
    env = ManyGames(Role.EVADER, 8, "pure-pursuit", "team-2v1", "paper", autoreset_mode="NextStep")
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
