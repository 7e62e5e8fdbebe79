"""The room of an evader's course, against pursuers that drive at random and ones that drive best."""

import importlib.util
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.presets import make_game
from apollonius.game.types import RobotState, Role

FILE = Path(__file__).parents[2] / "benchmarks" / "escape_room.py"
GAME = make_game("paper")
STEPS = 40
TIMES = np.arange(2, STEPS + 1, 2)


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location(FILE.stem, FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def reach(benchmark):
    return benchmark.reach_of(GAME.pursuer, GAME.dt, STEPS)


def robot(*numbers):
    return RobotState(*(jnp.float32(number) for number in numbers))


def random_robot(draw):
    while True:
        x, y = draw.uniform(0.5, 9.5, 2)
        if GAME.arena.clearance(jnp.float32(x), jnp.float32(y)) > 0.1:
            return robot(x, y, draw.uniform(0, 1.2), draw.uniform(-3, 3))


def random_courses(draw, count):
    holds = draw.integers(9, size=(count, STEPS // 5))
    often_ahead = np.where(draw.random(holds.shape) < 0.5, holds, draw.integers(6, 9, holds.shape))
    return jnp.asarray(np.repeat(often_ahead, 5, axis=1), jnp.int32)


def gaps_at(benchmark, reach, pursuer, x, y):
    times = jnp.asarray(TIMES[: x.shape[1]])
    return np.asarray(benchmark.gaps(GAME, reach, pursuer, x, y, times))


def test_no_pursuer_comes_to_a_place_that_is_out_of_reach(benchmark, reach):
    draw = np.random.default_rng(3)
    drive = jax.jit(lambda robot, courses: benchmark.drive(GAME, Role.PURSUER, robot, courses))
    for _ in range(20):
        pursuer = random_robot(draw)
        states, is_free = drive(pursuer, random_courses(draw, 300))
        angle, shape = draw.uniform(-np.pi, np.pi, (300, 1)), (300, len(TIMES))
        # Places at less than the capture distance from where the pursuer then is.
        offset = 0.299 * np.stack([np.cos(angle), np.sin(angle)])
        x = states.x[:, TIMES - 1] + jnp.asarray(offset[0], jnp.float32)
        y = states.y[:, TIMES - 1] + jnp.asarray(offset[1], jnp.float32)
        gap = gaps_at(benchmark, reach, pursuer, x, y)
        assert gap.shape == shape
        in_disc = sum(np.hypot(x - disc.x, y - disc.y) < disc.radius for disc in GAME.arena.discs)
        counts = np.asarray(is_free[:, TIMES - 1]) & ~in_disc.astype(bool)
        assert counts.any()
        assert gap[counts].max() < 1e-3


@pytest.mark.parametrize(("speed", "course"), [(0.0, 7), (0.7, 7), (0.0, 8), (1.2, 8)])
def test_places_just_beyond_the_fastest_drive_are_out_of_reach(benchmark, reach, speed, course):
    pursuer = robot(1.0, 1.0, speed, 0.5)
    states, _ = benchmark.drive(GAME, Role.PURSUER, pursuer, jnp.full((1, STEPS), course, jnp.int32))
    # A turn is the fastest way in the direction in which it heads only at its end.
    last = {7: slice(0, None), 8: slice(0, 6)}[course]
    x, y, heading = (leaf[:, TIMES - 1][:, last] for leaf in (states.x, states.y, states.heading))
    beyond = GAME.capture_distance + 0.12
    x, y = x + beyond * jnp.cos(heading), y + beyond * jnp.sin(heading)
    assert gaps_at(benchmark, reach, pursuer, x, y).min() > 0


def test_a_disc_is_driven_around(benchmark):
    disc = jnp.float32(0.0), jnp.float32(0.0), jnp.float32(1.0)
    to_x, to_y = jnp.array([2.0, 0.0, -2.0]), jnp.array([0.1, 2.0, 2.0])
    lengths = benchmark.path_around(jnp.float32(-2.0), jnp.float32(0.0), to_x, to_y, disc)
    arc = np.pi - np.arctan2(0.1, 2.0) - np.arccos(1 / 2) - np.arccos(1 / np.hypot(2.0, 0.1))
    around = np.sqrt(3) + np.sqrt(np.hypot(2.0, 0.1) ** 2 - 1) + arc
    np.testing.assert_allclose(lengths, [around, np.hypot(2, 2), 2.0], rtol=1e-5)


def test_a_course_that_crashes_has_less_room_than_until_then(benchmark, reach):
    far, evader = robot(1.0, 9.0, 0.0, 0.0), robot(9.0, 1.0, 1.2, 0.0)
    courses = jnp.full((1, STEPS), 7, jnp.int32)
    room, _ = benchmark.rooms(GAME, reach, courses, far, evader)
    assert room[0] == 0  # The wall is a metre off, and braking would take two.
    still = jnp.full((1, STEPS), 1, jnp.int32)
    room, _ = benchmark.rooms(GAME, reach, still, far, robot(9.0, 1.0, 0.0, 0.0))
    assert room[0] == STEPS
