"""Bounds of what a robot does not know of itself hold for every error within them."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.file import from_dict, to_dict
from apollonius.game.drive import Drive, Drives, PredictedRobot, limited_turn_rate, predict_after_lag
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.sensing import Noise, Sensing, Sensors
from apollonius.game.types import DriveState, RobotState, Role
from apollonius.game.uncertainty import Uncertainties, Uncertainty
from apollonius.io.errors import InvalidInput

BODY = Unicycle()
DT = 0.1
STEPS = 75
BOUNDS = Uncertainty(position=0.05, heading=0.05, speed=0.05, delay=0.1, acceleration=0.2, turning=0.1)


def drive(robot, turn_time, rate, controls, body):
    mean, rate = limited_turn_rate(body, turn_time, rate, controls[1], DT)
    return body.move(robot, controls[0], mean, DT), rate


def true_and_known_paths(key, turn_time):
    """A robot that drives as it likes and then brakes: where it is, where it thinks that it is, and the bounds."""
    keys = jax.random.split(key, 9)
    levels = jax.random.randint(keys[0], (STEPS, 2), -1, 2).astype(jnp.float32)
    hold = jax.random.bernoulli(keys[1], 0.3, (STEPS,))
    brakes_from = jax.random.randint(keys[2], (), 1, 12)
    last_turn = jax.random.randint(keys[3], (), -1, 2).astype(jnp.float32)
    late = jax.random.bernoulli(keys[4], 0.5, (STEPS,))
    signs = jax.random.rademacher(keys[5], (3,), jnp.float32)
    angle, v = jax.random.uniform(keys[6], (2,))
    gains = jax.random.uniform(keys[7], (2,), minval=-1.0)
    body = Unicycle(
        u1_max=BODY.u1_max * (1 + BOUNDS.acceleration * gains[0]), u2_max=BODY.u2_max * (1 + BOUNDS.turning * gains[1])
    )
    true = RobotState(jnp.float32(0.0), jnp.float32(0.0), 1.2 * v, 6 * angle)
    known = RobotState(
        x=0.05 * jnp.cos(9 * angle),
        y=0.05 * jnp.sin(9 * angle),
        v=jnp.maximum(true.v + 0.05 * signs[0], 0.0),
        heading=true.heading + 0.05 * signs[1],
    )

    def one_step(carry, number):
        true, known, true_rate, rate, bounds, last_known = carry
        command = jnp.where(number >= brakes_from, jnp.stack([jnp.float32(-1.0), last_turn]), levels[number])
        command = jnp.where(hold[number] & (number < brakes_from), last_known, command)
        executed = jnp.where(late[number], last_known, command)
        true, true_rate = drive(true, turn_time, true_rate, executed * jnp.stack([body.u1_max, body.u2_max]), body)
        limits = jnp.stack([BODY.u1_max, BODY.u2_max])
        after, rate = drive(known, turn_time, rate, command * limits, BODY)
        bounds = bounds.after_switch(tuple(last_known * limits), tuple(command * limits))
        bounds = bounds.after_motion(BODY, known, after, tuple(command * limits), DT)
        apart = jnp.hypot(true.x - after.x, true.y - after.y)
        return (true, after, true_rate, rate, bounds, command), (apart, bounds.position, true.v)

    none, zero = jnp.zeros(2), jnp.zeros(())
    start = (true, known, zero, zero, BOUNDS, none)
    return jax.lax.scan(one_step, start, jnp.arange(STEPS))[1]


@pytest.mark.parametrize("turn_time", [1e-6, 0.6])
def test_true_place_is_within_the_bounds_whatever_the_errors(turn_time):
    keys = jax.random.split(jax.random.key(0), 4000)
    apart, bound, v = map(np.asarray, jax.jit(jax.vmap(lambda key: true_and_known_paths(key, turn_time)))(keys))
    assert (apart <= bound + 1e-3).all()
    assert (v[:, -1] == 0).all(), "all have come to rest"
    share = apart[:, -1] / bound[:, -1]
    assert share.max() > 0.35, "and the bounds are no idle ones"


def test_bounds_of_a_robot_that_has_rolled_out_grow_no_more():
    rest = RobotState(*jnp.zeros(4))
    bounds, brake = Uncertainty(position=0.05, speed=0.05), (jnp.float32(-0.3), jnp.float32(0.0))
    places = []
    for _ in range(5):
        bounds = bounds.after_motion(BODY, rest, rest, brake, DT)
        places.append(float(bounds.position))
    assert places[:2] == pytest.approx([0.055, 0.057])
    assert places[2:] == pytest.approx([0.057] * 3)
    idle = Uncertainty(speed=0.05).after_motion(BODY, rest, rest, (jnp.float32(0.0), jnp.float32(0.0)), DT)
    assert float(idle.speed) == pytest.approx(0.05), "who does not brake may go on rolling"


def test_bounds_grow_while_commands_are_on_their_way():
    """Two steps at 1 m/s with an error of the heading of 0.05 rad; then one late change of the turn rate."""
    robot = RobotState(*map(jnp.float32, (0.0, 0.0, 1.0, 0.0)))
    now = PredictedRobot(robot, None, Uncertainty(heading=0.05, delay=0.1))
    straight = DriveState(jnp.zeros((10, 2)), None)
    soon = predict_after_lag(Drive(lag=2), straight, BODY, now, DT)
    assert float(soon.uncertainty.position) == pytest.approx(0.01)
    turning = DriveState(jnp.zeros((10, 2)).at[0, 1].set(0.8), None)
    soon = predict_after_lag(Drive(lag=2), turning, BODY, now, DT)
    assert float(soon.uncertainty.heading) == pytest.approx(0.05 + 0.08)
    assert float(soon.uncertainty.position) == pytest.approx(0.1 * 0.05 + 0.1 * 0.13)


def test_noise_of_own_sensors_counts_and_adds_to_stated_bounds():
    noise = Noise(position=0.01, heading=0.02, speed=0.03)
    game = Game(sensors=Sensing(pursuer=Sensors(own_noise=noise)))
    assert game.uncertainty_of(Role.EVADER) is None
    bounds = replace(game, uncertainty=Uncertainties(Uncertainty(heading=0.1))).uncertainty_of(Role.PURSUER)
    found = [float(number) for number in (bounds.position, bounds.heading, bounds.speed)]
    assert found == pytest.approx([0.03 * 2**0.5, 0.16, 0.09])


def test_uncertainty_is_part_of_a_game_file_and_impossible_bounds_are_refused():
    game = Game(
        drives=Drives(pursuer=Drive(lag=1)), uncertainty=Uncertainties(pursuer=Uncertainty(heading=0.1, delay=0.2))
    )
    assert from_dict(Game, to_dict(game), "a test") == game
    for bounds, message in (
        (Uncertainty(position=-0.1), "uncertainty.evader.position = -0.1"),
        (Uncertainty(turning=1.0), "uncertainty.evader.turning = 1"),
        (Uncertainty(delay=0.1), "uncertainty.evader.delay = 0.1 .*drives.evader.lag"),
    ):
        with pytest.raises(InvalidInput, match=message):
            replace(game, uncertainty=Uncertainties(evader=bounds))
    with pytest.raises(InvalidInput, match="lag of 0 to 9"):
        replace(game, drives=Drives(pursuer=Drive(lag=10)))
