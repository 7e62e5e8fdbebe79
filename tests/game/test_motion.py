"""How a robot moves (Eq. 1), against an ODE solver, what drives do to that, and what it sees, against NumPy."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from apollonius.game.arena import Arena, Disc
from apollonius.game.drive import MOST_LAG, Drive, Drives, drive_of
from apollonius.game.dynamics import Unicycle, action_levels, sinc, unit_vector, wrap_angle
from apollonius.game.presets import in_teams, make_game, randomised
from apollonius.game.scenario import Spread
from apollonius.game.sensing import BOUND, Noise, Sensors, sense
from apollonius.game.types import ROLES, BySide, Role
from apollonius.play.rollout import step_driven
from tests.acting import robot, state_of

PI = np.float32(np.pi)
BODY = Unicycle()


@pytest.mark.parametrize(("v", "u1"), [(0.0, 0.3), (0.5, 0.3), (0.5, -0.3), (1.18, 0.3), (0.02, -0.3)])
def test_turn_matches_an_ode_solver_to_20_micrometres(v, u1):
    """Also where the speed meets its limit within the step."""

    def rate(time, place):
        speed, heading = min(max(v + u1 * time, 0.0), 1.2), 1.0 + 0.8 * time
        return [speed * math.cos(heading), speed * math.sin(heading)]

    exact = solve_ivp(rate, (0, 0.1), [0, 0], max_step=1e-3, rtol=1e-9).y[:, -1]
    after = BODY.move(robot(0, 0, v, 1), jnp.float32(u1), jnp.float32(0.8), 0.1)
    assert math.hypot(after.x - exact[0], after.y - exact[1]) < 2.01e-5


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("cut", [-PI, PI])
def test_wrap_angle_is_right_at_pi_and_its_neighbours(cut, compiled):
    angles = (cut.view(np.int32) + np.arange(-200, 201, dtype=np.int32)).view(np.float32)
    wrap = jax.vmap(wrap_angle)
    ours = np.asarray((jax.jit(wrap) if compiled else wrap)(angles))
    assert ours[200] == PI
    assert np.all((ours > -PI) & (ours <= PI))
    np.testing.assert_allclose(np.exp(1j * ours), np.exp(1j * angles), atol=1e-6)


def test_unit_vector_is_cosine_and_sine_to_one_in_a_million():
    angles = np.linspace(-9, 9, 20_001).astype(np.float32)
    exact = np.cos(angles.astype(float)), np.sin(angles.astype(float))
    np.testing.assert_allclose(jax.vmap(unit_vector)(angles), exact, atol=1e-6)


@pytest.mark.parametrize(("reach", "error"), [(0.6, 1.5e-7), (1.0, 3e-6)])
def test_sinc_is_the_sine_over_the_angle(reach, error):
    angles = np.linspace(-reach, reach, 1001, dtype=np.float32)
    np.testing.assert_allclose(jax.vmap(sinc)(angles), np.sinc(angles.astype(float) / np.pi), atol=error)


def test_levels_are_clipped_shares_of_the_largest_controls():
    body = Unicycle(u1_max=0.5, u2_max=2.0)
    np.testing.assert_allclose(body.controls(jnp.array([0.5, -0.25])), (0.25, -0.5))
    np.testing.assert_allclose(body.controls(jnp.array([3.0, -1.5])), (0.5, -2.0))
    np.testing.assert_allclose(action_levels(jnp.asarray(5)), (0, 1))


DT = 0.1
LEFT, RIGHT = 5, 3


def responses(drive, actions):
    """The controls that actions come to, one after the other."""
    made, state = [], drive.at_rest()
    for action in actions:
        controls, state = drive.respond(state, BODY, jnp.asarray(action), DT)
        made.append([float(control) for control in controls])
    return made


LATE = [(Drive(lag=lag), lag) for lag in (1, 2, MOST_LAG)]


@pytest.mark.parametrize(("drive", "lag"), [(Drive(), 0), (Drive(lag=0, turn_time=0.0), 0), *LATE])
def test_drive_applies_controls_after_its_lag(drive, lag):
    due = [[float(control) for control in BODY.controls(jnp.asarray(action))] for action in range(9)]
    expected = [pytest.approx(controls, abs=2e-5) for controls in [[0, 0]] * lag + due]
    assert responses(drive, [*range(9), *[LEFT] * lag]) == expected


def test_drive_ramps_the_turn_rate_and_applies_its_mean():
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
    drives = ROLES.map(lambda role: (drive_of(game.drives, role).at_rest(),) * len(game.bodies[role]))
    speeds = []
    for _ in range(5):
        after, drives = step_driven(game, state, drives, BySide((jnp.asarray(7), jnp.asarray(7)), (jnp.asarray(7),)))
        state = after.state
        speeds.append([float(robot.v) for side in state.robots for robot in side])
    assert speeds == [pytest.approx([max(0, step - 3) * 0.03] * 2 + [step * 0.03], abs=1e-5) for step in range(1, 6)]


def test_randomised_numbers_are_uniform_and_independent():
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


DISC = Arena(discs=(Disc(5.0, 5.0, 1.0),))
WORDS = jnp.asarray(np.random.default_rng(0).integers(2**32, size=4000, dtype=np.uint32))
BEHIND, BESIDE, SIGHT = (3.0, 5.0, 0.0, np.pi), (5.0, 8.0), Sensors(line_of_sight=True)


@pytest.mark.parametrize(
    ("sensors", "pursuers", "evader", "status", "seen"),
    [
        (Sensors(), [BEHIND], (9, 9), ([0], [0]), True),
        (Sensors(range=2.0), [BEHIND], (1, 5), ([0], [0]), True),
        (Sensors(range=1.9), [BEHIND], (1, 5), ([0], [0]), False),
        (Sensors(range=0.0), [BEHIND], (3, 5.1), ([0], [0]), False),
        (Sensors(field_of_view=1.0), [BEHIND], (2.5, 5 + 0.26), ([0], [0]), True),  # the robot looks along -x
        (Sensors(field_of_view=1.0), [BEHIND], (2.5, 5 + 0.28), ([0], [0]), False),
        (Sensors(field_of_view=1.0), [BEHIND], (4, 5), ([0], [0]), False),
        (Sensors(field_of_view=6.29), [BEHIND], (4, 5), ([0], [0]), True),
        (SIGHT, [BEHIND], (5, 8), ([0], [0]), True),
        (SIGHT, [BEHIND], (7, 5), ([0], [0]), False),
        (SIGHT, [BEHIND, BESIDE], (7, 5), ([0, 0], [0]), True),
        (SIGHT, [BEHIND, BESIDE], (7, 5), ([0, 1], [0]), False),
        (SIGHT, [BESIDE], (7, 5), ([0], [1]), False),
    ],
)
def test_side_sees_active_opponents_that_any_active_robot_sees(sensors, pursuers, evader, status, seen):
    found = sense(sensors, DISC, state_of(pursuers, [evader], status), Role.PURSUER, WORDS[0])
    assert bool(found.in_sight[0]) is seen


def percepts(sensors, pursuer, evader):
    """What one robot perceives of another by many random bits."""
    state = state_of([pursuer], [evader], ([0], [0]))
    return jax.vmap(lambda bits: sense(sensors, Arena(), state, Role.PURSUER, bits))(WORDS)


def test_sensor_noise_has_the_stated_size_and_bound():
    noise, own = Noise(0.05, 0.1, 0.02), Noise(position=0.2)
    here, there = (1.0, 2.0, 0.5, 3.1), (4.0, 4.0, 0.3, -3.1)
    found = percepts(Sensors(noise=noise, own_noise=own), here, there)
    for (seen,), truth, asked in ((found.opponents, there, noise), (found.own, here, own)):
        error = jax.tree.map(lambda value, true: np.asarray(value - true), seen, robot(*truth))
        turned = np.angle(np.exp(1j * error.heading))
        assert np.all(np.abs(seen.heading) <= np.pi + 1e-6)
        sizes = asked.position, asked.position, asked.speed, asked.heading
        for values, size in zip((error.x, error.y, error.v, turned), sizes, strict=True):
            assert np.std(values) == pytest.approx(size, rel=0.05, abs=1e-6)
            assert np.mean(values) == pytest.approx(0, abs=max(0.1 * size, 1e-6))
            assert np.max(np.abs(values)) <= BOUND * size + 1e-5
    assert abs(np.corrcoef(found.own[0].x, found.opponents[0].x)[0, 1]) < 0.06


def test_nothing_is_seen_during_a_drop_out():
    found = percepts(Sensors(drop_out=0.3), (1, 1), (2, 2))
    assert np.mean(found.has_looked) == pytest.approx(0.7, abs=0.03)
    np.testing.assert_array_equal(found.has_looked, found.in_sight[0])
