"""Disturbances: late commands, other limits, slow turns, blurred states; and nothing at all without them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.disturbance import NONE, Disturbance, Handicap, draw_handicap, with_sensor_noise
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import reset_batch
from apollonius.game.presets import make_game
from apollonius.io.errors import InvalidInput
from tests.acting import robot

BODY, DT = Unicycle(), 0.1
WORDS = jax.random.bits(jax.random.key(0), (4000,), jnp.uint32)
LEFT, RIGHT, FASTER_LEFT = 5, 3, 8


def handicap(delay=0, late=0, factors=(1.0, 1.0, 1.0), turn_time=0.0):
    return Handicap(
        jnp.asarray(late), jnp.asarray(factors), jnp.float32(turn_time), jnp.float32(0.0), jnp.zeros((delay, 2))
    )


def responses(handicap, actions, v=0.5):
    """The controls that actions come to, one after the other."""
    made = []
    for action in actions:
        controls, handicap = handicap.respond(BODY, robot(1.0, 2.0, v), jnp.asarray(action), DT)
        made.append([float(control) for control in controls])
    return made


def test_without_handicaps_actions_come_to_their_own_controls():
    wanted = [[float(control) for control in BODY.controls(jnp.asarray(action))] for action in range(9)]
    assert responses(handicap(), range(9)) == [pytest.approx(controls, abs=2e-5) for controls in wanted]


def test_late_commands_come_when_they_are_due():
    made = responses(handicap(delay=3, late=2), [FASTER_LEFT, RIGHT, LEFT, LEFT])
    expected = [[0, 0], [0, 0], [0.3, 0.8], [0, -0.8]]
    assert made == [pytest.approx(controls, abs=2e-5) for controls in expected]


def test_limits_are_the_robots_own():
    (controls,) = responses(handicap(factors=(0.8, 1.1, 0.9)), [FASTER_LEFT])
    assert controls == pytest.approx([0.33, 0.72], abs=2e-5)
    (controls,) = responses(handicap(factors=(0.8, 1.1, 0.9)), [FASTER_LEFT], v=0.95)
    assert controls[0] == pytest.approx((0.96 - 0.95) / DT, rel=1e-4)
    (controls,) = responses(handicap(factors=(0.8, 1.0, 1.0)), [FASTER_LEFT], v=1.2)
    assert controls[0] == pytest.approx(-0.3)  # faster than it can go, it slows down as a robot brakes


def test_a_turn_rate_takes_its_time_and_turns_the_robot_by_its_mean():
    """Against the integral of a ramp to the wanted rate, in small steps."""
    made = responses(handicap(turn_time=0.25), [LEFT] * 4 + [RIGHT] * 3)
    rate, slope, means = 0.0, 0.8 / 0.25, []
    for wanted in [0.8] * 4 + [-0.8] * 3:
        total = 0.0
        for _ in range(1000):
            rate += np.clip(wanted - rate, -slope * DT / 1000, slope * DT / 1000)
            total += rate / 1000
        means.append(total)
    assert [u2 for _, u2 in made] == pytest.approx(means, abs=1e-3)


def test_each_game_draws_its_own():
    asked = Disturbance(delay=2, limits=0.2, turn_time=0.5)
    drawn = jax.vmap(lambda bits: draw_handicap(bits, asked))(WORDS)
    assert np.bincount(drawn.delay) / len(WORDS) == pytest.approx([1 / 3] * 3, abs=0.03)
    speed, u1, u2 = np.asarray(drawn.factors).T
    assert (speed.min(), speed.max()) == (pytest.approx(0.8, abs=0.01), pytest.approx(1.0, abs=0.01))
    for factor in (u1, u2):
        assert (factor.min(), factor.max()) == (pytest.approx(0.8, abs=0.01), pytest.approx(1.2, abs=0.01))
    assert np.mean(drawn.turn_time) == pytest.approx(0.25, abs=0.01)
    assert abs(np.corrcoef(u1, u2)[0, 1]) < 0.06


def test_states_are_seen_with_errors_of_the_asked_size():
    states = reset_batch(make_game("paper"), jax.random.key(1), len(WORDS))
    asked = Disturbance(position_noise=0.05, speed_noise=0.02, heading_noise=0.1)
    seen = jax.vmap(lambda state, bits: with_sensor_noise(state, bits, asked))(states, WORDS)
    for side in ("pursuer", "evader"):
        before, after = getattr(states, side), getattr(seen, side)
        turned = np.angle(np.exp(1j * (np.asarray(after.heading) - np.asarray(before.heading))))
        sizes = [np.std(np.asarray(after.x - before.x)), np.std(np.asarray(after.v - before.v)), np.std(turned)]
        assert sizes == pytest.approx([0.05, 0.02, 0.1], rel=0.05)
    assert with_sensor_noise(states, WORDS[0], NONE) is states


@pytest.mark.parametrize(("name", "value"), [("delay", -1), ("limits", 1.0), ("turn_time", float("nan"))])
def test_impossible_disturbances_are_refused(name, value):
    with pytest.raises(InvalidInput, match=name):
        Disturbance(**{name: value})
