"""The players of the two-robot game: what their tables promise, and what comes of it in play."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.chasing import PurePursuit
from apollonius.agents.classical import Still
from apollonius.agents.fleeing import FleeAware
from apollonius.agents.uniform import Uniform
from apollonius.evaluate.match import play_match
from apollonius.game.types import GameState, Role
from apollonius.solve.foresight import ResponsePolicy
from apollonius.solve.grid import make_grid
from apollonius.solve.joint import TOLERANCE, guarantee, make_duel, solve_duel
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.response import make_response, solve_response
from apollonius.solve.zero_sum_game import make_zero_sum_game
from tests.matches import a_match
from tests.solve.small import SMALL, as_matrix

pytestmark = pytest.mark.slow

HOLD = 10
GAME = replace(SMALL, max_steps=150)
GRID = make_grid(GAME.arena, GAME.pursuer, (7, 9, 3, 8))
"""In a hold a robot goes from one speed to the next, and turns by one heading."""
CHASER = PurePursuit.for_side(GAME, Role.PURSUER)


def zero_sum_game(role):
    return make_zero_sum_game(GAME, (GRID, GRID), HOLD, role, "win")


def saddle(role):
    """What a side is sure of before it moves, by its node and the other's, and the player that makes most of it."""
    duel = make_duel(zero_sum_game(role))
    table = solve_duel(duel).table
    return np.asarray(as_matrix(guarantee(duel, table))), SaddlePolicy(duel.zero_sum_game, table)


def response(role, opponent):
    """The same against a known opponent: before either moves."""
    table = solve_response(make_response(zero_sum_game(role), opponent)).table
    return np.asarray(as_matrix(table)).T, ResponsePolicy(zero_sum_game(role), table, opponent)


@pytest.fixture(scope="module")
def pursuer():
    return saddle(Role.PURSUER)


@pytest.fixture(scope="module")
def evader():
    return saddle(Role.EVADER)


@pytest.fixture(scope="module")
def catcher():
    return response(Role.PURSUER, Still())


@pytest.fixture(scope="module")
def runaway():
    return response(Role.EVADER, CHASER)


def match(pursuer, evader):
    return play_match(a_match(GAME, pursuer, evader, games=200, seed=0))


@pytest.mark.parametrize(("known", "unknown"), [("catcher", "pursuer"), ("runaway", "evader")])
def test_whoever_knows_the_opponent_gets_no_less_than_what_it_is_sure_of(known, unknown, request):
    best, sure = (request.getfixturevalue(name)[0] for name in (known, unknown))
    from_fixed_point = TOLERANCE / (1 - float(zero_sum_game(Role.PURSUER).motions[0].discount))
    assert np.min(best - sure) >= -from_fixed_point
    assert np.mean(best - sure) > 0.1


def test_at_nodes_the_response_promises_what_its_table_says(catcher):
    """Where the opponent stands still, a look ahead by the rules is one more sweep, but for turns taken as whole."""
    values, player = catcher
    everywhere = np.arange(GRID.size).reshape(GRID.shape)
    own, still = (np.random.default_rng(0).choice(nodes.ravel(), 300) for nodes in (everywhere, everywhere[0]))
    played = (values[own, still] > -0.99) & (values[own, still] < 0.999)
    own, still = own[played], still[played]

    def state(own, other):
        return GameState.of_two(GRID.node(*own), GRID.node(*other), jnp.zeros((), jnp.int32))

    pairs = (tuple(jnp.asarray(index) for index in np.unravel_index(nodes, GRID.shape)) for nodes in (own, still))
    promised = player.best_value(jax.vmap(state)(*pairs))
    np.testing.assert_allclose(promised, values[own, still], atol=0.01)


def test_the_saddle_pursuer_beats_a_random_evader(pursuer):
    played = match(pursuer[1], Uniform())
    assert played.pursuer_win_rate > played.evader_undefeated_rate + 0.5


def test_the_saddle_evader_outlives_the_classical_ones(evader):
    alive = match(CHASER, evader[1]).evader_undefeated_rate
    others = [match(CHASER, other).evader_undefeated_rate for other in (FleeAware.for_side(GAME, Role.EVADER), Still())]
    assert alive > max(others) + 0.1
