"""The regret card: its numbers add up, and they tell a good player from a bad one."""

import json
from dataclasses import asdict, replace

import jax
import numpy as np
import pytest

from apollonius.agents.classical import Uniform
from apollonius.agents.greedy import SquashedMean
from apollonius.agents.network import make_actor
from apollonius.evaluate.card import measure_card
from apollonius.evaluate.match import begin, play_match
from apollonius.game.types import Role
from apollonius.solve.grid import make_grid
from apollonius.solve.joint import make_duel, solve_duel
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.zero_sum_game import make_zero_sum_game
from tests.matches import a_match
from tests.solve.small import BODY, SMALL

pytestmark = pytest.mark.slow

QUICK = replace(SMALL, max_steps=150)
GAMES = 60


def player(role):
    grid = make_grid(QUICK.arena, BODY, (5, 6, 3, 6))
    zero_sum_game = make_zero_sum_game(QUICK, (grid, grid), 5, role)
    return SaddlePolicy(zero_sum_game, solve_duel(make_duel(zero_sum_game)).table)


@pytest.fixture(scope="module")
def tables():
    return player(Role.PURSUER), player(Role.EVADER)


@pytest.mark.parametrize("role", Role)
def test_its_numbers_are_those_of_the_match_and_the_tables(tables, role):
    """Of a random player, and of one with continuous actions."""
    own, other = tables if role == Role.PURSUER else tables[::-1]
    agent = Uniform() if role == Role.EVADER else SquashedMean(make_actor("encoded", 16, 2, jax.random.key(0)))
    asked = a_match(QUICK, *((agent, other) if role == Role.PURSUER else (other, agent)), GAMES, seed=3)
    card, match, starts = measure_card(asked, own, other), play_match(asked), begin(asked)[0]
    rates = (match.pursuer_win_rate, match.evader_win_rate)
    assert (card.role, card.games) == (role.name.lower(), GAMES)
    assert (card.won, card.lost) == (rates if role == Role.PURSUER else rates[::-1])
    assert card.lost_interval == (match.evader_win_interval if role == Role.PURSUER else match.pursuer_win_interval)
    assert card.promised == pytest.approx(float(np.mean(np.asarray(own.best_value(starts)))))
    assert card.at_most == pytest.approx(-float(np.mean(np.asarray(other.best_value(starts)))))
    assert card.gap == pytest.approx(card.promised - card.payoff, abs=1e-6)
    assert card.gap_interval[0] < card.gap < card.gap_interval[1]
    if role == Role.EVADER:
        assert card.gap_interval[0] > 0.2, "a random evader is far from what the table promises"
    worst = [game["gap"] for game in card.worst]
    assert worst == sorted(worst, reverse=True)
    assert worst[0] >= card.gap
    json.dumps(asdict(card))
