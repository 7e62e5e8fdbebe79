"""What robots see: lines of sight against NumPy, range, noise and drop-outs from samples; polygons near them."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.file import find_game
from apollonius.game.arena import Arena, Disc
from apollonius.game.by_side import BySide
from apollonius.game.nearby import surroundings
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Edges, Polygon
from apollonius.game.sensing import BOUND, Noise, Sensors, sense
from apollonius.game.types import GameState, RobotState, Role
from tests.acting import robot
from tests.oracle.numpy_sight import meets_cells, meets_disc, meets_polygon

OPEN = Arena()
WORDS = jnp.asarray(np.random.default_rng(0).integers(2**32, size=4000, dtype=np.uint32))
YES = jnp.ones((), bool)


def percept(sensors, arena, own, other, bits):
    """What pursuers perceive of an evader, each given with whether it is in play."""
    robots, active = zip(*(zip(*side, strict=True) for side in (own, [other])), strict=True)
    status = BySide(*(tuple(jnp.where(one, 0, 1) for one in side) for side in active))
    return sense(sensors, arena, GameState(BySide(*robots), jnp.int32(0), status=status), Role.PURSUER, bits)


def hidden(arena, starts, ends):
    zero = jnp.zeros(())
    state = lambda point: RobotState(*point, zero, zero)  # noqa: E731
    look = jax.vmap(lambda start, end: arena.hides(state(start), state(end)))
    return np.asarray(jax.jit(look)(jnp.asarray(starts, jnp.float32), jnp.asarray(ends, jnp.float32)))


def pairs(arena, count, seed, longest):
    rng = np.random.default_rng(seed)
    low, high = np.array([arena.x_min, arena.y_min]), np.array([arena.x_max, arena.y_max])
    starts = rng.uniform(low, high, (count, 2))
    return starts, np.clip(starts + rng.uniform(-longest, longest, (count, 2)), low, high)


def agrees(found, arena, starts, ends, meets):
    """Compare with the oracle; where they differ, a shift by rounding must change the oracle's answer."""
    expected = np.array([meets(a, b) for a, b in zip(starts, ends, strict=True)])
    assert 0.05 < expected.mean() < 0.95
    for number in np.flatnonzero(found != expected):
        a, b = starts[number], ends[number]
        side = np.array([a[1] - b[1], b[0] - a[0]]) / max(np.hypot(*(b - a)), 1e-9) * 2e-5
        assert {meets(a + side, b + side), meets(a - side, b - side)} == {True, False}, (a, b)


def test_discs_hide_what_numpy_says():
    arena = find_game("paper").arena
    starts, ends = pairs(arena, 20_000, 0, 10)
    discs = [(np.array([disc.x, disc.y]), disc.radius) for disc in arena.discs]
    agrees(hidden(arena, starts, ends), arena, starts, ends, lambda a, b: any(meets_disc(a, b, *one) for one in discs))


def test_polygons_hide_what_numpy_says():
    arena = replace(find_game("office").arena, discs=())
    starts, ends = pairs(arena, 800, 1, 3)
    outlines = [one.outline() for one in arena.polygons]
    agrees(
        hidden(arena, starts, ends), arena, starts, ends, lambda a, b: any(meets_polygon(a, b, one) for one in outlines)
    )


def test_cells_hide_what_numpy_says():
    cells = np.random.default_rng(2).random((24, 30)) < 0.08
    found = OccupancyMap(jnp.asarray(distance_field(cells, 0.25)), -1.0, 2.0, 0.25, "", "")
    arena = Arena(-1.0, 6.5, 2.0, 8.0, map=found)
    starts, ends = pairs(arena, 800, 3, 4)
    agrees(
        hidden(arena, starts, ends),
        arena,
        starts,
        ends,
        lambda a, b: meets_cells(a, b, found.occupied(), -1.0, 2.0, 0.25),
    )


@pytest.mark.parametrize(
    ("sensors", "other", "seen"),
    [
        (Sensors(), robot(9, 9), True),
        (Sensors(range=2.0), robot(3, 5), True),
        (Sensors(range=1.9), robot(3, 5), False),
        (Sensors(range=0.0), robot(5, 5.1), False),
        (Sensors(field_of_view=1.0), robot(4.5, 5 + 0.26), True),  # ahead is left: the robot looks along -x
        (Sensors(field_of_view=1.0), robot(4.5, 5 + 0.28), False),
        (Sensors(field_of_view=1.0), robot(6, 5), False),
        (Sensors(field_of_view=6.29), robot(6, 5), True),
        (Sensors(line_of_sight=True), robot(5, 8), True),
    ],
)
def test_range_and_field_of_view(sensors, other, seen):
    found = percept(sensors, OPEN, [(robot(5, 5, 0.0, np.pi), YES)], (other, YES), WORDS[0])
    assert bool(found.seen[0]) is seen


def test_a_side_sees_what_any_of_its_active_robots_sees_of_robots_in_play():
    arena, sensors = Arena(discs=(Disc(5.0, 5.0, 1.0),)), Sensors(line_of_sight=True)
    behind, beside, other = robot(3, 5), robot(5, 8), robot(7, 5)
    for own, there, seen in (
        ([(behind, YES)], YES, False),
        ([(behind, YES), (beside, YES)], YES, True),
        ([(behind, YES), (beside, ~YES)], YES, False),
        ([(beside, YES)], ~YES, False),
    ):
        assert bool(percept(sensors, arena, own, (other, there), WORDS[0]).seen[0]) is seen


