"""Elo ratings of two sides that never meet their own: known strengths come back, and intervals cover what they say."""

import numpy as np
import pytest
from scipy.special import expit

from apollonius.evaluate.ratings import MEAN, SCALE, equilibrium, rate

ROCK_PAPER_SCISSORS = [[0, -1, 1], [1, 0, -1], [-1, 1, 0]]


def gain_by_leaving(payoff, mixed):
    """What both sides together could gain by answering the other's mixture with their best option: 0 in equilibrium."""
    return float(np.max(payoff @ mixed.columns) - np.min(mixed.rows @ payoff))


def random_games(count, most=12):
    rng = np.random.default_rng(0)
    return [rng.uniform(size=rng.integers(2, most, 2)) for _ in range(count)]


@pytest.mark.parametrize(
    ("payoff", "rows", "columns", "value"),
    [
        (ROCK_PAPER_SCISSORS, [1 / 3] * 3, [1 / 3] * 3, 0),
        ([[0.9, 0.6], [0.5, 0.4]], [1, 0], [0, 1], 0.6),  # a saddle
        ([[3, -1], [-2, 1]], [3 / 7, 4 / 7], [2 / 7, 5 / 7], 1 / 7),
        ([[0.2, 0.7, 0.4]], [1], [1, 0, 0], 0.2),
        ([[5.0]], [1], [1], 5),
    ],
)
def test_the_equilibrium_of_small_games_is_the_one_known(payoff, rows, columns, value):
    found = equilibrium(np.array(payoff, float))
    np.testing.assert_allclose(found.rows, rows, atol=1e-6)
    np.testing.assert_allclose(found.columns, columns, atol=1e-6)
    assert found.value == pytest.approx(value, abs=1e-8)


def test_from_the_equilibrium_nobody_gains_by_leaving():
    for payoff in random_games(20):
        found = equilibrium(payoff)
        assert gain_by_leaving(payoff, found) < 1e-8
        assert found.rows.min() >= 0
        assert (found.rows.sum(), found.columns.sum()) == pytest.approx((1, 1))


def test_copies_share_their_weight_evenly_in_the_equilibrium():
    """Paper twice: the linear programme may leave one of them out."""
    payoff = np.array(ROCK_PAPER_SCISSORS, float)[[0, 1, 1, 2]]
    found = equilibrium(payoff)
    np.testing.assert_allclose(found.rows, [1 / 3, 1 / 6, 1 / 6, 1 / 3], atol=1e-5)


def test_the_broadest_equilibrium_is_that_of_opens_spiels_nash_averaging():
    """It scales every column to [0, 1] first. Some rows and columns come twice."""
    pytest.importorskip("cvxpy")
    averaging = pytest.importorskip("open_spiel.python.algorithms.nash_averaging")
    for payoff in random_games(10, most=8):
        payoff = np.concatenate([payoff, payoff[:1]])
        payoff = (payoff - payoff.min(axis=0)) / (payoff.max(axis=0) - payoff.min(axis=0))
        mixed, _ = averaging.nash_averaging_avt_matrix(payoff)
        found = equilibrium(payoff)
        for ours, theirs in zip((found.rows, found.columns), mixed, strict=True):
            np.testing.assert_allclose(ours, np.ravel(theirs), atol=1e-3)


def test_a_game_that_nobody_can_influence_is_played_evenly():
    found = equilibrium(np.full((3, 4), 0.5))
    np.testing.assert_allclose(found.rows, 1 / 3, atol=1e-6)
    np.testing.assert_allclose(found.columns, 1 / 4, atol=1e-6)
    found = equilibrium(np.array([[1.0, 1, 1], [1, 1, 1], [0, 0, 0]]))
    np.testing.assert_allclose(found.rows, [1 / 2, 1 / 2, 0], atol=1e-6)


def test_one_match_is_rated_by_its_odds():
    """With half a win added to either side: 75.5 of 101 games."""
    ratings = rate(np.array([[75.0]]), 100)
    assert ratings.pursuers[0] - ratings.evaders[0] == pytest.approx(SCALE * np.log(75.5 / 25.5), abs=1e-3)
    assert ratings.pursuers[0] + ratings.evaders[0] == pytest.approx(2 * MEAN)
    # Wald's interval of the log-odds; either player has half of the difference.
    assert 2 * ratings.pursuer_reach[0] == pytest.approx(1.96 * SCALE * np.sqrt(1 / 75.5 + 1 / 25.5), rel=1e-3)


def test_known_strengths_are_found_and_intervals_cover_them():
    rng = np.random.default_rng(0)
    pursuers, evaders = rng.normal(size=6), rng.normal(size=5)
    mean = np.concatenate([pursuers, evaders]).mean()
    chance = expit(pursuers[:, None] - evaders[None, :])
    covered = []
    for _ in range(60):
        ratings = rate(rng.binomial(200, chance).astype(float), 200)
        for found, reach, true in (
            (ratings.pursuers, ratings.pursuer_reach, pursuers),
            (ratings.evaders, ratings.evader_reach, evaders),
        ):
            covered.extend(np.abs(found - MEAN - SCALE * (true - mean)) < reach)
        assert ratings.misfit < 0.05
    assert 0.92 < np.mean(covered) < 0.98


def test_who_wins_or_loses_every_game_has_a_rating():
    ratings = rate(np.array([[50.0, 50.0], [0.0, 25.0]]), 50)
    assert np.isfinite([*ratings.pursuers, *ratings.evaders, *ratings.pursuer_reach]).all()
    assert ratings.pursuers[0] > ratings.pursuers[1]


def test_no_rating_tells_who_beats_each_other_in_a_circle():
    circle = rate(np.array([[90.0, 10.0], [10.0, 90.0]]), 100)
    np.testing.assert_allclose([*circle.pursuers, *circle.evaders], MEAN, atol=1e-3)
    assert circle.misfit == pytest.approx(0.4, abs=0.01)
