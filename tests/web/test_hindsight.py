"""From when a game was lost: the page's answer beside games that are played on in plain words of the rules."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from apollonius.arenas.record import to_dict
from apollonius.game.presets import make_game
from apollonius.web.site import PAGE

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
CHECK = Path(__file__).parent / "check_hindsight.mjs"
FARTHEST = 200
"""Steps of 0.1 s that it looks back at most."""


def looked_back(me, own, theirs, stands, count, **changes):
    """What the page says of the lost ones among some games, and from which states in doubt someone does better."""
    game = to_dict(make_game("paper")) | changes
    question = {"page": str(PAGE), "game": game, "me": me, "seed": 1, "count": count}
    question |= {"own": {"name": own}, "theirs": theirs, "stands": stands}
    done = subprocess.run(["node", CHECK], input=json.dumps(question), capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def agrees(lost):
    """What is found is a way, and from the next state on there is none; where none is found, near the end is none."""
    for game in lost:
        found, last = game["number"], game["last"]
        assert game["better"] == ([] if found is None else [found])
        assert game["seconds"] == pytest.approx((min(last, FARTHEST) if found is None else last - found) / 10)
        assert game["asked"] > 0


def test_the_last_way_out_of_an_evader():
    stands = [{"name": "flee"}, {"name": "flee", "hard": "told"}]
    answer = looked_back("evader", "forwards", {"name": "pure-pursuit"}, stands, 4)
    agrees(answer["lost"])
    assert any(game["number"] is not None for game in answer["lost"])
    assert answer["nobody"] == answer["byChance"] == []


def test_an_opponent_that_is_told_or_sees_late_is_so_when_games_are_played_on():
    for hard in ("told", "gentle"):
        theirs = {"name": "pure-pursuit", "hard": hard}
        agrees(looked_back("evader", "still", theirs, [{"name": "flee"}], 3)["lost"])


def test_the_last_chance_of_a_pursuer():
    """Who stands while the time runs out could have caught one that stands, until it was too late to get there."""
    stands = [{"name": "pure-pursuit"}]
    answer = looked_back("pursuer", "still", {"name": "still"}, stands, 4, max_steps=150)
    agrees(answer["lost"])
    found = [game["number"] for game in answer["lost"]]
    assert len(found) == 4
    assert None not in found
