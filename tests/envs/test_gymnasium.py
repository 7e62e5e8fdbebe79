"""Gymnasium's interface: what its checker says, and that it is the very same game."""

import subprocess
import sys

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from apollonius.arenas.charting import charted
from apollonius.arenas.file import as_game
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.spaces import action_space, as_actions
from apollonius.envs.vector import ManyGames
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.io.limits import PARALLEL_GAMES
from apollonius.observe.registry import observe


@pytest.mark.parametrize("name", ["apollonius/Pursuit-v0", "apollonius/Evasion-v0"])
@pytest.mark.parametrize("options", [{"observation": "paper"}, {"observation": "encoded"}, {"actions": "continuous"}])
def test_gymnasiums_checker_has_no_complaint(name, options):
    """Warnings are errors here."""
    env = gymnasium.make(name, opponent="random", **options)
    assert env.action_space == action_space(options.get("actions", "discrete"))
    check_env(env.unwrapped)


@pytest.mark.parametrize("role", Role)
def test_a_game_goes_as_the_rules_say(role):
    game = make_game("paper")
    env = OneSide(role, opponent="still")
    seen, info = env.reset(seed=5)
    assert info == {"outcome": "ongoing"}
    bits = np.random.Generator(type(env.np_random.bit_generator)(5)).integers(2**32, dtype=np.uint64)
    state = game.reset(jax.random.key(np.uint32(bits)))
    np.testing.assert_allclose(seen, observe(game, state, role, "encoded"), atol=1e-6)
    step = jax.jit(game.step)
    for turn in range(400):
        action, still = jnp.int32(6 + turn % 2), jnp.int32(4)
        seen, reward, terminated, truncated, info = env.step(int(action))
        after = step(state, *((action, still) if role == Role.PURSUER else (still, action)))
        rewards = tuple(after.reward)
        np.testing.assert_allclose(seen, observe(game, after.state, role, "encoded"), atol=1e-4)
        assert reward == pytest.approx(float(rewards[role]), abs=1e-4)
        assert (terminated, truncated) == (bool(after.terminated), bool(after.truncated))
        assert info["outcome"] == Outcome(int(after.outcome)).name.lower()
        state = after.state
        if terminated:
            break
    assert info["outcome"] in {
        f"{role.name.lower()}_hit_obstacle", f"{role.name.lower()}_out_of_range", "captured",
    }  # fmt: skip


@pytest.mark.slow
def test_an_observation_that_reads_a_chart_is_that_of_the_charted_game():
    env = OneSide(Role.PURSUER, opponent="still", observation="egocentric")
    seen, _ = env.reset(seed=5)
    bits = np.random.Generator(type(env.np_random.bit_generator)(5)).integers(2**32, dtype=np.uint64)
    game = charted(make_game("paper"))
    state = game.reset(jax.random.key(np.uint32(bits)))
    np.testing.assert_allclose(seen, observe(game, state, Role.PURSUER, "egocentric"), atol=1e-5)


def test_one_seed_gives_one_game_and_another_seed_another():
    def course(seed):
        env = OneSide(Role.PURSUER)
        first, _ = env.reset(seed=seed)
        return np.concatenate([first, *(env.step(6)[0] for _ in range(20))])

    assert (course(0) == course(0)).all()
    assert (course(0) != course(1)).any()


def test_a_shielded_opponent_is_shielded_from_the_game_that_is_played():
    env = OneSide(Role.PURSUER, opponent="shielded:random", game="one-large")
    env.reset(seed=0)
    for _ in range(60):
        *_, terminated, truncated, info = env.step(4)
        assert info["outcome"] in ("ongoing", "captured")
        if terminated or truncated:
            break


def test_a_step_before_the_first_reset_is_refused():
    with pytest.raises(gymnasium.error.ResetNeeded):
        OneSide(Role.PURSUER).step(0)


@pytest.mark.parametrize("option", [{"observation": "eyes"}, {"opponent": "nobody"}, {"actions": "analogue"}])
def test_unknown_options_are_refused(option):
    ((name, value),) = option.items()
    with pytest.raises(InvalidInput, match=value if name == "opponent" else f"{name} = {value}"):
        OneSide(Role.PURSUER, **option)


NO_ACTIONS = [None, float("nan"), 4.5, True, 9, 2**40, 2**80, "left", [1, 2], [[1], [2, 3]]]


@pytest.mark.parametrize("kind", ["discrete", "continuous"])
@pytest.mark.parametrize("action", NO_ACTIONS, ids=str)
def test_what_is_no_action_is_refused(action, kind):
    with pytest.raises(InvalidInput, match="action"):
        as_actions(action, action_space(kind))


def test_arguments_of_another_kind_are_refused():
    with pytest.raises(InvalidInput, match="game = 3"):
        as_game(3)
    for games in (2**40, True):
        with pytest.raises(InvalidInput, match="num_envs"):
            ManyGames(Role.PURSUER, num_envs=games)
    for games in (2.5, "many", None):
        with pytest.raises(InvalidInput, match="num_envs"):
            PARALLEL_GAMES.require("num_envs", games)


def test_a_forked_process_is_refused_with_the_remedy():
    """Where it would wait for ever."""
    make = "gymnasium.make('apollonius/Pursuit-v0')"
    code = (
        "import os, warnings; warnings.simplefilter('ignore')\n"
        f"import gymnasium, apollonius.envs.gymnasium\nif os.fork() == 0:\n {make}\nos.wait()"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120)
    assert "context='spawn'" in said.stderr
