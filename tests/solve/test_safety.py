"""Safety: the kernel against brute force and the shield's manoeuvres, in play, and the starts outside it."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.charting import charted
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import GameState, RobotState, Role
from apollonius.io.errors import InvalidInput
from apollonius.solve import viability as module
from apollonius.solve.grid import iterate, make_grid
from apollonius.solve.safety import solve_safety, steered_brakes
from apollonius.solve.viability import TableClearance, Viability, doomed_start_rate, solve_viability, viable_starts
from tests.oracle import numpy_solver as oracle
from tests.solve.small import BODY, MOVING, SMALL, TINY, as_table

GRID = make_grid(SMALL.arena, BODY, (31, 41, 5, 16))
HOLD = 5


def test_the_table_is_that_of_brute_force():
    """Each sweep goes down, and the last moves nothing."""
    told = []
    solved = solve_safety(SMALL, Role.PURSUER, make_grid(SMALL.arena, BODY, TINY), HOLD, told.append)
    expected = as_table(oracle.safety(SMALL, TINY, HOLD, solved.sweeps), TINY)
    np.testing.assert_allclose(solved.table, expected, atol=2e-6)
    assert 0.1 < np.mean(expected > 0) < 0.9
    assert [sweep.number for sweep in told] == list(range(1, solved.sweeps + 1))
    assert told[-1].residual == solved.residual == 0 < told[0].residual
    shares = [sweep.share(told[0].residual) for sweep in told]
    assert (shares[0], shares[-1]) == (0, 1)
    assert 0 < shares[1] < 1


@pytest.mark.slow
def test_doomed_starts_are_those_from_which_every_shield_fails():
    viability = solve_viability(MOVING)
    starts = viable_starts(MOVING, viability, jax.random.key(5), 500)
    assert starts.pursuer.x.shape == (500,)
    assert bool(jnp.all(jax.jit(jax.vmap(viability))(starts)))
    rate = doomed_start_rate(MOVING, viability)
    assert 0.02 < rate < 0.5
    kept = jax.jit(jax.vmap(viability))(reset_batch(MOVING, jax.random.key(9), 500))
    assert 1 - np.mean(kept) == pytest.approx(rate, abs=4 * np.sqrt(rate * (1 - rate) / 500))


@pytest.mark.slow
def test_a_robot_that_cannot_stop_is_judged_by_the_table():
    """On a field without obstacles it may circle at 0.1 / 0.8 = 0.125 m for ever."""
    body = Unicycle(v_min=0.1, v_max=0.4)
    game = Game(pursuer=body, evader=body, arena=SMALL.arena, starts=MOVING.starts)
    viability = solve_viability(game)
    assert 0 < doomed_start_rate(game, viability, starts=2000) < 0.2
    with pytest.raises(InvalidInput, match="can stop"):
        steered_brakes(game, Role.PURSUER, GRID, jnp.zeros(GRID.shape))
    rocket = Unicycle(v_min=2.0, v_max=3.0)
    game = Game(pursuer=rocket, evader=rocket, arena=SMALL.arena, starts=MOVING.starts)
    with pytest.raises(InvalidInput, match="viable"):
        viable_starts(game, solve_viability(game), jax.random.key(0), 2)


def test_a_grid_too_large_for_the_machine_is_refused():
    grid = make_grid(SMALL.arena, BODY, (10_001, 10_001, 101, 101))
    with pytest.raises(InvalidInput, match=r"grid = 10001x10001x101x101 needs .* GiB .* fewer nodes"):
        solve_safety(SMALL, Role.PURSUER, grid, HOLD)


@pytest.mark.parametrize(("pursuer", "evader", "viable"), [(0.0, 0.0, True), (-1e-6, 0.2, False), (0.1, -1e-6, False)])
def test_a_start_is_viable_where_both_robots_stay_clear(pursuer, evader, viable):
    def always(metres):
        grid = make_grid(SMALL.arena, BODY, (2, 2, 2, 4))
        return TableClearance(grid, jnp.full(grid.shape, metres, jnp.float32))

    state = GameState.of_two(RobotState(*[jnp.float32(0.2)] * 4), RobotState(*[jnp.float32(0.5)] * 4), jnp.int32(0))
    assert bool(Viability(always(pursuer), always(evader))(state)) == viable


@pytest.mark.slow
def test_a_table_is_solved_once_for_all_that_it_depends_on_and_no_more(monkeypatch):
    """Not time limit, rewards, starts or a chart; the side does not matter either, but the limits of its robot."""
    solved = []

    def counted(game, role, grid, hold):
        solved.append(role)
        return solve_safety(game, role, grid, hold)

    monkeypatch.setattr(module, "solve_safety", counted)
    monkeypatch.setattr(
        module, "reference_grid", lambda game, role, coarse: (make_grid(game.arena, game.body(role), (5, 5, 3, 8)), 5)
    )
    game = replace(MOVING, evader=replace(BODY, v_max=0.4))
    first = solve_viability(game)
    assert len(solved) == 2
    longer = replace(
        game, max_steps=7, reward=replace(game.reward, progress=1.0), starts=replace(game.starts, clearance=0.2)
    )
    for same in (game, longer, charted(game), replace(game, pursuer=game.evader)):
        viability = solve_viability(same)
        assert len(solved) == 2
        assert np.array_equal(viability.evader.manoeuvres[-1].table, first.evader.manoeuvres[-1].table)
    assert not np.array_equal(first.pursuer.manoeuvres[-1].table, first.evader.manoeuvres[-1].table)
    solve_viability(replace(game, dt=0.2))
    assert len(solved) == 4


def test_sweeps_come_to_an_end_at_a_number_and_there_a_small_residual_will_do(monkeypatch):
    monkeypatch.setattr("apollonius.solve.grid._MOST_SWEEPS", 4)
    told = []
    found = iterate(lambda table: (table, jnp.asarray(1e-5)), jnp.zeros(()), told.append, tolerance=0.0)
    assert [sweep.number for sweep in told] == [1, 2, 3, 4]
    assert found.sweeps == 4
    with pytest.raises(RuntimeError, match="after 4 sweeps"):
        iterate(lambda table: (table, jnp.asarray(1e-3)), jnp.zeros(()), tolerance=0.0)
