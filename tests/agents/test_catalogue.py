"""Agents by name: built in, or a file that plays the side it was trained for."""

import equinox as eqx
import jax
import pytest

from apollonius.agents.catalogue import ZOO, find_agent, zoo_names
from apollonius.agents.classical import Still
from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.agents.uniform import Uniform
from apollonius.errors import InvalidInput
from apollonius.game.types import Role


@pytest.fixture(scope="module")
def pursuer():
    return describe(make_network("encoded", 4, 2, jax.random.key(0)), Role.PURSUER, {}, {"seed": 5})


@pytest.mark.parametrize("role", Role)
@pytest.mark.parametrize(("name", "player"), [("random", Uniform), ("still", Still)])
def test_built_in_players_play_either_side(name, player, role):
    found = find_agent(name, role)
    assert found.name == name
    assert isinstance(found.policy, player)
    assert found.header is None


def test_a_file_plays_greedily_and_brings_its_header(pursuer, tmp_path):
    save_agent(pursuer, tmp_path / "chaser.safetensors")
    found = find_agent(str(tmp_path / "chaser.safetensors"), Role.PURSUER)
    assert found.name == "chaser"
    assert isinstance(found.policy, Greedy)
    assert eqx.tree_equal(found.policy.network, pursuer.network)
    assert found.header == pursuer.header


def test_a_file_plays_no_other_side(pursuer, tmp_path):
    save_agent(pursuer, tmp_path / "chaser.safetensors")
    with pytest.raises(InvalidInput, match="plays the pursuer, not the evader"):
        find_agent(str(tmp_path / "chaser.safetensors"), Role.EVADER)


def test_an_unknown_name_is_answered_with_the_known_ones():
    with pytest.raises(InvalidInput, match=r"'nobody': choose one of random, still.* or give a \.safetensors file"):
        find_agent("nobody", Role.PURSUER)


@pytest.mark.parametrize("name", zoo_names())
def test_an_agent_of_the_zoo_is_small_and_says_where_it_comes_from(name):
    role = {"P": Role.PURSUER, "E": Role.EVADER}[name[0]]
    header = find_agent(name, role).header
    assert (ZOO / f"{name}.safetensors").stat().st_size < 1_000_000
    assert {"command", "seed", "stage", "env_steps", "episodes", "config"} <= set(header.training)
    assert header.game["arena"]["discs"]
