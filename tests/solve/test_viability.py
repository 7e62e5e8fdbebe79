"""Which starts are lost before they begin."""

import jax
import jax.numpy as jnp
import pytest

from apollonius.game.presets import make_game
from apollonius.solve.grid import make_grid
from apollonius.solve.viability import TableRoom, Viability

GAME = make_game("paper")
GRID = make_grid(GAME.arena, GAME.pursuer, (2, 2, 2, 4))


def always(metres):
    """A robot's room, whatever its state."""
    return TableRoom(GRID, jnp.full(GRID.shape, metres, jnp.float32))


@pytest.mark.parametrize(
    ("pursuer", "evader", "viable"),
    [(0.1, 0.2, True), (0.0, 0.0, True), (-1e-6, 0.2, False), (0.1, -1e-6, False), (-0.1, -0.1, False)],
)
def test_a_start_is_viable_where_neither_robot_lacks_room(pursuer, evader, viable):
    state = GAME.reset(jax.random.key(0))
    assert bool(Viability(always(pursuer), always(evader))(state)) == viable
