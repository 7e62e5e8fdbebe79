"""Verdicts follow from intervals, and intervals from the games and seeds they stand for."""

import json

import numpy as np
import pytest

from apollonius.evaluate.claims import Claim
from apollonius.evaluate.statistics import mean_interval, predict
from apollonius.evaluate.suite_card import load_card
from tests.documents import REPOSITORY


@pytest.mark.parametrize(
    ("values", "is_full", "verdict"),
    [
        (((0.99,), (0.985,), (0.98,)), True, "holds"),
        (((0.97,), (0.96,), (0.95,)), True, "a draw among draws"),
        (((0.90,), (0.895,), (0.905,)), True, "does not hold"),
        (((0.99,), (0.985,), (0.98,)), False, "not enough"),
        (((0.99,), (0.985,)), True, "not enough"),
        (((0.9, 0.5, 0.99), (0.95, 0.4, 0.99), (0.92, 0.45, 0.99)), True, "a draw among draws"),
    ],
)
def test_the_whole_prediction_of_three_whole_trainings_must_agree(values, is_full, verdict):
    claim = Claim("rate", "here", 0.5, 0.96, values)
    assert claim.verdict(is_full) == claim.to_dict(is_full)["verdict"] == verdict


def test_a_claim_as_data_has_what_follows_from_its_values():
    claim = Claim("more", "here", 0.27, 0.1, ((0.3,), (0.1,), (0.2,)), least=-1.0)
    data, found = claim.to_dict(), predict(np.array(claim.values), -1.0, 1.0)
    assert data["mean"] == pytest.approx(0.2)
    assert (data["interval"], data["chance"]) == (found.interval, found.chance(0.1))


def rows_of_three_seeds():
    """Return the cells of that table, row by row."""
    tables = json.loads((REPOSITORY / "docs/results/tables/matches_and_training.json").read_text())["tables"]
    (table,) = [table for table in tables if table["section"] == "A smaller budget, three seeds"]
    return table["rows"]


@pytest.mark.parametrize("cells", [*rows_of_three_seeds()], ids=lambda cells: cells[0])
def test_intervals_in_the_documents_follow_from_the_seeds(cells):
    name, _, mean, interval, by_seed = cells
    values = [float(value) / 100 for value in by_seed.split(", ")]
    expected = mean_interval(values, -1.0 if "minus" in name else 0.0, 1.0)
    assert 100 * np.mean(values) == pytest.approx(float(mean), abs=0.1)
    assert [float(end) for end in interval.split(" to ")] == pytest.approx([100 * end for end in expected], abs=0.11)


PAPER = json.loads((REPOSITORY / "docs" / "results" / "paper.json").read_text())


@pytest.mark.parametrize("data", PAPER["claims"], ids=lambda claim: claim["name"])
def test_the_claims_of_the_whole_budget_as_data_follow_from_their_values_and_are_in_the_table(data):
    values = tuple(map(tuple, data["values"]))
    claim = Claim(*(data[name] for name in ("name", "source", "paper", "bound")), values, data["least"])
    assert len(claim.values) == len(PAPER["seeds"]) == 3
    again = json.loads(json.dumps(claim.to_dict()))
    assert again == data | {name: pytest.approx(data[name]) for name in ("mean", "interval", "chance")}
    low, high = (f"{100 * end:.1f}" for end in data["interval"])
    pairs = 100 * np.array(claim.values)
    found = f"{100 * data['mean']:.1f} | {pairs.min():.1f} to {pairs.max():.1f} | {low} to {high}"
    told = f"| {found} | {data['chance']:.0%} | {data['verdict']} |".replace("%", " %")
    text = (REPOSITORY / "docs" / "benchmarks" / "replication.md").read_text()
    (row,) = [line for line in text.splitlines() if line.startswith(f"| {claim.name} | {claim.source} |")]
    assert row.endswith(told)


@pytest.mark.slow
def test_the_cards_of_the_leaderboard_follow_from_their_games():
    for path in (REPOSITORY / "benchmarks" / "leaderboard").glob("*.json"):
        assert path.stat().st_size < 100_000
        load_card(path)
