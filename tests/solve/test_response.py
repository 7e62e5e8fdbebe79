"""Who knows the other's every action: its table against brute force, and what the players that use it promise."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.chasing import PurePursuit
from apollonius.agents.classical import Still
from apollonius.agents.fleeing import FleeAware
from apollonius.agents.uniform import Uniform
from apollonius.game.types import GameState, RobotState, Role
from apollonius.observe.view import look
from apollonius.solve.foresight import COURSES, ResponsePolicy
from apollonius.solve.grid import lanes_of, make_grid
from apollonius.solve.joint import make_duel, solve_duel
from apollonius.solve.motion import HORIZON
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.response import make_response, solve_response
from apollonius.solve.zero_sum_game import make_zero_sum_game
from tests.oracle import numpy_duel as oracle
from tests.solve.small import CRAMPED, FEW, HOLD, as_matrix

GRID = make_grid(CRAMPED.arena, CRAMPED.pursuer, FEW)
CHASER = PurePursuit.for_side(CRAMPED, Role.PURSUER)


def zero_sum_game(role):
    return make_zero_sum_game(CRAMPED, (GRID, GRID), HOLD, role, "win")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("role", "opponent", "draws"),
    [
        (Role.PURSUER, FleeAware.for_side(CRAMPED, Role.EVADER), 1),
        (Role.EVADER, CHASER, 1),
        (Role.PURSUER, Uniform(), COURSES),
        (Role.EVADER, Uniform(), COURSES),
    ],
    ids=["pursuer", "evader", "pursuer, by chance", "evader, by chance"],
)
def test_the_table_is_that_of_brute_force(robot, captures, role, opponent, draws):
    response = make_response(zero_sum_game(role), opponent)
    answers = np.asarray(response.answers).astype(int)
    assert answers.shape == (GRID.size, GRID.size, draws)
    assert len(np.unique(answers)) >= 3
    found = solve_response(response, tolerance=1e-5)
    pursuing, stakes = role == Role.PURSUER, (response.zero_sum_game.win, response.zero_sum_game.lose)
    steps = captures if pursuing else captures.transpose(1, 0, 3, 2)
    expected = oracle.response(CRAMPED, robot, robot, pursuing, steps, answers, found.sweeps, HORIZON, *stakes, HOLD)
    np.testing.assert_allclose(as_matrix(found.table).T, expected, atol=1e-5)
    assert np.ptp(expected) > 0.9
    assert len(np.unique(np.round(expected, 3))) > 20


def test_whoever_acts_by_chance_is_drawn_evenly():
    answers = np.asarray(make_response(zero_sum_game(Role.PURSUER), Uniform()).answers)
    np.testing.assert_allclose(np.bincount(answers.ravel(), minlength=9) / answers.size, 1 / 9, atol=0.01)


def quiet_pairs(robot, captures, still):
    """Pairs of nodes from which no action ends the game within a hold; of another one at rest if it stands still."""
    rests = np.array([robot.states[index][2] == 0 for index in robot.order])
    free = robot.free.all(axis=1)
    apart = ~np.isfinite(captures).any(axis=(2, 3))
    own, other = np.nonzero(apart & free[:, None] & (free & (rests | (not still)))[None])
    assert len(own) > 50
    return own, other


def states(own, other):
    """Pairs of nodes as states, from the first one's side."""

    def state(first, second):
        return GameState.of_two(GRID.node(*first), GRID.node(*second), jnp.zeros((), jnp.int32))

    pairs = (tuple(map(jnp.asarray, np.unravel_index(nodes, GRID.shape))) for nodes in (own, other))
    return jax.vmap(state)(*pairs)


def test_before_a_standing_evader_a_look_ahead_is_one_more_sweep(robot, captures):
    response = make_response(zero_sum_game(Role.PURSUER), Still())
    found = solve_response(response, tolerance=1e-5)
    answers = np.asarray(response.answers).astype(int)
    stakes = (response.zero_sum_game.win, response.zero_sum_game.lose)
    expected = oracle.response(CRAMPED, robot, robot, True, captures, answers, found.sweeps + 1, HORIZON, *stakes, HOLD)
    own, other = quiet_pairs(robot, captures, still=True)
    promised = ResponsePolicy(response.zero_sum_game, found.table, Still()).best_value(states(own, other))
    np.testing.assert_allclose(promised, expected[own, other], atol=1e-5)


@pytest.mark.parametrize(("ahead", "steps"), [(0.3, 1), (0.9, 2)])
def test_a_capture_in_passing_counts_in_its_own_step(ahead, steps):
    """At 0.6 m/s in steps of a second the pursuer passes through the evader, and is past it at the step's end."""
    game = replace(CRAMPED, dt=1.0, capture_distance=0.05)
    zero_sum_game = make_zero_sum_game(game, (GRID, GRID), 2, Role.PURSUER, "win")
    lanes = lanes_of(GRID)
    nothing = jnp.zeros((GRID.size // lanes, GRID.size, lanes), jnp.float32)
    own, other = (
        RobotState(*map(jnp.float32, place)) for place in ((0.2, 0.6, 0.6, 0.0), (0.2 + ahead, 0.6, 0.0, 0.0))
    )
    view = look(game, GameState.of_two(own, other, jnp.zeros((), jnp.int32)), Role.PURSUER)
    straight_on = ResponsePolicy(zero_sum_game, nothing, Still()).values(view)[4]
    assert float(straight_on) == pytest.approx(zero_sum_game.win * np.exp(-steps / HORIZON), abs=1e-6)


@pytest.mark.slow
def test_where_nothing_ends_a_saddle_player_is_sure_of_what_one_more_sweep_says(robot, captures):
    duel = make_duel(zero_sum_game(Role.PURSUER))
    found = solve_duel(duel, tolerance=1e-5)
    stakes = (duel.zero_sum_game.win, duel.zero_sum_game.lose)
    expected, _ = oracle.guarantee(CRAMPED, robot, robot, True, captures, found.sweeps + 1, HORIZON, *stakes, HOLD)
    own, other = quiet_pairs(robot, captures, still=False)
    promised = SaddlePolicy(duel.zero_sum_game, found.table).best_value(states(own, other))
    np.testing.assert_allclose(promised, expected[own, other], atol=1e-5)
