"""Teams of every size against one evader: the matches that anybody else would play, and who plays in which."""

from dataclasses import replace

import pytest

from apollonius.catalogue import find_player
from apollonius.errors import InvalidInput
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.team_sizes import Captures, matches_of_sizes, play_sizes
from apollonius.game.by_side import BySide
from apollonius.game.presets import in_teams, make_game
from apollonius.game.types import Role

PAPER = replace(make_game("paper"), max_steps=80)
GAMES = 40


@pytest.fixture(scope="module")
def told():
    """How much was reported as done, of how much."""
    return []


@pytest.fixture(scope="module")
def sizes(told):
    matches = matches_of_sizes(PAPER, ["pure-pursuit", "encirclement"], "flee", 2, GAMES, seed=5)
    return play_sizes("flee", matches, report=lambda done, total: told.append((done, total)))


def test_who_plays_beside_a_mate_only_begins_with_two(sizes):
    played = {name: [one.pursuers for one in team] for name, team in sizes.teams.items()}
    assert played == {"pure-pursuit": [1, 2], "encirclement": [2]}
    assert sizes.seconds == pytest.approx(8.0)


def test_they_are_the_matches_that_evaluate_plays(sizes):
    game = in_teams(PAPER, 2, 1)
    players = BySide(find_player("pure-pursuit", Role.PURSUER, game), find_player("flee", Role.EVADER, game))
    result = play_match(Match(game, players, GAMES, seed=5))
    assert result.robots is not None
    lost = result.robots.lost.pursuer / (2 * GAMES)
    assert sizes.teams["pure-pursuit"][1] == Captures(2, result.outcomes["captured"], GAMES, lost)
    assert 0 < lost < 1


def test_a_pursuer_alone_that_fails_is_counted(sizes):
    alone = sizes.teams["pure-pursuit"][0]
    assert alone.pursuers == 1
    assert 0 < alone.failures < 1


def test_what_is_done_is_told_over_all_matches(sizes, told):
    assert sizes.games == GAMES
    assert told[-1] == (3 * GAMES, 3 * GAMES)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_rates_have_intervals():
    captures = Captures(pursuers=2, captured=30, games=40, failures=0.0)
    assert captures.rate == 0.75
    assert captures.interval == pytest.approx((0.598, 0.858), abs=1e-3)


def test_all_of_it_is_told_as_data(sizes):
    data = sizes.to_dict()
    assert data["evader"] == "flee"
    first = data["teams"]["encirclement"][0]
    assert (first["pursuers"], first["capture_rate"]) == (2, sizes.teams["encirclement"][0].rate)


@pytest.mark.parametrize(
    ("teams", "most", "complaint"),
    [(["encirclement"], 1, "2 at least"), (["nobody"], 2, "nobody"), (["pure-pursuit"], 17, "from 1 to 16")],
)
def test_teams_that_cannot_be_are_refused(teams, most, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        matches_of_sizes(PAPER, teams, "flee", most, GAMES)


def test_a_game_of_teams_is_refused():
    with pytest.raises(InvalidInput, match="1 v 1"):
        matches_of_sizes(make_game("team-2v1"), ["pure-pursuit"], "flee", 2, GAMES)
