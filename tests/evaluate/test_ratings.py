"""Elo ratings of two sides that never meet their own: known strengths come back, and intervals cover what they say."""

import numpy as np
import pytest
from scipy.special import expit

from apollonius.evaluate.ratings import MEAN, SCALE, rate


def test_four_hundred_points_ahead_wins_ten_games_of_eleven():
    assert expit(400 / SCALE) == pytest.approx(10 / 11)


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
