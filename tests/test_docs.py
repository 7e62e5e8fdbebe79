"""The code in the documents runs, and comes to what the text says."""

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tomli_w

from apollonius.cli import main
from apollonius.game.record import to_dict
from tests.learn.tiny import RUN

DOCS = Path(__file__).parents[1] / "docs"


def run(name):
    """The names that a document's Python blocks leave behind, run one after the other."""
    names = {}
    for block in re.findall(r"```python\n(.*?)```", (DOCS / name).read_text(), flags=re.DOTALL):
        exec(block, names)
    return names


def test_plain_jax():
    jax.clear_caches()  # what other tests have compiled is not counted below
    names = run("jax.md")
    assert names["seen"].shape == (17,)
    outcomes = np.asarray(names["outcomes"])
    assert outcomes.shape == (1000,)
    assert len(np.unique(outcomes)) > 3
    assert names["step"]._cache_size() == 1
    assert np.all(np.diff(names["distances"]) >= 0)
    assert names["distances"][0] < names["distances"][-1]
    assert not bool(jnp.any(names["timestep"].terminated & names["timestep"].truncated))


def test_interfaces():
    pytest.importorskip("pettingzoo")
    names = run("interfaces.md")
    assert names["infos"] == {}
    assert names["observations"].shape == (4096, 8)


SHORTER = {
    "--preset quick": "--config tiny.toml",
    "--games 2000": "--games 4",
    "--games 500": "--games 4",
    "--targets 20": "--targets 1 --grid 10x7x3x9",
    "shielded:intercept shielded:pure-pursuit": "shielded:intercept",
    "random flee-aware circle": "flee-aware",
}


@pytest.mark.slow
def test_an_arena_of_ones_own_from_the_plan_to_the_judgement(tmp_path, monkeypatch, capsys):
    """Every command of the walk-through, with less training, fewer and shorter games."""
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "own_arena.md").read_text()
    (plan,) = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    Path("hall.toml").write_text("max_steps = 30\n" + plan)
    Path("tiny.toml").write_text(tomli_w.dumps(to_dict(RUN)))
    commands = "".join(re.findall(r"```sh\n(.*?)```", text, flags=re.DOTALL))
    for long, short in SHORTER.items():
        assert long in commands
        commands = commands.replace(long, short)
    with jax.numpy_dtype_promotion("standard"):  # which optax needs
        for command in commands.splitlines():
            name, *arguments = command.split()
            assert (name, main(arguments)) == ("apollonius", 0), command
    assert Path("hall.png").exists()
    said = capsys.readouterr().out
    assert "shielded:P_curriculum (pursuer) against flee-aware (evader), 4 games" in said
    assert "P_curriculum against standing targets: 4 games, 1 targets" in said
