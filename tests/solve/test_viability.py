"""Which starts are lost before they begin."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.charting import charted
from apollonius.game.presets import make_game
from apollonius.solve import viability
from apollonius.solve.grid import make_grid
from apollonius.solve.safety import solve_safety
from apollonius.solve.viability import TableRoom, Viability, doomed_start_rate, solve_viability
from tests.solve.small import BODY, MOVING

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


def test_a_table_is_solved_once_for_all_that_it_depends_on_and_no_more(monkeypatch):
    """The time limit, rewards, starts and a chart are nothing to it; whose table it is does not matter either."""
    solved = []

    def counted(game, role, grid, hold):
        solved.append(role)
        return solve_safety(game, role, grid, hold)

    monkeypatch.setattr(viability, "solve_safety", counted)
    monkeypatch.setattr(
        viability, "reference_grid", lambda game, role: (make_grid(game.arena, game.body(role), (5, 5, 3, 8)), 5)
    )
    game = replace(MOVING, evader=replace(BODY, v_max=0.4))
    first = solve_viability(game)
    assert len(solved) == 2
    longer = replace(
        game, max_steps=7, reward=replace(game.reward, progress=1.0), starts=replace(game.starts, clearance=0.2)
    )
    for same in (game, longer, charted(game), replace(game, pursuer=game.evader)):
        rate = doomed_start_rate(same, solve_viability(same), 100)
        assert len(solved) == 2
    assert 0 < rate < 1
    np.testing.assert_array_equal(
        solve_viability(longer).evader.manoeuvres[-1].table, first.evader.manoeuvres[-1].table
    )
    solve_viability(replace(game, dt=0.2))
    assert len(solved) == 4
