"""Cars against the shortest paths of bounded curvature (Dubins, 1957): they drive them, and none that are shorter."""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.car import Car
from apollonius.game.dynamics import Unicycle
from apollonius.game.omni import Omni
from tests.acting import robot
from tests.oracle.dubins import CURVES, WORDS, best_words, shortest

CARS = [Car(), Car(v_min=0.3, v_max=2.0, u2_max=0.6, wheelbase=2.7), Car(v_min=0.3, u2_max=1.2, wheelbase=0.5)]
"""With circles of 0.74 m, 3.9 m and 0.19 m."""
SPEED = 1.0
PAIRS, PARTS = 600, 16
"""Pairs of poses, and steps in which a segment is driven: an arc turns by 0.4 rad at most in each."""
DRIVES, STEPS = 2000, 40
"""Random drives, and the steps of each: more than a circle at full lock in all."""
ROUNDING = 2 * np.finfo(np.float32).eps
"""Of a heading in a step: of the sum, which is up to pi, and of the turn."""
SLACK = 1e-4
"""Share by which a path may be too sharp. Dubins' length jumps by a circle where a target comes to lie inside the
sharpest arc, so that for places in single precision it is compared with a circle smaller by this share."""


def sharpest(car):
    """Return the radius of a car's smallest circle."""
    return car.wheelbase / math.tan(car.u2_max)


@jax.jit
def drive(body, start, u1, u2, dt):
    """Return the states of many robots after each of their steps, and before the first: leaves `[steps + 1, robots]`.

    Args:
        body: their limits.
        start: their states.
        u1, u2: the controls, `[steps, robots]`.
        dt: the durations of the steps, the same.
    """

    def one_step(robots, step):
        after = jax.vmap(body.move)(robots, *step)
        return after, after

    controls = jax.tree.map(partial(jnp.asarray, dtype=jnp.float32), (u1, u2, dt))
    _, course = jax.lax.scan(one_step, start, controls)
    return jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), start, course)


def robots_at(poses):
    """Return many robots at poses `[3, robots]` and at the speed `SPEED`."""
    x, y, heading = np.float32(poses)
    return jax.vmap(robot)(x, y, np.full_like(x, SPEED), heading)


def pose_of(robots):
    """Return x, y and heading of many robots."""
    return np.stack([robots.x, robots.y, robots.heading]).astype(float)


def at_step(course, step):
    """Return the poses after a step of a course."""
    return pose_of(jax.tree.map(lambda leaf: leaf[step], course))


def random_poses(rng, radius, count):
    """Return poses between which every word is the shortest for some: a few radii apart."""
    sizes = np.array([[3 * radius], [3 * radius], [math.pi]])
    return np.float32(rng.uniform(-sizes, sizes, (3, count))).astype(float)


@pytest.mark.parametrize("car", CARS)
def test_car_drives_the_shortest_path_to_its_target(car):
    rng, radius = np.random.default_rng(0), sharpest(car)
    start, goal = random_poses(rng, radius, PAIRS), random_poses(rng, radius, PAIRS)
    best, lengths = best_words(start, goal, radius)
    assert np.bincount(best, minlength=len(WORDS)).min() > PAIRS / 50
    curves = np.array([[CURVES[curve] for curve in word] for word in WORDS])[best].T
    steering, dt = (np.repeat(values, PARTS, axis=0) for values in (curves * car.u2_max, lengths / PARTS / SPEED))
    off = at_step(drive(car, robots_at(start), np.zeros_like(dt), steering, dt), -1) - goal
    rounding = len(dt) * ROUNDING
    assert np.max(np.abs(np.exp(1j * off[2]) - 1)) < rounding
    assert np.max(np.hypot(off[0], off[1])) < rounding * np.max(lengths.sum(axis=0))


def random_controls(rng, body):
    """Return controls of random drives, each held for some steps: half of them steer at full lock or not at all."""
    number = np.arange(STEPS)[:, None] // rng.integers(1, 9, DRIVES)
    accelerating, steering, switching = rng.uniform(-1, 1, (3, STEPS, DRIVES))
    steering = np.where(np.arange(DRIVES) % 2, np.round(1.5 * switching), steering)
    u1, u2 = (np.take_along_axis(values, number, axis=0) for values in (accelerating, steering))
    return u1 * body.u1_max, u2 * body.u2_max


def saved(body, radius):
    """Return by how much each random drive is shorter than Dubins' path between its ends, in radii.

    Speeds change, and never meet a limit, so that each step's length is the mean speed's.
    """
    rng = np.random.default_rng(1)
    dt = 8 * radius / SPEED / STEPS
    course = drive(body, robots_at(np.zeros((3, DRIVES))), *random_controls(rng, body), np.full((STEPS, DRIVES), dt))
    speeds = np.asarray(course.v, float)
    assert np.all((speeds > body.v_min) & (speeds < body.v_max))
    assert np.ptp(speeds) > SPEED
    length = np.sum((speeds[1:] + speeds[:-1]) / 2 * dt, axis=0)
    return (shortest(at_step(course, 0), at_step(course, -1), radius * (1 - SLACK)) - length) / radius


def forward_limits(radius):
    """Return limits within which no random drive meets a limit of speed."""
    return {"v_min": 0.05 * SPEED, "v_max": 1.95 * SPEED, "u1_max": 0.9 * SPEED**2 / (8 * radius)}


@pytest.mark.parametrize("car", CARS)
def test_no_car_drives_forwards_by_a_path_shorter_than_dubins(car):
    radius = sharpest(car)
    body = Car(**forward_limits(radius), u2_max=car.u2_max, wheelbase=car.wheelbase)
    assert np.max(saved(body, radius)) < SLACK


@pytest.mark.parametrize(
    "body",
    [Unicycle(u2_max=SPEED, **forward_limits(1.0)), Omni(lateral_acceleration=SPEED**2, **forward_limits(1.0))],
    ids=["unicycle", "omni"],
)
def test_robots_that_turn_more_sharply_when_slow_take_shorter_paths(body):
    """At the speed `SPEED` they turn as a car does on a circle of 1 m."""
    assert np.mean(saved(body, 1.0) > 0.1) > 0.01


@pytest.mark.parametrize(
    ("body", "radius"),
    [*((car, sharpest(car)) for car in CARS), (Unicycle(u2_max=2.0), 0.5), (Omni(lateral_acceleration=2.0), 0.5)],
)
def test_less_than_half_a_circle_at_full_lock_is_the_shortest_path(body, radius):
    """Also of robots of other kinds, at one speed. Arcs of less than 0.3 rad leave the smaller circle of `SLACK` by no
    more than places are rounded.
    """
    rng = np.random.default_rng(2)
    turns, sides = rng.uniform(0.3, 3.0, PAIRS), rng.choice([-1, 1], PAIRS)
    steering, dt = (np.tile(values, (PARTS, 1)) for values in (body.u2_max * sides, turns * radius / SPEED / PARTS))
    course = drive(body, robots_at(np.zeros((3, PAIRS))), np.zeros_like(dt), steering, dt)
    lengths = shortest(at_step(course, 0), at_step(course, -1), radius * (1 - SLACK))
    np.testing.assert_allclose(lengths / radius, turns, atol=2 * SLACK)
