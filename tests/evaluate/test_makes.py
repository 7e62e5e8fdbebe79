"""Robots of other makes: a match for each, that of the game's own robots as ever, and one compilation for all."""

import json
from dataclasses import replace

import pytest

from apollonius import playout
from apollonius.errors import InvalidInput
from apollonius.evaluate.makes import Make, make_of, play_makes, with_make
from apollonius.evaluate.match import Match, play_match
from apollonius.game import game as starts
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.presets import make_game
from apollonius.terminal import make_table

PAPER = replace(make_game("paper"), max_steps=150)
NAMES = BySide("pure-pursuit", "flee-aware")
GAMES = 100
SEED = 3


@pytest.fixture(scope="module")
def told():
    """How much was reported as done, of how much."""
    return []


@pytest.fixture(scope="module")
def table(told):
    ratios = (2.0, 0.5, 1.0), (2.0, 1.0)
    return play_makes(
        PAPER, NAMES, *ratios, (0.2, 0.0, 0.0), GAMES, SEED, report=lambda done, total: told.append((done, total))
    )


def test_every_make_is_played_once_in_ascending_order(table, told):
    assert (table.speed_ratios, table.turn_ratios, table.radii) == ((0.5, 1.0, 2.0), (1.0, 2.0), (0.0, 0.2))
    assert table.win_rates.shape == (2, 2, 3)
    assert told[-1] == (12 * GAMES, 12 * GAMES)
    assert told == sorted(told)
    for part in table.matches:
        for row in part:
            assert all(match.games == sum(match.outcomes.values()) == GAMES for match in row)
            assert all(low <= m.pursuer_win_rate <= high for m in row for low, high in [m.pursuer_win_interval])


def test_a_faster_pursuer_of_an_evader_that_minds_walls_catches_more(table):
    captured = [[match.outcomes["captured"] for match in row] for row in table.matches[0]]
    for row in captured:
        assert row[0] <= row[1] <= row[2]
        assert row[0] < row[2]


@pytest.mark.parametrize("name", ["pure-pursuit", pytest.param("shielded:pure-pursuit", marks=pytest.mark.slow)])
def test_the_games_own_robots_are_those_of_evaluate(name):
    names = BySide(name, "flee-aware")
    table = play_makes(PAPER, names, (1.0, 1.5), (1.0,), (0.0,), GAMES, SEED)
    match = Match.of_names("paper", *names, GAMES, SEED)
    assert table.own_match == table.matches[0][0][0] == play_match(replace(match, game=PAPER))
    assert table.matches[0][0][1] != table.own_match


def test_the_games_own_robots_are_played_where_no_make_is_theirs():
    game = replace(PAPER, pursuer=Unicycle(v_max=1.3, radius=0.1), evader=Unicycle(radius=0.2))
    table = play_makes(game, NAMES, (1.0,), (1.0,), (0.1,), GAMES, SEED)
    assert table.own == Make(1.3 / 1.2, 1.0, None)
    assert table.own_match == play_match(replace(Match.of_names("paper", *NAMES, GAMES, SEED), game=game))
    assert table.own_match != table.matches[0][0][0]


@pytest.mark.slow
def test_one_compilation_serves_all_makes_shields_too():
    names = BySide("shielded:pure-pursuit", "flee-aware")
    game = replace(PAPER, max_steps=20)
    play_makes(game, names, (1.5,), (1.0,), (0.0,), 5)
    compiled = playout._advance._cache_size(), starts._draw_block._cache_size()
    play_makes(game, names, (0.5, 1.0, 1.5), (0.5, 1.0, 2.0), (0.0, 0.1, 0.2), 5)
    assert (playout._advance._cache_size(), starts._draw_block._cache_size()) == compiled


def test_gaps_between_bodies_stay_and_so_does_all_that_is_not_varied():
    game = make_game("robot")
    other = with_make(game, Make(1.5, 0.5, 0.3))
    assert other.pursuer == replace(game.pursuer, v_max=1.5 * 1.2, u2_max=0.5 * 0.8, radius=0.3)
    assert other.evader == replace(game.evader, radius=0.3)
    assert other.capture_distance == pytest.approx(0.7)
    assert other.starts.separation == pytest.approx(1.2)
    assert with_make(game, make_of(game)) is game


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (Make(1.0, 1.0, 4.9), "radius 4.9 m: the arena leaves the pursuer no place to start"),
        (Make(1.0, 1.0, 2.0), r"radius 2 m: the arena leaves the robots no place to start"),
        (Make(1.0, 30.0, 0.0), r"turn ratio 30, .*pursuer\.u2_max = 24"),
        (Make(float("nan"), 1.0, 0.0), r"speed ratio nan, .*pursuer\.v_max = nan"),
        (Make(-1.0, 1.0, 0.0), r"pursuer\.v_min"),
    ],
    ids=str,
)
def test_robots_that_cannot_be_are_refused_by_their_make(make, named):
    with pytest.raises(InvalidInput, match=named):
        with_make(PAPER, make)


def test_bodies_that_overlap_before_a_capture_cannot_shrink_to_nothing():
    game = replace(make_game("robot"), capture_distance=0.3)
    with pytest.raises(InvalidInput, match=r"radius = 0.0 is not possible: it must be more than 0.05 m"):
        with_make(game, Make(1.0, 1.0, 0.0))


def test_what_is_missing_is_refused_before_anything_is_played():
    with pytest.raises(InvalidInput, match="radii = none"):
        play_makes(PAPER, NAMES, (1.0,), (1.0,), (), 1)
    with pytest.raises(InvalidInput, match=r"^no agent is called 'nobody'"):
        play_makes(PAPER, BySide("nobody", "flee"), (1.0,), (1.0,), (0.0,), 1)
    with pytest.raises(InvalidInput, match=r"evader\.u2_max = 0"):
        make_of(replace(PAPER, evader=Unicycle(u2_max=0.0)))


def test_the_table_is_readable_in_80_columns(table):
    lines = make_table(table).splitlines()
    assert max(map(len, lines)) <= 80
    assert [line for line in lines if line.startswith("radius")] == [
        "radius 0 m, caught within 0.3 m",
        "radius 0.2 m, caught within 0.7 m",
    ]
    rows = [line.split() for line in lines if line[:5].strip().replace(".", "").isdigit()]
    assert len(rows) == 13  # and the game's own robots
    assert [row[:2] for row in rows[:3]] == [["0.5", "1"], ["1", "1"], ["2", "1"]]
    match = table.matches[0][0][0]
    low, high = match.pursuer_win_interval
    shown = [f"{100 * match.pursuer_win_rate:.1f}", f"[{100 * low:.0f},", f"{100 * high:.0f}]"]
    assert rows[0][2:5] == shown
    assert rows[0][8] == f"{match.outcomes['captured']:.1f}"
    assert rows[1] == rows[-1]


def test_as_data_it_is_json_with_every_count(table):
    data = json.loads(json.dumps(table.to_dict()))
    assert data["own"]["speed_ratio"] == data["own"]["turn_ratio"] == 1
    assert data["own"]["outcomes"] == data["makes"][1]["outcomes"]
    makes = [(make["radius"], make["turn_ratio"], make["speed_ratio"]) for make in data["makes"]]
    assert makes == sorted(makes)
    assert data["makes"][-1]["capture_distance"] == pytest.approx(0.7)
    assert data["makes"][-1]["outcomes"] == table.matches[1][1][2].outcomes
