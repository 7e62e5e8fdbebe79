"""A robot learns its lag, turn time and limits from its own motion, and knows how well."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.wrappers.identification import Identifying
from apollonius.agents.wrappers.shield import Shielded
from apollonius.catalogue import find_player
from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.presets import in_teams, make_game
from apollonius.game.types import RobotState, Role
from apollonius.game.uncertainty import Uncertainty
from apollonius.io.errors import InvalidInput
from apollonius.observe.drive_estimate import DriveEstimate
from apollonius.observe.view import look
from tests.acting import state

NOMINAL = Unicycle()
DT = 0.1
ROBOTS = 400


def estimates(noise, steps):
    """Drives and limits drawn at random, and what robots that drive as they like have learnt of them."""
    keys = jax.random.split(jax.random.key(0), 4)
    lags = jax.random.randint(keys[0], (ROBOTS,), 0, 6)
    times = jax.random.uniform(keys[1], (ROBOTS,), maxval=0.9)
    shares = jax.random.uniform(keys[2], (ROBOTS, 3), minval=0.75, maxval=1.25)

    def learn(lag, time, shares, key):
        v_max, u1_max, u2_max = shares * jnp.array([1.2, 0.3, 0.8])
        body, drive = Unicycle(v_max=v_max, u1_max=u1_max, u2_max=u2_max), Drive(lag, time)

        def one_step(carry, key):
            robot, state, estimate, action = carry
            keys = jax.random.split(key, 3)
            errors = jax.random.uniform(keys[0], (2,), minval=-1.0)
            seen = replace(
                robot, heading=robot.heading + noise.heading * errors[0], v=robot.v + noise.speed * errors[1]
            )
            estimate = estimate.after_state(seen, NOMINAL, noise, DT)
            changes, new = jax.random.bernoulli(keys[1], 0.3), jax.random.randint(keys[2], (), 0, 9)
            action = jnp.where(changes, new, action)
            (u1, u2), state = drive.respond(state, body, action, DT)
            return (body.move(robot, u1, u2, DT), state, estimate.after_command(action), action), None

        start = RobotState(*jnp.zeros(4)), drive.at_rest(), DriveEstimate.at_start(), jnp.int32(7)
        (_, _, estimate, _), _ = jax.lax.scan(one_step, start, jax.random.split(key, steps))
        return estimate.drive(NOMINAL, DT)

    learnt = jax.jit(jax.vmap(learn))(lags, times, shares, jax.random.split(keys[3], ROBOTS))
    return lags, times, shares, learnt


def delay_error(learnt, lags):
    return jnp.abs(learnt.drive.lag - lags).astype(jnp.float32) * DT


def test_drive_is_learnt_within_seconds_and_is_within_its_bounds():
    lags, times, shares, learnt = estimates(Uncertainty(), 40)
    bounds = learnt.uncertainty
    assert np.mean(learnt.drive.lag == lags) > 0.99
    assert np.mean(np.abs(learnt.drive.turn_time - times)) < 0.04
    assert np.mean(np.abs(learnt.body.u1_max / 0.3 - shares[:, 1])) < 0.01
    assert np.mean(np.abs(learnt.body.u2_max / 0.8 - shares[:, 2])) < 0.05
    assert np.mean(bounds.turn_delay) < 0.2
    for error, bound in (
        (delay_error(learnt, lags), bounds.delay),
        (jnp.abs(learnt.drive.turn_time - times), bounds.turn_delay),
        (jnp.abs(0.3 * shares[:, 1] / learnt.body.u1_max - 1), bounds.acceleration),
        (jnp.abs(0.8 * shares[:, 2] / learnt.body.u2_max - 1), bounds.turning),
    ):
        assert np.mean(error <= bound + 1e-5) > 0.96


def test_noise_widens_the_bounds_and_the_truth_stays_within():
    noise = Uncertainty(heading=0.02, speed=0.02)
    lags, times, shares, learnt = estimates(noise, 40)
    bounds = learnt.uncertainty
    _, _, _, exact = estimates(Uncertainty(), 40)
    for name in ("delay", "acceleration", "turning", "turn_delay"):
        assert np.mean(getattr(bounds, name)) > 1.5 * np.mean(getattr(exact.uncertainty, name))
    assert np.mean(delay_error(learnt, lags) <= bounds.delay + 1e-5) > 0.98
    assert np.mean(jnp.abs(learnt.drive.turn_time - times) <= bounds.turn_delay) > 0.98
    assert np.mean(jnp.abs(0.3 * shares[:, 1] / learnt.body.u1_max - 1) <= bounds.acceleration) > 0.96


def test_robot_that_has_not_moved_takes_the_named_limits_and_knows_nothing():
    rest = RobotState(*jnp.zeros(4))
    estimate = DriveEstimate.at_start()
    for _ in range(3):
        estimate = estimate.after_state(rest, NOMINAL, Uncertainty(), DT).after_command(jnp.int32(4))
    learnt = estimate.drive(NOMINAL, DT)
    assert float(learnt.body.u1_max) == pytest.approx(0.3)
    assert float(learnt.body.v_max) == pytest.approx(1.5), "it may be a quarter faster than the game names"
    assert float(learnt.uncertainty.delay) == pytest.approx(0.5)
    assert float(learnt.uncertainty.turn_delay) > 0.5
    assert float(learnt.uncertainty.acceleration) > 0.3


def test_top_speed_is_learnt_where_a_robot_speeds_up_in_vain():
    """Faster or slower than the game names; speeds that still grow, or that fall, say nothing."""
    for top in (1.0, 1.4):
        estimate = DriveEstimate.at_start()
        found = []
        for step in range(60):
            v = min(0.03 * step, top)
            seen = RobotState(*map(jnp.float32, (0.0, 0.0, v, 0.0)))
            estimate = estimate.after_state(seen, NOMINAL, Uncertainty(), DT).after_command(jnp.int32(7))
            found.append(float(estimate.drive(NOMINAL, DT).body.v_max))
        reached = int(np.ceil(top / 0.03))
        assert found[reached - 1] == pytest.approx(1.5)
        assert found[reached + 2 :] == pytest.approx([top] * (58 - reached))


def test_identifying_comes_before_shielded_and_needs_robots_that_are_alike():
    player = find_player("identifying:shielded:intercept", Role.PURSUER, make_game("paper"))
    assert player.name == "identifying:shielded:intercept"
    assert isinstance(player.policy, Identifying)
    assert isinstance(player.policy.policy, Shielded)
    assert player.policy.policy.backup.is_uncertain
    for name in ("shielded:identifying:intercept", "identifying:identifying:still"):
        with pytest.raises(InvalidInput):
            find_player(name, Role.PURSUER, make_game("paper"))
    team = in_teams(make_game("paper"), 2, 1)
    slower = replace(team, teams=replace(team.teams, pursuers=(Unicycle(v_max=0.9),)))
    with pytest.raises(InvalidInput, match="robots that differ"):
        find_player("identifying:intercept", Role.PURSUER, slower)


def test_view_of_an_identifying_player_ignores_what_the_game_says_of_its_drive():
    told = Game(pursuer=Unicycle(radius=0.2), drives=Drives(pursuer=Drive(lag=3, turn_time=0.9)))
    player = find_player("identifying:intercept", Role.PURSUER, told).policy
    view = look(told, state((5.0, 5.0), (1.0, 1.0)), Role.PURSUER)
    seen = player.view_of(view, DriveEstimate.at_start())
    assert float(seen.own.body.radius) == pytest.approx(0.2)
    assert float(seen.own.turn_time) == pytest.approx(0.475, abs=0.01)
    assert float(seen.own.uncertainty.delay) == pytest.approx(0.5)
