"""How sure a rate is: Wilson's interval against its formula and against what it promises."""

import math

import numpy as np
import pytest

from apollonius.evaluate.statistics import (
    mean_band,
    mean_interval,
    paired_difference_interval,
    predict,
    wilson_interval,
)

Z = 1.959963984540054
"""Half of the remaining 5 % of a normal distribution lies beyond this many standard deviations."""


@pytest.mark.parametrize(("successes", "trials"), [(0, 7), (1, 3), (9870, 10_000), (10, 10)])
def test_the_interval_is_wilsons_formula(successes, trials):
    rate = successes / trials
    centre = (rate + Z**2 / (2 * trials)) / (1 + Z**2 / trials)
    half = Z / (1 + Z**2 / trials) * math.sqrt(rate * (1 - rate) / trials + Z**2 / (4 * trials**2))
    assert wilson_interval(successes, trials) == pytest.approx((centre - half, centre + half), abs=1e-12)


@pytest.mark.parametrize(("successes", "trials"), [(5, 3), (-1, 10), (0, 0), (0, -1)])
def test_counts_that_cannot_be_are_refused(successes, trials):
    with pytest.raises(ValueError, match=r"\d"):
        wilson_interval(successes, trials)


def test_the_band_of_a_mean_is_students():
    low, high = mean_band(np.array([[1.0, 5.0], [2.0, 5.0], [3.0, 5.0]]))
    reach = 4.302653 / math.sqrt(3)  # of Student's t with 2 degrees of freedom; the standard deviation is 1
    np.testing.assert_allclose(low, [2 - reach, 5], rtol=1e-6)
    np.testing.assert_allclose(high, [2 + reach, 5], rtol=1e-6)
    assert mean_interval([1.0, 2.0, 3.0]) == pytest.approx((2 - reach, 2 + reach))
    assert mean_interval([1.0, 2.0, 3.0], 0.0, 3.0) == (0.0, 3.0)
    assert mean_interval([1.0], 0.0, 3.0) == (0.0, 3.0)


@pytest.mark.parametrize(("spread", "rest", "size"), [(0.1, 0.05, (3, 3)), (0.02, 0.2, (3, 5))])
def test_another_pair_is_within_its_prediction_as_often_as_it_says(spread, rest, size):
    """In 3,000 studies of rows and columns that add up, with a rest; 0.01 is two standard errors of the share."""
    generator, within = np.random.default_rng(1), []
    for _ in range(3000):
        rows, columns = (generator.normal(0, spread, one) for one in ((size[0] + 1, 1), (1, size[1] + 1)))
        values = rows + columns + generator.normal(0, rest, (len(rows), columns.size))
        low, high = predict(values[:-1, :-1], -9.0, 9.0).interval
        within.append(low <= values[-1, -1] <= high)
    assert np.mean(within) > 0.94


def test_a_prediction_without_columns_is_the_textbooks_and_its_chance_is_students():
    values = np.array([[0.6], [0.7], [0.8]])
    found = predict(values, 0.0, 1.0)
    reach = 4.302653 * 0.1 * math.sqrt(4 / 3)
    assert found.interval == pytest.approx((0.7 - reach, 1.0))
    assert found.chance(0.7) == pytest.approx(0.5)
    assert found.chance(0.7 - reach) == pytest.approx(0.975)
    same = predict(np.full((3, 1), 0.5), 0.0, 1.0)
    assert (same.interval, same.chance(0.5), same.chance(0.51)) == ((0.5, 0.5), 1.0, 0.0)


def test_one_training_of_a_side_says_nothing_of_another():
    found = predict(np.array([[0.6]]), -1.0, 1.0)
    assert (found.mean, found.interval, found.chance(0.5)) == (0.6, (-1.0, 1.0), None)


def test_a_lone_seed_has_no_band():
    with pytest.raises(ValueError, match="1 seeds"):
        mean_band(np.zeros((1, 4)))


def test_the_interval_of_a_paired_difference_is_bonett_and_prices_formula():
    """Of 30 pairs 7 differ in one way and 2 in the other; each counts as one more, of 32."""
    first, second = np.arange(30) < 7, np.isin(np.arange(30), (8, 9))
    reach = Z * math.sqrt((8 / 32 + 3 / 32 - (5 / 32) ** 2) / 32)
    assert paired_difference_interval(first, second) == pytest.approx((5 / 32 - reach, 5 / 32 + reach))
