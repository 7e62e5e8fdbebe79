"""Agents of one run against each other: a row and a column for each moment, and sums of them."""

from dataclasses import replace
from types import SimpleNamespace

from apollonius.evaluate.tournament import Tournament
from studies.cross_play import CrossPlay
from tests.studies.matches import NO_MATCH


def test_rows_and_columns_are_summed_with_intervals_of_all_their_games(tmp_path):
    moments, rates = ("50 %", "100 %"), ((0.5, 0.3), (0.7, 0.1))
    rows = tuple(tuple(replace(NO_MATCH, games=100, pursuer_win_rate=rate) for rate in row) for row in rates)
    played = SimpleNamespace(tournament=lambda: Tournament(moments, moments, rows))
    study = type("Played", (CrossPlay,), {"matches": played})(out=tmp_path, run=tmp_path, games=100)
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in study.finding().text.splitlines()]
    assert lines[0] == ["pursuer \\ evader", "50 %", "100 %", "all"]
    assert [[cell.split(" [")[0] for cell in line] for line in lines[2:]] == [
        ["50 %", "50.0%", "30.0%", "40.0%"],
        ["100 %", "70.0%", "10.0%", "40.0%"],
        ["all", "60.0%", "20.0%", "40.0%"],
    ]
    assert lines[2][1] == "50.0% [40.4%, 59.6%]"
    assert lines[4][3] == "40.0% [35.3%, 44.9%]"