def test_errors_have_the_size_asked_for_and_a_bound():
    noise, own = Noise(0.05, 0.1, 0.02), Noise(position=0.2)
    sensors = Sensors(noise=noise, own_noise=own)
    here, there = robot(1, 2, 0.5, 3.1), robot(4, 4, 0.3, -3.1)
    found = jax.vmap(lambda bits: percept(sensors, OPEN, [(here, YES)], (there, YES), bits))(WORDS)
    for robots, truth, asked in ((found.opponents, there, noise), (found.own, here, own)):
        turned = np.angle(np.exp(1j * (np.asarray(robots[0].heading) - float(truth.heading))))
        assert np.all(np.abs(np.asarray(robots[0].heading)) <= np.pi + 1e-6)
        for error, size in (
            (np.asarray(robots[0].x) - float(truth.x), asked.position),
            (np.asarray(robots[0].y) - float(truth.y), asked.position),
            (np.asarray(robots[0].v) - float(truth.v), asked.speed),
            (turned, asked.heading),
        ):
            assert np.std(error) == pytest.approx(size, rel=0.05, abs=1e-6)
            assert np.mean(error) == pytest.approx(0, abs=max(0.1 * size, 1e-6))
            assert np.max(np.abs(error)) <= BOUND * size + 1e-5
    both = np.corrcoef(np.asarray(found.own[0].x), np.asarray(found.opponents[0].x))[0, 1]
    assert abs(both) < 0.06


def test_in_a_drop_out_nothing_is_seen():
    found = jax.vmap(lambda bits: percept(Sensors(drop_out=0.3), OPEN, [(robot(1, 1), YES)], (robot(2, 2), YES), bits))(
        WORDS
    )
    assert np.mean(found.looked) == pytest.approx(0.7, abs=0.03)
    np.testing.assert_array_equal(found.looked, found.seen[0])


REACH, SIZE, LEFT, LOWER = 1.5, 16.0, 10.0, 30.0
"""Of the index; the side of its square and its lower left corner [m]. Cells are a quarter of a metre."""
RNG = np.random.default_rng(5)


def shape(at_x, at_y, *corners):
    return Polygon(tuple((LEFT + at_x + x, LOWER + at_y + y) for x, y in corners))


POLYGONS = (
    shape(3.0, 3.0, (0.0, 0.0), (4.5, 0.3), (4.4, 0.5), (0.0, 0.4)),  # long walls, along x and along y
    shape(11.0, 2.0, (0.0, 0.0), (0.3, 0.0), (0.7, 5.0), (0.4, 5.2)),
    shape(4.0, 8.0, (0.0, 0.0), (1.2, 0.2), (0.3, 0.3), (0.2, 1.2)),  # one with a dent, clockwise and the other way
    shape(8.0, 12.0, (0.0, 0.0), (0.0, 2.5), (2.5, 2.5), (2.5, 0.0)),
    shape(14.0, 13.0, (0.0, 0.0), (0.1, 0.0), (0.05, 0.1)),
)


@pytest.fixture(scope="module")
def index():
    return surroundings(POLYGONS, REACH, LEFT, LEFT + SIZE, LOWER, LOWER + SIZE)


@jax.vmap
def at(x, y):
    zero = jnp.zeros_like(x)
    return RobotState(x, y, zero, zero)


@pytest.mark.parametrize("length", [0.0, 0.7])
def test_what_is_near_is_as_far_away_as_among_all_polygons_up_to_the_reach(length, index):
    """From points, and from segments, among them those that are nearest to a polygon at neither of their ends."""
    x, y = RNG.uniform((LEFT + 1, LOWER + 1), (LEFT + SIZE - 1, LOWER + SIZE - 1), (6000, 2)).astype(np.float32).T
    angle = RNG.uniform(-np.pi, np.pi, 6000)
    ends = at(x, y), at(*np.float32((x + length * np.cos(angle), y + length * np.sin(angle))))
    everything = Edges.of(POLYGONS)
    one = lambda before, after: index.near(before.x, before.y).clearance_along(before, after)  # noqa: E731
    near, every = (np.asarray(jax.jit(jax.vmap(function))(*ends)) for function in (one, everything.clearance_along))
    within = every <= REACH - length
    at_ends = np.min([jax.jit(jax.vmap(everything.clearance))(end.x, end.y) for end in ends], axis=0)
    assert length == 0 or (within & (every < at_ends - 0.01 * length)).sum() > 15
    assert (every < 0).sum() > 50
    assert 500 < within.sum() < 5900
    np.testing.assert_allclose(near[within], every[within], atol=3e-5)
    assert (near[~within] > REACH - length).all()


def test_only_some_are_looked_at_and_none_where_none_is_in_reach(index):
    assert index.within.shape == (64, 64, 4)
    x, y = jnp.float32(LEFT + 15.5), jnp.float32(LOWER + 0.5)
    assert float(index.near(x, y).clearance(x, y)) > 1e5
