"""The code in the documents runs, and comes to what the text says."""

import re
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

DOCS = Path(__file__).parents[1] / "docs"


def run(name):
    """The names that a document's Python blocks leave behind, run one after the other."""
    names = {}
    for block in re.findall(r"```python\n(.*?)```", (DOCS / name).read_text(), flags=re.DOTALL):
        exec(block, names)
    return names


def test_plain_jax():
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
