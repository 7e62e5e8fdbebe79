"""How sure a rate is: Wilson's interval against its formula and against what it promises."""

import math

import numpy as np
import pytest

from apollonius.evaluate.statistics import (
    mean_band,
    mean_interval,
    paired_difference_interval,
    rate_interval,
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


@pytest.mark.parametrize(("mean", "spread", "seeds"), [(0.7, 0.04, 3), (0.7, 0.0, 5), (0.02, 0.005, 3)])
def test_the_interval_of_a_rate_over_seeds_holds_it_at_least_as_often_as_it_says(mean, spread, seeds):
    """Where seeds do not differ it is that of their games, or Student's, whichever reaches further."""
    generator = np.random.default_rng(2)
    studies = generator.binomial(2000, np.clip(generator.normal(mean, spread, size=(1000, seeds)), 0, 1))
    covered = []
    for study in studies:
        low, high = rate_interval([(int(times), 2000) for times in study])
        assert 0 <= low <= study.mean() / 2000 <= high <= 1
        covered.append(low <= mean <= high)
    assert np.mean(covered) > 0.937  # 0.95 less two standard errors of this mean


def test_the_interval_of_a_rate_is_students_where_seeds_differ_and_wilsons_where_they_agree():
    counts = [(600, 1000), (700, 1000), (800, 1000)]
    assert rate_interval(counts) == pytest.approx(mean_interval([0.6, 0.7, 0.8]))
    assert rate_interval([(700, 1000)] * 3) == wilson_interval(2100, 3000)
    assert rate_interval([(0, 2000)] * 3) == wilson_interval(0, 6000)
    assert rate_interval(counts[:1]) == wilson_interval(600, 1000)
    assert rate_interval([(0, 10), (10, 10)]) == (0, 1)


def test_a_lone_seed_has_no_band():
    with pytest.raises(ValueError, match="1 seeds"):
        mean_band(np.zeros((1, 4)))


@pytest.mark.parametrize(("both", "first", "second"), [(0.3, 0.1, 0.05), (0.0, 0.02, 0.02), (0.5, 0.0, 0.3)])
def test_the_interval_of_a_paired_difference_holds_it_as_often_as_it_says(both, first, second):
    """Of rates that something happened in both of a pair, in the first alone, in the second alone."""
    trials, generator, covered = 200, np.random.default_rng(0), []
    kinds = generator.choice(4, size=(2000, trials), p=[both, first, second, 1 - both - first - second])
    for kind in kinds:
        low, high = paired_difference_interval((kind == 0) | (kind == 1), (kind == 0) | (kind == 2))
        covered.append(low <= first - second <= high)
    assert 0.94 <= np.mean(covered) <= 0.99


def test_the_interval_of_a_paired_difference_is_bonett_and_prices_formula():
    """Of 30 pairs 7 differ in one way and 2 in the other; each counts as one more, of 32."""
    first, second = np.arange(30) < 7, np.isin(np.arange(30), (8, 9))
    reach = Z * math.sqrt((8 / 32 + 3 / 32 - (5 / 32) ** 2) / 32)
    assert paired_difference_interval(first, second) == pytest.approx((5 / 32 - reach, 5 / 32 + reach))
