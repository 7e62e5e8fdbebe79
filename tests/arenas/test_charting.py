"""Charts: how much room there is, how far one sees, and how long the ways are, against what can be worked out."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.charting import paths, with_chart
from apollonius.game.arena import Arena, Disc
from apollonius.game.chart import COARSE, COARSE_BITS, NO_PATH, SIDE, STEPS, Chart, entries
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_arenas
from tests.acting import clearances

WALL = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, 6.0), (4.0, 6.0)))
"""Across an arena of 8 by 8 m, with a door of 2 m at its top."""
ROOM = Arena(0.0, 8.0, 0.0, 8.0, polygons=(WALL,))
OPEN = Arena(-1.0, 5.0, 2.0, 6.0, discs=(Disc(2.0, 4.0, 0.7),))


def chart_of(arena, **changes):
    return with_chart(replace(Game(arena=arena), **changes)).chart


def chart_of_field(field):
    """A chart with this field, whose lower left corner is (3, -2), with cells of 0.1 m."""
    blank = jnp.zeros((1, 1, 1), jnp.uint16)
    corners = jnp.broadcast_to(jnp.asarray(field, jnp.float32), (1, SIDE + 1, SIDE + 1))
    return Chart(corners, blank, blank, jnp.array([3.0]), jnp.array([-2.0]), jnp.array([SIDE / 10]))


def points(arena, count):
    low, high = (arena.x_min, arena.y_min), (arena.x_max, arena.y_max)
    return np.random.default_rng(0).uniform(low, high, (count, 2)).astype(np.float32).T


@pytest.mark.parametrize("arena", [ROOM, OPEN], ids=["room", "open"])
def test_chart_clearance_matches_the_arena_to_within_a_cell(arena):
    chart = chart_of(arena)
    away = np.abs(np.subtract(*(clearances(one, *points(arena, 3000)) for one in (chart, arena))))
    cell = float(chart.side[0]) / SIDE
    assert np.max(away) < 0.75 * cell
    assert np.mean(away) < 0.05 * cell


@pytest.mark.parametrize(("along", "known"), [(0.03, 0.03), (19.15, 19.15), (19.2, 19.2), (25.0, 19.2), (-1.0, 0.0)])
def test_chart_clearance_is_linear_inside_and_constant_outside_the_chart(along, known):
    rising = jnp.linspace(0, SIDE / 10, SIDE + 1)
    assert float(chart_of_field(rising).clearance(jnp.float32(3 + along), jnp.float32(4.0))) == pytest.approx(
        known, abs=1e-4
    )
    upwards = chart_of_field(rising[:, None])
    assert float(upwards.clearance(jnp.float32(7.0), jnp.float32(along - 2))) == pytest.approx(known, abs=1e-4)


def test_ray_ends_at_the_first_obstacle():
    """From (0, 4) the disc is 1.3 m ahead, the walls are 1, 2 and 2 m away, and sideways past the disc 5 m."""
    rays = [(0.0, 4.0, 1.0, 0.0), (0.0, 4.0, -1.0, 0.0), (0.0, 4.0, 0.0, 1.0), (0.0, 5.4, 1.0, 0.0)]
    found = jax.jit(jax.vmap(chart_of(OPEN).range))(*jnp.asarray(rays, jnp.float32).T)
    np.testing.assert_allclose(found[:3], [1.3, 1.0, 2.0], atol=0.02)
    assert 2.0 < float(found[3]) <= 5.02, "past the disc the steps get short"


@jax.jit
def path_length(chart, start, end):
    start, end = jnp.asarray((start, end), jnp.float32)
    return chart.path_length(chart.cell_weights(*start), chart.cell_weights(*end))


def test_paths_lead_through_the_door():
    """Beside the wall, a metre from it on either side and 5 m below the door's middle: round the wall's end."""
    room = chart_of(ROOM)
    assert path_length(room, (1.0, 1.0), (1.0, 7.0)) == pytest.approx(6.0, rel=0.05)
    assert path_length(room, (6.0, 1.0), (7.5, 1.0)) == pytest.approx(1.5, abs=0.15)
    around = np.hypot(1.0, 5.0) + 0.2 + np.hypot(1.0, 5.0)
    there, back = path_length(room, (3.0, 1.0), (5.2, 1.0)), path_length(room, (5.2, 1.0), (3.0, 1.0))
    assert there == pytest.approx(around, rel=0.05)
    assert back == pytest.approx(float(there), rel=1e-3)
    middle = [(cell + 0.5) * 8.0 / COARSE for cell in (10, 3)]
    ends = room.cell_weights(*map(jnp.float32, (5.2, 1.7)))
    from_cell = float(room.path_length_from(jnp.asarray(3 * COARSE + 10), ends))
    assert from_cell == pytest.approx(float(path_length(room, middle, (5.2, 1.7))), rel=1e-3)
    assert path_length(room, (3.9, 3.0), (4.3, 3.0)) == pytest.approx(6.3, rel=0.1), "nothing is seen through the wall"


def test_coarse_cell_distances_in_an_empty_square_are_euclidean():
    """To all within two columns and rows; the lowest and leftmost stop is that of the corner."""
    chart = chart_of(Arena(0.0, 8.0, 0.0, 8.0), pursuer=Unicycle(radius=0.05), evader=Unicycle(radius=0.05))
    lengths = np.asarray(chart.lengths[0, 20 * COARSE + 20]).reshape(COARSE, COARSE)[18:23, 18:23]
    away = np.arange(-2, 3)
    np.testing.assert_array_equal(lengths, np.round(20 * np.hypot(away[:, None], away)))
    assert int(chart.visible[0, 0, 0]) % 2**COARSE_BITS == 0


def test_body_that_fits_nowhere_has_no_paths_and_sees_cell_zero():
    lengths, visible = paths(jnp.full((SIDE + 1, SIDE + 1), 0.3), jnp.float32(8.0), jnp.float32(0.4))
    np.testing.assert_array_equal(lengths, np.where(np.eye(COARSE**2, dtype=bool), 0, NO_PATH))
    assert not np.any(visible)


def test_body_that_just_fits_has_paths_despite_rounding():
    """Stops beside the walls are 0.2 m from them, to the last bits of single precision; the chart is too coarse for
    the four in the corners."""
    body = Unicycle(radius=0.2)
    lengths = np.asarray(chart_of(Arena(0.0, 16.0, 0.0, 16.0), pursuer=body, evader=body).lengths[0])
    assert np.sum(np.sum(lengths < NO_PATH, axis=1) == 1) == 4


def test_body_too_large_for_a_passage_has_no_path_through_it():
    door = Polygon(((4.0, 6.5), (4.2, 6.5), (4.2, 8.0), (4.0, 8.0)))
    narrow = replace(ROOM, polygons=(WALL, door))
    slim, stout = (chart_of(narrow, pursuer=Unicycle(radius=radius)) for radius in (0.1, 0.4))
    assert path_length(slim, (3.0, 1.0), (5.2, 1.0)) < 20
    assert path_length(stout, (3.0, 1.0), (5.2, 1.0)) == pytest.approx(NO_PATH / 100, rel=1e-3)


def test_cell_weights_sum_to_one_and_interpolate_the_position():
    x, y = points(OPEN, 500)
    cells, weights = map(np.asarray, jax.jit(jax.vmap(chart_of(OPEN).cell_weights))(x, y))
    np.testing.assert_allclose(np.sum(weights, axis=1), 1.0, atol=1e-5)
    free = np.asarray(clearances(OPEN, x, y)) > 0.1
    for place, cell, low in ((x, cells % COARSE, -1.0), (y, cells // COARSE, 2.0)):
        middle = (cell + 0.5) * 6.0 / COARSE + low
        np.testing.assert_allclose(np.sum(weights * middle, axis=1)[free], place[free], atol=0.02)


def test_entries_link_adjacent_free_cells():
    """The eight neighbours of each free cell, one after another; obstacles and shortest paths are drawn at random."""
    rng = np.random.default_rng(0)
    corners = np.where(rng.random((SIDE + 1, SIDE + 1)) < 0.2, 0.1, -0.1).astype(np.float32)
    rows, columns = (np.indices((SIDE, SIDE)) * COARSE // SIDE + rng.integers(-1, 2, (2, SIDE, SIDE))).clip(
        0, COARSE - 1
    )
    visible = (rows * COARSE + columns + (rng.integers(16, size=rows.shape) << COARSE_BITS)).astype(np.uint16)
    free = np.maximum.reduce([corners[1:, 1:], corners[1:, :-1], corners[:-1, 1:], corners[:-1, :-1]]) > 0
    owner = np.where(free, visible.astype(int) % 2**COARSE_BITS, -1)
    expected = np.zeros(COARSE**2, np.uint32)
    for up, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        rows, columns = slice(up, None), slice(max(right, 0), SIDE + min(right, 0))
        ends = owner[rows, columns].ravel(), owner[: SIDE - up, max(-right, 0) : SIDE + min(-right, 0)].ravel()
        for start, end in (ends, ends[::-1]):
            step = np.stack([end % COARSE - start % COARSE, end // COARSE - start // COARSE], axis=1)
            for number, known in enumerate(STEPS):
                entered = end[(start >= 0) & (end >= 0) & np.all(step == known, axis=1)]
                expected[entered] |= np.uint32(1 << number)
    np.testing.assert_array_equal(np.ravel(entries(jnp.asarray(corners), jnp.asarray(visible), COARSE)), expected)


def test_game_in_another_arena_does_not_keep_the_chart():
    moved = with_chart(Game(arena=ROOM)).in_arena(OPEN)
    assert moved.chart is None
    np.testing.assert_array_equal(with_chart(moved).chart.lengths, chart_of(OPEN).lengths)


def test_each_of_several_arenas_has_its_own_chart():
    together = with_chart(in_arenas(Game(), [ROOM, OPEN]))
    for number, arena in enumerate((ROOM, OPEN)):
        chart, alone = together.with_variant(jnp.asarray(number)).chart, chart_of(arena)
        np.testing.assert_allclose(*(clearances(one, *points(arena, 200)) for one in (chart, alone)), atol=1e-5)
        lengths = [np.asarray(one.lengths[member]) for one, member in ((chart, number), (alone, 0))]
        assert np.mean(lengths[0] != lengths[1]) < 1e-3
