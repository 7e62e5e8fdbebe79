"""The two-robot game on a grid: against brute force, in its bounds, and in play."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.starts import Starts
from apollonius.game.types import RobotState, Role
from apollonius.io import limits
from apollonius.io.errors import InvalidInput
from apollonius.solve.grid import make_grid
from apollonius.solve.joint import guarantee, interpolate, make_duel, solve_duel
from apollonius.solve.motion import HORIZON
from apollonius.solve.zero_sum_game import make_zero_sum_game
from tests.oracle import numpy_chase
from tests.oracle import numpy_duel as oracle
from tests.solve.small import BODY, CRAMPED, FEW, HOLD, SMALL, as_matrix

MORE = (5, 7, 3, 6)


def zero_sum_game(game, role, counts, payoff="win", hold=HOLD):
    grids = (make_grid(game.arena, game.pursuer, counts), make_grid(game.arena, game.evader, counts))
    return make_zero_sum_game(game, grids, hold, role, payoff)


def solved(game, role, counts, tolerance=1e-4, **options):
    """What a side is sure of before it moves, by its node and the other's, and the duel and table it is from."""
    duel = make_duel(zero_sum_game(game, role, counts, **options))
    moved = solve_duel(duel, tolerance=tolerance).table
    return np.asarray(as_matrix(guarantee(duel, moved))), duel, moved


@pytest.fixture(scope="module")
def bounds():
    """The lower and the upper value in the small game, by the pursuer's node and the evader's."""
    lower, _, _ = solved(SMALL, Role.PURSUER, MORE)
    upper, _, _ = solved(SMALL, Role.EVADER, MORE)
    return lower, -upper.T


@pytest.mark.parametrize("payoff", ["win", pytest.param("time", marks=pytest.mark.slow)])
@pytest.mark.parametrize("role", [Role.PURSUER, pytest.param(Role.EVADER, marks=pytest.mark.slow)])
def test_the_table_is_that_of_brute_force(robot, captures, role, payoff):
    told = []
    duel = make_duel(zero_sum_game(CRAMPED, role, FEW, payoff))
    found = solve_duel(duel, told.append, tolerance=1e-5)
    assert found.residual <= 1e-5 < told[-2].residual
    steps = captures if role == Role.PURSUER else captures.transpose(1, 0, 3, 2)
    pursuing, stakes = role == Role.PURSUER, (duel.zero_sum_game.win, duel.zero_sum_game.lose)
    expected = oracle.guarantee(CRAMPED, robot, robot, pursuing, steps, found.sweeps, HORIZON, *stakes, HOLD)
    np.testing.assert_allclose(as_matrix(found.table).T, expected[1], atol=1e-6)
    np.testing.assert_allclose(
        as_matrix(guarantee(duel, found.table)),
        oracle.guarantee(CRAMPED, robot, robot, pursuing, steps, found.sweeps + 1, HORIZON, *stakes, HOLD)[0],
        atol=1e-6,
    )
    assert np.ptp(expected[0]) > 0.9
    assert len(np.unique(np.round(expected[0], 3))) > 20


@pytest.mark.slow
def test_the_upper_value_is_nowhere_less_than_the_lower(bounds):
    lower, upper = bounds
    assert np.min(upper - lower) >= -5e-3
    assert np.mean(upper - lower) > 0.01
    assert np.any(lower > 0.5)
    assert np.any(upper < -0.5)


@pytest.mark.slow
def test_the_time_to_a_win_is_not_longer_where_a_loss_does_not_count(bounds):
    in_time, _, _ = solved(SMALL, Role.PURSUER, MORE, payoff="time")
    assert np.all(in_time >= bounds[0] - 5e-3)
    assert np.min(in_time) >= 0


