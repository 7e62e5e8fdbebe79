"""Verdicts follow from intervals, and intervals from the games and seeds they stand for."""

import json

import numpy as np
import pytest

from apollonius.evaluate.claims import Claim, difference_claim, rate_claim
from apollonius.evaluate.statistics import mean_interval, rate_interval, wilson_interval
from apollonius.evaluate.suite_card import load_card
from tests.documents import REPOSITORY


@pytest.mark.parametrize(
    ("times", "seeds", "is_full", "verdict"),
    [
        (9_900, 3, True, "holds"),
        (9_600, 3, True, "undecided"),
        (9_000, 3, True, "does not hold"),
        (9_900, 3, False, "not enough"),
        (9_900, 2, True, "not enough"),
    ],
)
def test_the_whole_interval_of_three_whole_trainings_must_agree(times, seeds, is_full, verdict):
    claim = rate_claim("rate", "here", 0.5, 0.96, [(times, 10_000)] * seeds)
    assert claim.verdict(is_full) == claim.to_dict(is_full)["verdict"] == verdict


def test_one_seed_has_the_interval_of_its_games_and_several_that_of_their_mean():
    one = rate_claim("wins", "here", 0.5, 0.5, [(70, 100)])
    assert one.interval == wilson_interval(70, 100)
    three = rate_claim("wins", "here", 0.5, 0.5, counts := [(60, 100), (70, 100), (80, 100)])
    assert three.mean == pytest.approx(0.7)
    assert three.interval == rate_interval(counts)
    assert three.seeds == (0.6, 0.7, 0.8)


def test_a_difference_of_rates_is_judged_as_such():
    rates = [(0.7, 0.4), (0.5, 0.4), (0.6, 0.4)]
    claim = difference_claim("more", "here", 0.27, 0.1, rates)
    assert claim.mean == pytest.approx(0.2)
    assert claim.interval == mean_interval(claim.seeds)
    assert claim.verdict() == "undecided"


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


@pytest.mark.parametrize(
    "claim", [claim for claim in PAPER["claims"] if claim["source"] != "beyond"], ids=lambda claim: claim["name"]
)
def test_the_claims_of_the_whole_budget_as_data_follow_from_their_seeds_and_are_in_the_table(claim):
    values, games = tuple(value for value, _ in claim["seeds"]), PAPER["games"]
    assert len(values) == len(PAPER["seeds"]) == 3
    if "minus" in claim["name"]:
        expected = mean_interval(values, -1.0, 1.0)
    else:
        expected = rate_interval([(round(value * games), games) for value in values])
    assert claim["interval"] == pytest.approx(expected, abs=1e-3)
    again = Claim(*(claim[name] for name in ("name", "source", "paper", "bound")), values, expected)
    assert (again.mean, again.verdict()) == (pytest.approx(claim["mean"]), claim["verdict"])
    low, high = (f"{100 * end:.1f}" for end in claim["interval"])
    told = f"| {100 * claim['mean']:.1f} | {low} to {high} | {', '.join(f'{100 * v:.1f}' for v in values)} |"
    text = (REPOSITORY / "docs" / "benchmarks" / "replication.md").read_text()
    (row,) = [line for line in text.splitlines() if line.startswith(f"| {claim['name']} | {claim['source']} |")]
    assert row.endswith(f"{told} {claim['verdict']} |")


@pytest.mark.slow
def test_the_cards_of_the_leaderboard_follow_from_their_games():
    for path in (REPOSITORY / "benchmarks" / "leaderboard").glob("*.json"):
        assert path.stat().st_size < 100_000
        load_card(path)
