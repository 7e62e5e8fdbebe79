"""Who is judged against whom."""

import jax

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.evaluate.pairings import last_agents, pairings, self_play_trend
from apollonius.game.types import Role


def test_every_pursuer_meets_random_and_every_evader_but_stage_1s_one_that_stays(tmp_path):
    """Whatever they are called: their files say which side they play."""
    sides = {"foe": Role.EVADER, "chaser": Role.PURSUER, "P_stage1": Role.PURSUER}
    for name, role in sides.items():
        agent = describe(make_network("paper", 4, 1, jax.random.key(0)), role, {}, {})
        save_agent(agent, tmp_path / f"{name}.safetensors")
    assert pairings({name: tmp_path / f"{name}.safetensors" for name in sides}) == [
        ("chaser", "random"),
        ("chaser", "foe"),
        ("P_stage1", "still"),
    ]
    assert pairings({}) == []


def test_agents_kept_on_the_way_are_left_out(tmp_path):
    (tmp_path / "agents").mkdir()
    for name in ("P_scratch", "P_scratch-25", "E_scratch"):
        (tmp_path / "agents" / f"{name}.safetensors").touch()
    assert list(last_agents(tmp_path)) == ["E_scratch", "P_scratch"]


def look(env_steps, **outcomes):
    rest = {"captured": 0, "evader_hit_obstacle": 0, "evader_out_of_range": 0, "no_result": 0}
    return env_steps, rest | outcomes


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