@pytest.mark.slow
def test_at_nodes_interpolation_gives_the_table(bounds):
    duel = make_duel(zero_sum_game(SMALL, Role.PURSUER, (4, 5, 3, 5)))
    table = solve_duel(duel).table
    first, second = duel.first.grid, duel.second.grid
    one = second.node(*(jnp.int32(index) for index in (1, 3, 2, 3)))
    others = jax.vmap(first.node)(*(jnp.array(indices, jnp.int32) for indices in ([0, 2], [4, 1], [3, 0], [2, 3])))
    matrix = np.asarray(as_matrix(table))
    nodes = [int(np.ravel_multi_index(index, first.shape)) for index in ((0, 4, 3, 2), (2, 1, 0, 3))]
    there = int(np.ravel_multi_index((1, 3, 2, 3), second.shape))
    between = RobotState(one.x, one.y + second.spacing[1] / 4, one.v, one.heading)
    beside = 0.75 * matrix[there, nodes] + 0.25 * matrix[there + 1, nodes]
    in_games = jax.tree.map(lambda *leaves: jnp.stack(leaves), one, between)
    found = interpolate(
        table, (second, in_games), (first, jax.tree.map(lambda leaf: leaf[:, None].repeat(2, 1), others))
    )
    np.testing.assert_allclose(found, np.stack([matrix[there, nodes], beside], axis=1), atol=1e-5)


def test_a_grid_that_does_not_fit_is_refused_before_anything_is_computed(monkeypatch):
    monkeypatch.setattr(limits, "available_memory", lambda: 4096 * 1000)
    with pytest.raises(InvalidInput, match=r"grid = 5x7x3x6 needs .* GiB of memory and this machine has 0.0 GiB"):
        make_duel(zero_sum_game(SMALL, Role.PURSUER, MORE))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"payoff": "fun"}, "payoff = fun.*win, time"),
        ({"hold": 0}, "hold = 0.*at least 1"),
    ],
)
def test_what_is_no_zero_sum_game_is_refused(options, words):
    with pytest.raises(InvalidInput, match=words):
        zero_sum_game(SMALL, Role.PURSUER, FEW, **options)


def test_robots_must_share_their_places():
    grids = make_grid(SMALL.arena, BODY, (4, 3, 2, 5)), make_grid(SMALL.arena, Unicycle(), (3, 4, 2, 5))
    with pytest.raises(InvalidInput, match=r"as many nodes along x and y as 3x4x2x5"):
        make_duel(make_zero_sum_game(SMALL, grids, HOLD, Role.PURSUER, "win"))


RUNNER = Unicycle(v_max=1.2, u1_max=0.3, u2_max=0.0, radius=0.05)
LINE = Game(
    pursuer=RUNNER,
    evader=RUNNER,
    arena=Arena(x_max=6.0, y_max=0.6),
    capture_distance=0.31,
    starts=Starts(clearance=0.1),
)
"""A chase along a line: in a second each action leads from a place of 0.15 m and 0.3 m/s to another."""


@pytest.mark.parametrize("role", Role)
def test_on_a_lattice_no_side_is_promised_more_than_the_exact_value(role):
    """Nothing is interpolated there, so that the rules alone decide; a pursuer that would crash later has captured."""
    duel = make_duel(zero_sum_game(LINE, role, (41, 3, 5, 3), hold=10))
    table = as_matrix(guarantee(duel, solve_duel(duel, tolerance=1e-5).table))
    place, speed = np.meshgrid(np.arange(1, 40), np.arange(5), indexing="ij")
    node = np.ravel_multi_index((speed, 0 * place, place, 0 * place + 1), duel.first.grid.shape).ravel()
    state = (place * 5 + speed).ravel()
    exact = numpy_chase.values(pursuing=role == Role.PURSUER, horizon=HORIZON)[np.ix_(state, state)]
    found = table[np.ix_(node, node)]
    assert np.max(found - exact) < 1e-4
    assert np.mean(found > exact - 0.06) > 0.9  # a hold is lost at its beginning and won at its end
    assert 0.05 < np.mean(exact > 0) < 0.95
