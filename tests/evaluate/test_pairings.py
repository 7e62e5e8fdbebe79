"""Who is judged against whom."""

from apollonius.evaluate.pairings import last_agents, pairings


def test_every_pursuer_meets_random_and_every_evader_but_stage_1s_one_that_stays():
    assert pairings(["E_scratch", "P_scratch", "P_stage1"]) == [
        ("P_scratch", "random"),
        ("P_scratch", "E_scratch"),
        ("P_stage1", "still"),
    ]
    assert pairings([]) == []


def test_agents_kept_on_the_way_are_left_out(tmp_path):
    (tmp_path / "agents").mkdir()
    for name in ("P_scratch", "P_scratch-25", "E_scratch"):
        (tmp_path / "agents" / f"{name}.safetensors").touch()
    assert list(last_agents(tmp_path)) == ["E_scratch", "P_scratch"]
