"""Maps of what is solved show the tables, node by node."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.axes import Axes

from apollonius.arenas.record import to_dict
from apollonius.game.presets import make_game
from apollonius.show.solution import save_solution_maps
from apollonius.solve.grid import make_grid
from apollonius.solve.store import Problem, Solution
from tests.solve.small import as_matrix

GAME = make_game("one-large")
GRID = make_grid(GAME.arena, GAME.pursuer, (5, 5, 3, 4))


@pytest.mark.parametrize("kind", ["safety", "reach", "game"])
def test_maps_are_of_the_lowest_speed_and_of_the_highest(kind, tmp_path, monkeypatch):
    """Of a game the mean over the other robot's nodes; where there is no capture, nothing."""
    lanes = 20
    shape = (GRID.size // lanes, GRID.size, lanes) if kind == "game" else GRID.shape
    table = jax.random.uniform(jax.random.key(0), shape, minval=0.1).at[(0,) * len(shape)].set(0.0)
    target = [2.5, 1.0] if kind == "reach" else None
    problem = Problem(kind, "pursuer", to_dict(GAME), list(GRID.counts), 10, target)
    drawn, draw = [], Axes.pcolormesh
    monkeypatch.setattr(Axes, "pcolormesh", lambda *given, **how: drawn.append(given[3]) or draw(*given, **how))
    # A map's colour bar is a mesh too.
    save_solution_maps(Solution(problem, 1, 0.0, table.astype(jnp.float32)), GAME, tmp_path / "maps.png")
    assert (tmp_path / "maps.png").read_bytes().startswith(b"\x89PNG")
    values = np.asarray(table if kind != "game" else as_matrix(table).mean(axis=0).reshape(GRID.shape))
    for found, expected in zip(drawn[::2], (values[0].max(axis=0), values[-1].min(axis=0)), strict=True):
        if kind == "reach":
            expected = -20 * np.log(expected)
        shown = ~np.ma.getmaskarray(found)
        assert 0.5 < shown.mean() < 1
        np.testing.assert_allclose(found.data[shown], expected.T[shown], rtol=1e-4)
