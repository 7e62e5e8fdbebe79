"""Advice for an arena: who does best in it against the worst opponent, and where the pursuer stops."""

from dataclasses import replace

import numpy as np
import pytest

from apollonius.cli.terminal import advice_table
from apollonius.evaluate import advice
from apollonius.game.arena import Arena
from apollonius.game.presets import make_game

PANEL = {"full": {"pursuer": ("still", "intercept"), "evader": ("still", "flee")}}


@pytest.fixture(scope="module")
def advised():
    short = replace(make_game("paper"), arena=Arena(), max_steps=60)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(advice, "PANELS", PANEL)
        yield advice.advise(short, 16, seed=1)


def test_the_best_players_are_those_that_do_best_against_their_worst_opponent(advised):
    rates = advised.tournament.win_rates
    assert 0 < rates[1].min() < 1
    assert advised.best.pursuer == "intercept"
    assert advised.least.pursuer == rates[1].min()
    assert advised.least.evader == 1 - rates[:, ["still", "flee"].index(advised.best.evader)].max()
    assert advised.least.evader == (1 - rates.max(axis=0)).max()


def test_stops_are_where_the_best_pursuer_was_when_the_time_for_a_standing_evader_ran_out(advised):
    missed = round(16 * (1 - advised.tournament.win_rates[1, 0]))
    assert 0 < len(advised.stops) == min(missed, 8)
    assert np.all((np.array(advised.stops) > 0) & (np.array(advised.stops) < 10))


def test_the_table_names_players_rates_and_places(advised):
    text = advice_table(advised)
    x, y = advised.stops[0]
    for part in ("intercept, which wins", f"({x:g}, {y:g})", f"{advised.tournament.win_rates[1, 0]:.0%}"):
        assert part in text
