"""Verdicts follow from intervals, and intervals from the games and seeds they stand for."""

import pytest

from apollonius.evaluate.statistics import difference_interval, seeds_interval, wilson_interval
from apollonius.experiments.claims import Claim, difference_claim, rate_claim


@pytest.mark.parametrize(
    ("wins", "verdict"), [(9_900, "holds"), (9_600, "undecided"), (9_000, "does not hold")], ids=str
)
def test_the_whole_interval_must_agree_before_there_is_a_verdict(wins, verdict):
    assert rate_claim("wins", "here", 0.96, 0.96, [(wins, 10_000)]).verdict == verdict


@pytest.mark.parametrize(("failures", "verdict"), [(50, "holds"), (100, "undecided"), (300, "does not hold")])
def test_an_upper_bound_is_judged_the_other_way_round(failures, verdict):
    assert rate_claim("failures", "here", 0.07, 0.01, [(failures, 10_000)], at_most=True).verdict == verdict


def test_one_seed_has_the_interval_of_its_games_and_several_that_of_their_mean():
    one = rate_claim("wins", "here", 0.5, 0.5, [(70, 100)])
    assert one.interval == wilson_interval(70, 100)
    three = rate_claim("wins", "here", 0.5, 0.5, [(60, 100), (70, 100), (80, 100)])
    assert three.mean == pytest.approx(0.7)
    assert three.interval == seeds_interval([0.6, 0.7, 0.8])
    assert [value for value, _ in three.seeds] == [0.6, 0.7, 0.8]


def test_a_difference_of_rates_is_judged_as_such():
    claim = difference_claim("more", "here", 0.27, 0.1, [(0.7, 0.4)], 1000)
    assert claim.mean == pytest.approx(0.3)
    assert claim.verdict == "holds"
    assert difference_claim("more", "here", 0.27, 0.1, [(0.4, 0.4)], 1000).verdict == "does not hold"


def test_a_claim_as_data_says_what_was_measured_and_what_follows():
    data = Claim("wins", "Table II", 0.93, 0.9, False, ((0.95, (0.94, 0.96)),)).to_dict()
    assert (data["mean"], data["interval"], data["verdict"]) == (0.95, (0.94, 0.96), "holds")


@pytest.mark.parametrize(
    ("first", "second", "trials", "interval"),
    [(0.9, 0.3, 10, (0.1705, 0.8090)), (1.0, 0.0, 10, (0.6075, 1.0))],
    ids=str,
)
def test_the_interval_of_a_difference_is_newcombes(first, second, trials, interval):
    """Table II of his paper, method 10."""
    assert difference_interval(first, second, trials) == pytest.approx(interval, abs=1e-4)


def test_the_interval_over_seeds_lies_within_them_around_their_mean_and_is_always_the_same():
    values = [0.91, 0.95, 0.93, 0.97]
    low, high = seeds_interval(values)
    assert 0.91 <= low < 0.94 < high <= 0.97
    assert (low, high) == seeds_interval(values)
