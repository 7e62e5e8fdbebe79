"""What is said of self-play comes from its first and its last look alone."""

from types import SimpleNamespace

from apollonius.evaluate.trend import self_play_trend


def look(env_steps, **outcomes):
    rest = {"captured": 0, "evader_hit_obstacle": 0, "evader_out_of_range": 0, "no_result": 0}
    return SimpleNamespace(env_steps=env_steps, outcomes=rest | outcomes)


FIRST = look(
    320_000, captured=48, evader_hit_obstacle=91, evader_out_of_range=235, no_result=26, pursuer_hit_obstacle=100
)
LAST = look(
    2_500_000, captured=31, evader_hit_obstacle=8, evader_out_of_range=56, no_result=353, pursuer_hit_obstacle=52
)


def test_early_wins_that_the_evader_gave_away_are_called_so():
    said = self_play_trend([FIRST, look(1_000_000, captured=500), LAST])
    assert "from 320,000 to 2,500,000 env steps: the pursuer's wins went from 75% to 19%" in said
    assert "captures from 10% to 6%" in said
    assert "the evader's own failures from 65% to 13%" in said
    assert "games without result from 5% to 71%" in said
    assert "the evader's own mistakes" in said


def test_other_courses_are_told_without_that_reason():
    assert "mistakes" not in self_play_trend([LAST, FIRST])
    assert "mistakes" not in self_play_trend(
        [look(1, captured=300, no_result=100), look(2, captured=100, no_result=300)]
    )


def test_one_look_is_no_course():
    assert self_play_trend([]) == ""
    assert self_play_trend([FIRST]) == ""
