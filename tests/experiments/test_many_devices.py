"""Self-play on all devices: it trains what the config says."""

from dataclasses import replace

import pytest

from apollonius.agents.network import GaussianActor
from apollonius.agents.store import load_agent
from apollonius.experiments import many_devices
from apollonius.learn.config import PRESETS
from apollonius.learn.learner_config import SACConfig
from tests.learn.tiny import RUN, SMALL

SAC = SACConfig(**SMALL)
CONFIG = replace(RUN, stages="self-play", sac=SAC, self_play=replace(RUN.self_play, env_steps=1))


class Planned(Exception):
    """Carries the plan that was about to be shared out."""


@pytest.mark.parametrize("config", [CONFIG, replace(CONFIG, sac=None), replace(PRESETS["quick"], stages="self-play")])
def test_what_devices_share_is_what_the_config_says(tmp_path, monkeypatch, config):
    def share(plan, devices):
        raise Planned(plan)

    monkeypatch.setattr(many_devices, "share", share)
    with pytest.raises(Planned) as stopped:
        many_devices.train_shared(config, tmp_path / "run")
    (plan,) = stopped.value.args
    assert (plan.learner, plan.stage) == (config.learner, config.self_play)


@pytest.mark.slow
def test_a_config_of_soft_actor_critic_trains_actors(tmp_path):
    many_devices.train_shared(CONFIG, tmp_path / "run")
    for name in ("P_shared", "E_shared"):
        agent = load_agent(tmp_path / "run" / "agents" / f"{name}.safetensors")
        assert isinstance(agent.network, GaussianActor)
        assert agent.header.training["config"]["sac"]["games"] == SAC.games
