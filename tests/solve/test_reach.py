"""Reach: the least time to a target against brute force, against closed forms, and in play."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from apollonius.agents.classical import Still
from apollonius.agents.pool import solo
from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import GameState, Outcome, RobotState
from apollonius.io.errors import InvalidInput
from apollonius.play.playout import play_out
from apollonius.solve.grid import make_grid
from apollonius.solve.motion import HORIZON
from apollonius.solve.reach import solve_reach
from tests.oracle import numpy_solver as oracle
from tests.solve.small import BODY, SMALL, TINY, as_table

TARGET = (1.3, 3.1)
GRID, SMALL_GRID = (make_grid(SMALL.arena, BODY, counts) for counts in ((31, 41, 5, 31), TINY))
HOLD = 5


@pytest.fixture(scope="module")
def reach():
    return solve_reach(SMALL, GRID, HOLD, TARGET)[0]


@pytest.fixture(scope="module")
def starts():
    """Starts at rest, the target standing where it is solved for."""
    drawn = jax.jit(reset_batch, static_argnames="games")(SMALL, jax.random.key(0), games=1200)
    target = RobotState(*(jnp.float32(number) for number in (*TARGET, 0, 0)))
    states = jax.vmap(lambda state: GameState.of_two(state.pursuer, target, state.steps))(drawn)
    far = np.hypot(drawn.pursuer.x - TARGET[0], drawn.pursuer.y - TARGET[1]) > 0.5
    return jax.tree.map(lambda leaf: leaf[np.flatnonzero(far)[:1000]], states)


def test_the_table_is_that_of_brute_force():
    told = []
    reach, solved = solve_reach(SMALL, SMALL_GRID, HOLD, TARGET, told.append)
    assert len(told) == solved.sweeps
    assert solved.residual < 1e-4 < told[-2].residual
    expected = as_table(oracle.reach(SMALL, TINY, HOLD, solved.sweeps, TARGET, HORIZON), TINY)
    np.testing.assert_allclose(reach.table, expected, atol=1e-6)
    assert 0.1 < np.mean(expected > 0.5) < 0.95
    assert np.any(expected == 0)
    nodes = map(jnp.asarray, np.unravel_index(np.arange(SMALL_GRID.size), SMALL_GRID.shape))
    values = jax.jit(jax.vmap(reach.action_values))(jax.vmap(SMALL_GRID.node)(*nodes))
    known = np.ravel(reach.table)
    np.testing.assert_allclose(values.max(axis=1)[known > 0], known[known > 0], atol=1e-4)
    outside = RobotState(*(jnp.float32(number) for number in (2.95, 1.0, 0.6, 0.0)))
    assert math.isinf(float(reach.seconds(outside)))


@pytest.mark.slow
def test_the_table_captures_when_it_said_it_would(reach, starts):
    results = play_out(SMALL, BySide(solo(reach), solo(Still())), starts, jax.random.key(0))
    captured = np.asarray(results.outcome) == Outcome.CAPTURED
    assert np.mean(captured) >= 0.995
    predicted = np.asarray(jax.jit(jax.vmap(reach.seconds))(starts.pursuer))
    took = np.asarray(results.steps) * SMALL.dt
    assert abs(np.median(took[captured] / predicted[captured]) - 1) < 0.05
    assert np.quantile(np.abs(took[captured] / predicted[captured] - 1), 0.95) < 0.15


@pytest.mark.parametrize("target", [(0.7, 2.3), (3.0, 1.0)], ids=["in a disc", "beyond the walls"])
def test_a_target_that_cannot_stand_there_is_refused(target):
    with pytest.raises(InvalidInput, match=r"target = \("):
        solve_reach(SMALL, SMALL_GRID, HOLD, target)


def dubins_to_point(x, y, heading, radius, distance):
    """Length of the shortest forward path with bounded curvature to within a distance of the origin.

    A turn one way and then straight ahead (Bui, Boissonnat, Soueres, Laumond, "Shortest path synthesis for Dubins
    non-holonomic robot", 1994), for a target outside both turning circles, heading straight at it in the end.
    """
    lengths = []
    for side in (1, -1):
        centre = (x - side * radius * math.sin(heading), y + side * radius * math.cos(heading))

        def beside(turn, centre=centre, side=side):
            """How far to the left the target lies after turning so far, and how far ahead."""
            angle = heading + side * turn
            place = (centre[0] + side * radius * math.sin(angle), centre[1] - side * radius * math.cos(angle))
            left = place[0] * math.sin(angle) - place[1] * math.cos(angle)
            return left, -place[0] * math.cos(angle) - place[1] * math.sin(angle)

        turns = np.linspace(0, 2 * math.pi, 721)
        offsets = [beside(turn)[0] for turn in turns]
        for one, other, a, b in zip(turns, turns[1:], offsets, offsets[1:], strict=False):
            if a * b <= 0:
                turn = brentq(lambda angle: beside(angle)[0], one, other)
                ahead = beside(turn)[1]
                if ahead > distance:
                    lengths.append(radius * turn + ahead - distance)
    return min(lengths)


@pytest.mark.slow
def test_at_constant_speed_the_least_time_is_that_of_dubins_paths():
    """A robot that neither brakes nor speeds up, in an arena without obstacles: within 1 % in the median."""
    body = Unicycle(v_min=0.999, v_max=1.0, u1_max=0.0, u2_max=2.0)
    game = Game(pursuer=body, evader=Unicycle(), arena=Arena(x_max=8.0, y_max=8.0), dt=0.02)
    reach, _ = solve_reach(game, make_grid(game.arena, body, (101, 101, 2, 63)), 10, (4.0, 4.0))
    rng = np.random.default_rng(0)
    angle, far, heading = rng.uniform(-np.pi, np.pi, 200), rng.uniform(1.5, 2.75, 200), rng.uniform(-np.pi, np.pi, 200)
    x, y = far * np.cos(angle), far * np.sin(angle)
    expected = np.array([dubins_to_point(*robot, 0.5, 0.3) for robot in zip(x, y, heading, strict=True)])
    rows = jnp.asarray(np.stack([x + 4, y + 4, np.ones(200), heading], axis=1), jnp.float32)
    found = np.asarray(jax.jit(jax.vmap(lambda row: reach.seconds(RobotState(*row))))(rows))
    error = found / (np.ceil(expected / game.dt) * game.dt) - 1
    assert abs(np.median(error)) < 0.01
    assert np.quantile(np.abs(error), 0.9) < 0.04
