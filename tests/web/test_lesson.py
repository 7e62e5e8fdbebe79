"""The pursuers of "Watch it learn" have learned step by step, and the curve says what they do."""

from dataclasses import replace
from itertools import pairwise

import pytest

from apollonius.evaluate.match import Match, play_match
from apollonius.io.document import parse_json
from apollonius.web.site import LEARNERS, LEARNING
from website.learners import BLUES, GAMES, PUPILS, training_game

RECORD = parse_json(LEARNING.read_bytes(), str(LEARNING))
STARTS = 200


def catch_share(pupil, **changes):
    """The share of standing blues that one of them catches, from the same fixed starts as all others."""
    path = LEARNERS / f"{pupil['name']}.safetensors"
    match = Match.of_names(
        replace(training_game(), **changes), str(path) if path.exists() else pupil["name"], "still", STARTS, 7
    )
    outcomes = play_match(match).outcomes
    return outcomes["captured"] / STARTS, outcomes


@pytest.mark.slow
def test_later_pursuers_catch_more_from_the_same_starts():
    shares, outcomes = zip(*map(catch_share, RECORD["pupils"]), strict=True)
    assert list(shares[1:]) == sorted(shares[1:])
    assert all(later - earlier > 0.05 for earlier, later in pairwise(shares[1:]))
    assert shares[0] < 0.1
    assert shares[-1] > 0.95
    beginner, hesitant = outcomes[:2]
    crashed = beginner["pursuer_out_of_range"] + beginner["pursuer_hit_obstacle"]
    assert crashed > 0.5 * STARTS, "who has learned nothing drives on and crashes"
    assert hesitant["no_result"] > 0.8 * STARTS, "then it dares nothing"
    for share, pupil in zip(shares, RECORD["pupils"], strict=True):
        assert share == pytest.approx(pupil["still"], abs=0.1)


def test_learning_curve_includes_the_shown_pursuers():
    steps = [point["env_steps"] for point in RECORD["curve"]]
    assert steps == sorted(set(steps))
    shown = [pupil for pupil in RECORD["pupils"] if pupil["env_steps"] is not None]
    assert [pupil["name"] for pupil in shown] == [f"learner-{share}" for share in PUPILS.values()]
    for one in shown:
        assert {name: one[name] for name in ("env_steps", *BLUES)} in RECORD["curve"]
    assert RECORD["games"] == GAMES
    assert RECORD["seconds"] * 10 == training_game().max_steps
