"""Drives: late commands and slow turns; and nothing at all without them."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.presets import in_teams, make_game, randomised
from apollonius.game.scenario import Spread
from apollonius.game.sensing import MOST_LAG, Drive, Drives, drive_of
from apollonius.game.types import ROLES
from apollonius.io.errors import InvalidInput
from apollonius.play.rollout import step_driven

BODY, DT = Unicycle(), 0.1
LEFT, RIGHT, FASTER_LEFT = 5, 3, 8


def responses(drive, actions):
    """The controls that actions come to, one after the other."""
    made, state = [], drive.begin()
    for action in actions:
        controls, state = drive.respond(state, BODY, jnp.asarray(action), DT)
        made.append([float(control) for control in controls])
    return made


def test_without_limits_actions_come_to_their_own_controls():
    wanted = [[float(control) for control in BODY.controls(jnp.asarray(action))] for action in range(9)]
    for drive in (Drive(), Drive(lag=0, turn_time=0.0)):
        assert responses(drive, range(9)) == [pytest.approx(controls, abs=2e-5) for controls in wanted]


@pytest.mark.parametrize("lag", [1, 2, MOST_LAG])
def test_late_commands_come_when_they_are_due(lag):
    made = responses(Drive(lag=lag), [FASTER_LEFT, RIGHT] + [LEFT] * lag)
    expected = [[0, 0]] * lag + [[0.3, 0.8], [0, -0.8]]
    assert made == [pytest.approx(controls, abs=2e-5) for controls in expected]


def test_a_turn_rate_takes_its_time_and_turns_the_robot_by_its_mean():
    """Against the integral of a ramp to the wanted rate, in small steps."""
    made = responses(Drive(turn_time=0.25), [LEFT] * 4 + [RIGHT] * 3)
    rate, slope, means = 0.0, 0.8 / 0.25, []
    for wanted in [0.8] * 4 + [-0.8] * 3:
        total = 0.0
        for _ in range(1000):
            rate += np.clip(wanted - rate, -slope * DT / 1000, slope * DT / 1000)
            total += rate / 1000
        means.append(total)
    assert [u2 for _, u2 in made] == pytest.approx(means, abs=1e-3)


def test_each_robot_of_a_team_has_the_drive_of_its_side():
    """Late pursuers stand while the evader drives off; both pursuers turn as one alone would."""
    game = replace(in_teams(make_game("paper"), 2, 1), drives=Drives(pursuer=Drive(lag=3)))
    state = game.reset(jax.random.key(0))
    drives = ROLES.map(lambda role: (drive_of(game.drives, role).begin(),) * len(game.bodies[role]))
    speeds = []
    for _ in range(5):
        after, drives = step_driven(game, state, drives, BySide((jnp.asarray(7), jnp.asarray(7)), (jnp.asarray(7),)))
        state = after.state
        speeds.append([float(robot.v) for side in state.robots for robot in side])
    assert speeds == [pytest.approx([max(0, step - 3) * 0.03] * 2 + [step * 0.03], abs=1e-5) for step in range(1, 6)]


def test_numbers_that_each_game_draws_are_spread_as_asked():
    """Whole ones over all values with both ends, others over their range, each apart, in the games' own bodies."""
    spreads = [
        Spread(("drives.pursuer.lag", "drives.evader.lag"), 0.0, 2.0),
        Spread(("sensors.pursuer.noise.heading", "evader.v_max"), 0.5, 1.0),
    ]
    game = randomised(make_game("paper"), spreads)
    drawn = jax.jit(jax.vmap(lambda key: game.at(game.reset(key))))(jax.random.split(jax.random.key(0), 2000))
    assert np.bincount(drawn.drives.pursuer.lag.astype(int)) / 2000 == pytest.approx([1 / 3] * 3, abs=0.12)
    heading, speed = np.asarray(drawn.sensors.pursuer.noise.heading), np.asarray(drawn.evader.v_max)
    for values in (heading, speed):
        assert (values.min(), values.max()) == (pytest.approx(0.5, abs=0.03), pytest.approx(1.0, abs=0.03))
    assert abs(np.corrcoef(heading, speed)[0, 1]) < 0.3
    assert set(np.asarray(drawn.pursuer.v_max)) == {np.float32(1.2)}
    assert drawn.drives.evader.turn_time is None


@pytest.mark.parametrize(
    ("field", "low", "high", "message"),
    [
        ("pursuer.speed", 1.0, 2.0, "'speed' is none of"),
        ("drives.pursuer", 1.0, 2.0, "whole path"),
        ("drives", 1.0, 2.0, "whole path"),
        ("evader", 1.0, 2.0, "whole path"),
        ("pursuer.v_max.x", 1.0, 2.0, "whole path"),
        ("drives.pursuer.lag", 2.0, 1.0, "low = 2"),
        ("drives.pursuer.lag", 0.0, 11.0, "drives.pursuer.lag = "),
        ("sensors.evader.drop_out", 0.0, 1.5, "sensors.evader.drop_out = "),
    ],
)
def test_numbers_that_robots_do_not_have_are_refused(field, low, high, message):
    with pytest.raises(InvalidInput, match=message):
        randomised(make_game("paper"), [Spread((field,), low, high)])


@pytest.mark.parametrize(
    ("name", "value"), [("lag", -1), ("lag", 1.5), ("lag", 11), ("turn_time", -0.1), ("turn_time", float("nan"))]
)
def test_impossible_drives_are_refused(name, value):
    with pytest.raises(InvalidInput, match=f"drives.evader.{name} = "):
        Game(drives=Drives(evader=Drive(**{name: value})))
