"""Gymnasium's interface: no complaint from its checker, and a game by the package's rules."""

import gymnasium
import jax
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

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
    env = OneSide(Role.EVADER, opponent="pure-pursuit", game="team-3v1")
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
