"""The regret card: its numbers add up, and they tell a good player from a bad one."""

import json
from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.network import make_actor
from apollonius.agents.squashed import SquashedMean
from apollonius.agents.uniform import Uniform
from apollonius.evaluate.card import measure_card
from apollonius.evaluate.match import begin, play_match
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.solve.foresight import ResponsePolicy
from apollonius.solve.grid import make_grid
from apollonius.solve.joint import make_duel, solve_duel
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.response import make_response, solve_response
from apollonius.solve.zero_sum_game import make_zero_sum_game
from tests.matches import a_match
from tests.solve.small import BODY, SMALL

pytestmark = pytest.mark.slow

QUICK = replace(SMALL, max_steps=150)
GAMES = 60


def player(role, payoff="win"):
    grid = make_grid(QUICK.arena, BODY, (5, 6, 3, 6))
    zero_sum_game = make_zero_sum_game(QUICK, (grid, grid), 5, role, payoff)
    return SaddlePolicy(zero_sum_game, solve_duel(make_duel(zero_sum_game)).table)


def response_to(agent, table):
    game = table.zero_sum_game
    return ResponsePolicy(game, solve_response(make_response(game, agent)).table, agent)


@pytest.fixture(scope="module")
def tables():
    return player(Role.PURSUER), player(Role.EVADER)


@pytest.fixture(scope="module")
def card(tables):
    return measure_card(a_match(QUICK, tables[0], Uniform(), GAMES, seed=3), tables[1])


def test_its_scores_are_those_of_matches(card, tables):
    match = play_match(a_match(QUICK, tables[0], Uniform(), GAMES, seed=3))
    assert card.role == "evader"
    assert (card.agent.lost, card.agent.won) == (match.pursuer_win_rate, match.evader_win_rate)
    assert card.agent.lost_interval == match.pursuer_win_interval
    assert card.response is None


def test_the_gap_is_what_it_could_be_sure_of_more_than_it_gets(card, tables):
    starts, _ = begin(a_match(QUICK, tables[0], Uniform(), GAMES, seed=3))
    assert card.sure == pytest.approx(float(np.mean(np.asarray(tables[1].best_value(starts)))))
    assert card.at_most == pytest.approx(-float(np.mean(np.asarray(tables[0].best_value(starts)))))
    assert card.gap == pytest.approx(card.sure - card.agent.payoff, abs=1e-6)
    assert card.gap_interval[0] < card.gap < card.gap_interval[1]
    assert card.gap_interval[0] > 0.2, "a random evader is far from what the table can be sure of"
    worst = [game["gap"] for game in card.worst]
    assert worst == sorted(worst, reverse=True)
    assert worst[0] >= card.gap
    json.dumps(card.to_dict())


def test_a_response_to_a_still_evader_captures_it(tables):
    pursuer, evader = tables
    response = response_to(Still(), pursuer)
    still = measure_card(a_match(QUICK, pursuer, Still(), GAMES), evader, response, response_games=40)
    assert still.response is not None
    assert still.response.games == 40
    pair = (response, Still())
    assert still.response.lost == play_match(a_match(QUICK, *pair, 40, 0)).pursuer_win_rate > 0


@pytest.mark.parametrize("role", Role)
def test_agents_with_continuous_actions_have_cards_too(tables, role):
    """In play against a table, and against a response to what they do."""
    agent = SquashedMean(make_actor("encoded", 16, 2, jax.random.key(0)))
    own, other = tables if role == Role.PURSUER else tables[::-1]
    response = response_to(agent, other)
    asked = a_match(QUICK, *((agent, other) if role == Role.PURSUER else (other, agent)), GAMES)
    card, match = measure_card(asked, own, response, response_games=20), play_match(asked)
    lost = match.evader_win_rate if role == Role.PURSUER else match.pursuer_win_rate
    assert (card.role, card.agent.lost) == (role.name.lower(), lost)
    assert card.sure - card.agent.payoff == pytest.approx(card.gap, abs=1e-6)
    assert card.response is not None
    assert card.response.games == 20


def test_tables_that_do_not_go_together_are_refused(tables):
    with pytest.raises(InvalidInput, match="tables = of one side"):
        measure_card(a_match(QUICK, tables[0], tables[0], GAMES), tables[0])
    with pytest.raises(InvalidInput, match="tables = of two payoffs"):
        measure_card(a_match(QUICK, Uniform(), player(Role.EVADER, "time"), GAMES), tables[0])
