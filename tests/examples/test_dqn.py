"""The example of a learner of one's own trains on the vector interface and leaves an agent that plays."""

import re
import runpy
from pathlib import Path

import jax
import pytest

from apollonius.catalogue import find_player
from apollonius.game.types import Role
from apollonius.io.errors import exit_status

EXAMPLE = Path(__file__).parents[2] / "examples" / "dqn.py"


@pytest.mark.slow
def test_it_trains_and_its_agent_is_found(tmp_path, capsys):
    with jax.numpy_dtype_promotion("standard"):  # which optax needs
        main = runpy.run_path(str(EXAMPLE))["main"]
        main(["--env-steps", "12800", "--opponent", "random", "--out", str(tmp_path / "chaser.safetensors")])
    losses = [float(loss) for loss in re.findall(r"loss (\S+)", capsys.readouterr().out)]
    assert losses
    assert 0 < losses[-1] < 10
    found = find_player(str(tmp_path / "chaser.safetensors"), Role.PURSUER)
    assert found.header.training["env_steps"] == 12800


@pytest.mark.parametrize(
    ("arguments", "naming"),
    [
        (["--opponent", "nobody"], "nobody"),
        (["--opponent", "P_stage1"], "P_stage1"),
        (["--env-steps", "0"], "--env-steps = 0"),
        (["--env-steps", "4000"], "--env-steps = 4000"),
        (["--seed", "-1"], "--seed = -1"),
        (["--out", "."], "--out = ."),
    ],
)
def test_it_refuses_in_one_line_before_it_trains(tmp_path, monkeypatch, capsys, arguments, naming):
    monkeypatch.chdir(tmp_path)
    main = runpy.run_path(str(EXAMPLE))["main"]
    assert exit_status(lambda: main(arguments)) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert naming in printed.err
    assert list(tmp_path.iterdir()) == []
