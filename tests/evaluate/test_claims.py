"""Verdicts follow from intervals, and intervals from the games and seeds they stand for."""

import json

import numpy as np
import pytest

from apollonius.evaluate.claims import Claim, difference_claim, rate_claim
from apollonius.evaluate.statistics import mean_interval, rate_difference_interval, rate_interval, wilson_interval
from tests.documents import REPOSITORY


@pytest.mark.parametrize(
    ("wins", "verdict"), [(9_900, "holds"), (9_600, "undecided"), (9_000, "does not hold")], ids=str
)
def test_the_whole_interval_must_agree_before_there_is_a_verdict(wins, verdict):
    assert rate_claim("wins", "here", 0.96, 0.96, [(wins, 10_000)] * 3).verdict() == verdict


def test_one_seed_or_a_smaller_budget_is_not_enough_for_a_verdict():
    holding = rate_claim("wins", "here", 0.96, 0.96, [(9_900, 10_000)] * 3)
    assert holding.verdict() == "holds"
    assert holding.verdict(is_full=False) == "not enough"
    for seeds in (1, 2):
        assert rate_claim("wins", "here", 0.96, 0.96, [(9_900, 10_000)] * seeds).verdict() == "not enough"


@pytest.mark.parametrize(("failures", "verdict"), [(50, "holds"), (100, "undecided"), (300, "does not hold")])
def test_an_upper_bound_is_judged_the_other_way_round(failures, verdict):
    assert rate_claim("failures", "here", 0.07, 0.01, [(failures, 10_000)] * 3, at_most=True).verdict() == verdict


def test_one_seed_has_the_interval_of_its_games_and_several_that_of_their_mean():
    one = rate_claim("wins", "here", 0.5, 0.5, [(70, 100)])
    assert one.interval == wilson_interval(70, 100)
    three = rate_claim("wins", "here", 0.5, 0.5, counts := [(60, 100), (70, 100), (80, 100)])
    assert three.mean == pytest.approx(0.7)
    assert three.interval == rate_interval(counts)
    assert [value for value, _ in three.seeds] == [0.6, 0.7, 0.8]


def test_a_difference_of_rates_is_judged_as_such():
    claim = difference_claim("more", "here", 0.27, 0.1, [(0.7, 0.4)] * 3, 1000)
    assert claim.mean == pytest.approx(0.3)
    assert claim.verdict() == "holds"
    assert difference_claim("more", "here", 0.27, 0.1, [(0.4, 0.4)] * 3, 1000).verdict() == "does not hold"
    several = difference_claim("more", "here", 0.27, 0.1, rates := [(0.7, 0.4), (0.5, 0.4), (0.6, 0.4)], 1000)
    assert several.interval == rate_difference_interval(rates, 1000)
    assert several.verdict() == "undecided"


def test_a_claim_as_data_says_what_was_measured_and_what_follows():
    data = Claim("wins", "Table II", 0.93, 0.9, False, ((0.95, (0.94, 0.96)),) * 3, (0.94, 0.96)).to_dict()
    assert (data["mean"], data["interval"], data["verdict"]) == (pytest.approx(0.95), (0.94, 0.96), "holds")


@pytest.mark.parametrize("seeds", [3, 5])
def test_what_is_just_at_the_bound_is_seldom_said_to_hold(seeds):
    """In one study of forty: the whole two-sided interval of 95 % must lie above. Rates of seeds vary by 4 points."""
    generator = np.random.default_rng(0)
    rates = generator.normal(0.7, 0.04, size=(500, seeds))
    studies = generator.binomial(2000, rates)
    verdicts = [rate_claim("", "", 0.7, 0.7, [(int(wins), 2000) for wins in study]).verdict() for study in studies]
    assert verdicts.count("holds") <= 0.039 * len(studies)  # 0.025 and two standard errors of this share
    assert verdicts.count("does not hold") <= 0.039 * len(studies)


def test_seeds_that_agree_are_as_sure_as_their_games_and_no_surer():
    claim = rate_claim("failures", "here", 0.07, 0.01, [(0, 2000)] * 3, at_most=True)
    assert claim.interval == wilson_interval(0, 6000)
    assert claim.interval[1] > 0
    assert claim.verdict() == "holds"


GAMES = 10_000
"""Of each match of the table of a smaller budget."""


def rows_of_three_seeds():
    """Return the cells of that table, row by row."""
    tables = json.loads((REPOSITORY / "docs/results/tables/matches_and_training.json").read_text())["tables"]
    (table,) = [table for table in tables if table["section"] == "A smaller budget, three seeds"]
    return table["rows"]


@pytest.mark.parametrize("cells", [*rows_of_three_seeds()], ids=lambda cells: cells[0])
def test_intervals_in_the_documents_follow_from_the_seeds(cells):
    name, _, mean, interval, by_seed = cells
    values = [float(value) / 100 for value in by_seed.split(", ")]
    counts = [(round(value * GAMES), GAMES) for value in values]
    expected = mean_interval(values) if "minus" in name else rate_interval(counts)
    assert 100 * np.mean(values) == pytest.approx(float(mean), abs=0.1)
    assert [float(end) for end in interval.split(" to ")] == pytest.approx([100 * end for end in expected], abs=0.11)


PAPER = json.loads((REPOSITORY / "docs" / "results" / "paper.json").read_text())


@pytest.mark.parametrize("claim", PAPER["claims"], ids=lambda claim: claim["name"])
def test_the_claims_of_the_whole_budget_as_data_follow_from_their_seeds_and_are_in_the_table(claim):
    values, games = [value for value, _ in claim["seeds"]], PAPER["games"]
    assert len(values) == len(PAPER["seeds"]) == 3
    if "minus" in claim["name"]:
        expected = mean_interval(values)
    else:
        expected = rate_interval([(round(value * games), games) for value in values])
    assert claim["interval"] == pytest.approx(np.clip(expected, -1, 1), abs=1e-3)
    seeds = tuple((value, tuple(interval)) for value, interval in claim["seeds"])
    again = Claim(*(claim[name] for name in ("name", "source", "paper", "bound", "at_most")), seeds, expected)
    assert (again.mean, again.verdict()) == (pytest.approx(claim["mean"]), claim["verdict"])
    if claim["source"] != "beyond":
        low, high = (f"{100 * end:.1f}" for end in claim["interval"])
        told = f"| {100 * claim['mean']:.1f} | {low} to {high} | {', '.join(f'{100 * v:.1f}' for v in values)} |"
        text = (REPOSITORY / "docs" / "benchmarks" / "replication.md").read_text()
        (row,) = [line for line in text.splitlines() if line.startswith(f"| {claim['name']} | {claim['source']} |")]
        assert row.endswith(f"{told} {claim['verdict']} |")
