"""The example of a learner of one's own trains on the vector interface and leaves an agent that plays."""

import re
import runpy
from pathlib import Path

import jax

from apollonius.agents.catalogue import find_agent
from apollonius.game.types import Role

EXAMPLE = Path(__file__).parents[2] / "examples" / "dqn.py"


def test_it_trains_and_its_agent_is_found(tmp_path, capsys):
    with jax.numpy_dtype_promotion("standard"):  # which optax needs
        main = runpy.run_path(str(EXAMPLE))["main"]
        main(["--env-steps", "12800", "--opponent", "random", "--out", str(tmp_path / "chaser.safetensors")])
    losses = [float(loss) for loss in re.findall(r"loss (\S+)", capsys.readouterr().out)]
    assert losses
    assert 0 < losses[-1] < 10
    found = find_agent(str(tmp_path / "chaser.safetensors"), Role.PURSUER)
    assert found.header.training["env_steps"] == 12800
