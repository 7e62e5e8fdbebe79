"""Movers in the environments: they go by the rules, robots run into them, and pictures show them."""

import copy
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tomli_w
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

import apollonius
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.vector import ManyGames
from apollonius.game.arena import Arena
from apollonius.game.movers import Movers
from apollonius.game.presets import make_game
from apollonius.game.timetable import Door, Shuttle
from apollonius.game.types import Outcome, Role
from apollonius.game.walkers import Walkers
from apollonius.show.palette import OTHER

SHUTTLE = Shuttle(((2.0, 3.0), (8.0, 3.0)), v_max=2.0, a_max=2.0)
MOVERS = Movers((SHUTTLE,), (Door(5.0, 6.0, 0.5, 0.0, period=6.0),), (Walkers(4, 0.3),))
GAME = replace(make_game("paper"), arena=Arena(), movers=MOVERS)
GO_ON = 7


def motion(view):
    """Places [m] and velocities [m/s] of movers, and the robot's own place [m]."""
    return jnp.concatenate([*jax.tree.leaves(view.movers.motion), jnp.stack([view.own.state.x, view.own.state.y])])


def motion_of(states):
    """The same of a pursuer, by the rules; leaves `[..., numbers]`."""
    places = [states.pursuer.x[..., None], states.pursuer.y[..., None]]
    return np.concatenate([*jax.tree.leaves(states.movers.motion), *places], axis=-1)


@pytest.fixture(scope="module")
def env():
    return OneSide(Role.PURSUER, "still", GAME, motion, "rgb_array")


@pytest.fixture(scope="module")
def both():
    return apollonius.parallel_env(GAME, motion)


def test_environments_with_movers_pass_the_checkers(env, both):
    check_env(OneSide(Role.EVADER, "random", GAME, "paper"), skip_render_check=True)
    parallel_api_test(both, num_cycles=25)
    parallel_seed_test(partial(copy.deepcopy, both), num_cycles=10)


def key_of(env, seed):
    """The key from which an environment draws its first game."""
    generator = np.random.Generator(type(env.np_random.bit_generator)(seed))
    return jax.random.key(np.uint32(generator.integers(2**32, dtype=np.uint64)))


@jax.jit
def by_the_rules(key):
    """The course of a pursuer that goes straight on: states, leaves `[81, ...]`, and outcomes."""
    start = GAME.reset(key)

    def one_step(state, _):
        after = GAME.step(state, GO_ON, 4)
        return after.state, (after.state, after.outcome)

    _, (states, outcomes) = jax.lax.scan(one_step, start, length=80)
    return jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), start, states), outcomes


def test_single_game_goes_by_the_rules_until_a_mover_is_hit(env):
    ends = set()
    for seed in range(12):
        seen, _ = env.reset(seed=seed)
        states, outcomes = jax.device_get(by_the_rules(key_of(env, seed)))
        expected = motion_of(states)
        np.testing.assert_allclose(seen, expected[0], atol=1e-5)
        for step in range(80):
            seen, _, over, _, info = env.step(GO_ON)
            np.testing.assert_allclose(seen, expected[step + 1], atol=1e-4)
            assert info["outcome"] == Outcome(int(outcomes[step])).name.lower()
            if over:
                ends.add(info["outcome"])
                break
    assert "pursuer_hit_obstacle" in ends, "in an arena without any"


def test_seed_draws_the_movers_and_games_differ(env):
    first, second, other = (env.reset(seed=seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, second)
    moves = [0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 11]  # the door and the shuttle along one axis
    assert len(np.unique(np.stack([first, other, env.reset()[0]])[:, moves], axis=0)) == 3
    assert (first[2:6] != other[2:6]).all()


def test_picture_shows_movers_where_they_are(env):
    seen, _ = env.reset(seed=3)
    colour = tuple(bytes.fromhex(OTHER[1:]))
    for _ in range(2):
        picture = env.render()
        scale = len(picture) / 10
        for x, y in zip(seen[:6], seen[6:12], strict=True):
            assert tuple(picture[int((10 - y) * scale), int(x * scale)]) == colour
        for _ in range(10):
            seen, *_ = env.step(4)


def test_both_sides_see_the_same_movers_step_on(both):
    seen, _ = both.reset(seed=4)
    for _ in range(10):
        np.testing.assert_array_equal(seen["pursuer_0"][:24], seen["evader_0"][:24])
        before, (seen, *_) = seen, both.step(dict.fromkeys(both.agents, 4))
        moved = seen["pursuer_0"][:12] - before["pursuer_0"][:12]
        np.testing.assert_allclose(moved, 0.1 * seen["pursuer_0"][12:24], atol=1e-5)
        assert np.abs(moved).max() > 0.01


@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
def test_many_games_go_by_the_rules_and_begin_again_with_other_movers(mode):
    many = ManyGames(Role.PURSUER, 32, "still", GAME, motion, autoreset_mode=mode)
    step_by_the_rules = jax.jit(jax.vmap(lambda state: GAME.step(state, GO_ON, 4)))
    many.reset(seed=0)
    ended, hits, starts = np.zeros(32, bool), 0, [np.asarray(many._now.state.movers.motion.x)]
    for _ in range(120):
        after = jax.device_get(step_by_the_rules(many._now.state))
        seen, _, terminated, _, infos = many.step(np.full(32, GO_ON))
        if mode == "SameStep":
            ended = terminated
            np.testing.assert_array_equal(terminated, after.terminated)
            seen_then = infos.get("final_obs", seen)
            np.testing.assert_allclose(seen_then, motion_of(after.state), atol=1e-4)
        else:
            np.testing.assert_allclose(seen[~ended], motion_of(after.state)[~ended], atol=1e-4)
        starts.append(np.asarray(many._now.state.movers.motion.x)[ended])
        hits += (after.outcome[~ended] == Outcome.PURSUER_HIT_OBSTACLE).sum() if mode == "NextStep" else 0
        ended = terminated
    drawn = np.concatenate(starts)
    assert len(drawn) > 64
    assert len(np.unique(drawn[:, 2:], axis=0)) == len(drawn)
    assert hits > 3 or mode == "SameStep"


def test_openspiel_duel_plays_movers_and_hides_none(tmp_path):
    pyspiel = pytest.importorskip("pyspiel", reason="needs OpenSpiel: pip install open_spiel")
    pytest.importorskip("apollonius.envs.open_spiel")
    path = tmp_path / "people.toml"
    shuttle = {"waypoints": [[2, 3], [8, 3]], "v_max": 2.0}
    path.write_text(tomli_w.dumps({"movers": {"shuttles": [shuttle], "walkers": [{"count": 3}]}}), encoding="utf-8")
    duel = pyspiel.load_game("apollonius_duel", {"game": str(path), "time_limit": 10.0, "seed": 2})
    pyspiel.random_sim_test(duel, num_sims=1, serialize=True, verbose=False)
    state, rules = duel.new_initial_state(), duel.rules
    course = rules.reset(jax.random.key(2))
    step = jax.jit(lambda state: rules.step(state, 5, 4).state)
    for _ in range(3):
        for name, expected in (("robots", 8), ("movers", 4 * 4 + 1 + 2 * 3)):
            assert state.numbers(0)[name].shape == (expected,)
        now = np.concatenate(jax.tree.leaves(course.movers)[:-1])
        np.testing.assert_allclose(state.numbers(1)["movers"], now, atol=1e-4)
        text = str(state)
        state.apply_actions([5, 4])
        for _ in range(5):
            course = step(course)
        assert str(state) != text
    assert "movers" in str(state)
