"""Walls (Eq. 2), clearance, and contact anywhere along a step."""

import jax
import numpy as np
import pytest

from apollonius.game.arena import Arena, Disc
from tests.acting import robot

ARENA = Arena(-1.0, 3.0, 0.0, 2.0, discs=(Disc(0.0, 1.0, 0.25), Disc(2.0, 0.5, 0.3)))
clearances = jax.jit(jax.vmap(Arena.clearance, in_axes=(None, 0, 0)))
leaves = jax.jit(Arena.is_out_of_range)


def test_clearance_is_the_distance_to_the_nearest_boundary_point():
    angles = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    rims = [(disc.x + disc.radius * np.cos(angles), disc.y + disc.radius * np.sin(angles)) for disc in ARENA.discs]
    along_x, along_y = np.linspace(-1, 3, 4000), np.linspace(0, 2, 4000)
    walls = [(along_x, 0 * along_x), (along_x, 0 * along_x + 2), (0 * along_y - 1, along_y), (0 * along_y + 3, along_y)]
    boundary = np.concatenate([np.stack(curve, axis=-1) for curve in (*rims, *walls)])

    points = np.random.default_rng(0).uniform((-1, 0), (3, 2), (200, 2)).astype(np.float32)
    to_boundary = np.linalg.norm(points[:, None] - boundary, axis=-1).min(axis=1)
    inside = np.any([np.hypot(*(points - (disc.x, disc.y)).T) < disc.radius for disc in ARENA.discs], axis=0)
    assert 10 < inside.sum() < 100
    np.testing.assert_allclose(clearances(ARENA, *points.T), np.where(inside, -to_boundary, to_boundary), atol=1e-3)


@pytest.mark.parametrize("radius", [0.0, 0.25])
@pytest.mark.parametrize(
    ("wall", "outwards"), [((-1, 1), (-1, 0)), ((3, 1), (1, 0)), ((1, 0), (0, -1)), ((1, 2), (0, 1))]
)
def test_a_wall_may_be_touched_but_not_passed(wall, outwards, radius):
    touching = np.subtract(wall, np.multiply(radius, outwards))
    assert not leaves(ARENA, robot(*touching), radius)
    assert leaves(ARENA, robot(*(touching + np.multiply(1e-6, outwards))), radius)
