"""A pursuer that flanks goes round to the other side of an evader that a mate is nearer to."""

from pathlib import Path

import jax
import numpy as np
import pytest

from apollonius.agents.wrappers.flanking import flanking_view
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_teams
from apollonius.game.types import RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.view import look
from apollonius.web.site import choose_match
from tests.acting import identical, state_of

ROAD = find_game(str(Path(__file__).parents[2] / "examples/games/ring_road.toml"))
BLOCK = Polygon(((2.0, 2.0), (4.6, 2.0), (4.6, 4.6), (2.0, 4.6)))
PAIR = with_chart(in_teams(ROAD, 2, 1))
THREE = with_chart(in_teams(ROAD, 3, 1))
SHORT = with_chart(in_teams(Game(arena=Arena(0.0, 6.6, 0.0, 6.6, polygons=(BLOCK,))), 2, 1))
OUT = int(RobotStatus.HIT_OBSTACLE)
LEFT, RIGHT = 1.5, 12.5
"""The middles of the roads on the left and on the right of the block."""


def views_of(pursuers, evader, active=None, game=PAIR):
    """Return the view of the first pursuer, and the one in which it flanks."""
    statuses = [0] * len(pursuers) if active is None else [0 if flag else OUT for flag in active]
    state = state_of(pursuers, [evader], (statuses, [0]))
    view = look(game, state, Role.PURSUER)
    return view, jax.jit(flanking_view)(view)


def place_of(view):
    return float(view.opponent.state.x), float(view.opponent.state.y)


def test_pursuer_behind_its_mate_goes_the_other_way_round():
    view, flanking = views_of([(2.0, 1.5), (5.0, 1.5)], (9.0, 1.5, 1.0))
    assert place_of(flanking)[1] > 8, "beyond the block, not along the lower road"
    place = flanking.opponent.state

    def length_to_place(robot):
        return float(view.chart.shortest_path_length(robot.x, robot.y, place.x, place.y))

    by_evader = 7.0 + length_to_place(view.opponent.state)
    assert by_evader - length_to_place(view.own.state) > 2
    assert float(flanking.opponent.state.v) == 0
    assert identical(flanking.own.state, view.own.state)
    assert identical(flanking.mates[0].state, view.mates[0].state)


@pytest.mark.parametrize(
    ("pursuers", "why"),
    [
        ([(5.0, 1.5), (2.0, 1.5)], "it is the nearest"),
        ([(LEFT, 8.0), (11.0, 1.5)], "it is on the other side"),
    ],
)
def test_evader_stays_where_it_is(pursuers, why):
    evader = (7.0, 1.5, 1.0)
    view, flanking = views_of(pursuers, evader)
    assert identical(flanking.opponent.state, view.opponent.state), why


def test_mates_out_of_play_do_not_count():
    pursuers = [(2.0, 1.5), (5.0, 1.5)]
    view, flanking = views_of(pursuers, (9.0, 1.5), (True, False))
    assert identical(flanking.opponent.state, view.opponent.state)


def test_third_pursuer_stays_on_the_side_that_no_nearer_mate_is_on():
    evader = (9.0, 1.5, 1.0)
    view, flanking = views_of([(2.0, 1.5), (5.0, 1.5), (RIGHT, 5.0)], evader, game=THREE)
    assert identical(flanking.opponent.state, view.opponent.state), "one is on either side"
    view, flanking = views_of([(2.0, 1.5), (5.0, 1.5), (4.0, 2.0)], evader, game=THREE)
    assert place_of(flanking)[1] > 8


def test_place_is_on_the_way_round_until_it_is_near():
    """On its way it keeps its direction, whatever the others do meanwhile."""
    for own, mate, evader in (
        ((LEFT, 5.0), (7.0, 1.5), (11.0, 1.5)),
        ((LEFT, 9.0), (10.0, 1.5), (RIGHT, 2.5)),
        ((4.0, RIGHT), (12.0, 1.5), (RIGHT, 5.0)),
    ):
        _, flanking = views_of([own, mate], evader)
        target = np.array(place_of(flanking))
        assert target[1] > own[1] or target[0] > own[0] + 1, (own, target)


def test_short_loops_are_not_gone_round():
    pursuers, evader = [(1.2, 1.2), (2.4, 1.2)], (5.4, 1.2)
    view, flanking = views_of(pursuers, evader, game=SHORT)
    assert identical(flanking.opponent.state, view.opponent.state)


def test_flanking_prefix_finds_its_player_and_refuses_others():
    named = find_player("shielded:flanking:pursuer", Role.PURSUER, PAIR)
    assert named.name == "shielded:flanking:pursuer"
    for name, role, game, message in (
        ("flanking:evader", Role.EVADER, PAIR, "only pursuers"),
        ("flanking:pursuer", Role.PURSUER, with_chart(ROAD), "single pursuer"),
        ("flanking:intercept", Role.PURSUER, PAIR, "values the nine actions"),
        ("flanking:shielded:pursuer", Role.PURSUER, PAIR, "in this order, each once"),
    ):
        with pytest.raises(InvalidInput, match=message):
            find_player(name, role, game)


def test_page_refuses_it():
    with pytest.raises(InvalidInput, match="flanking:pursuer"):
        choose_match(Role.EVADER, "flanking:pursuer", "team-2v1", 0)
