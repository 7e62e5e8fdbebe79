"""Who is judged against whom."""

import jax

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.evaluate.pairings import last_agents, pairings
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
