"""Agents by name: built in, or a file that plays the side it was trained for."""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius import catalogue
from apollonius.agents import names, trained
from apollonius.agents.classical import Still
from apollonius.agents.greedy import Greedy
from apollonius.agents.kind import AbstractKind, Named
from apollonius.agents.network import make_network
from apollonius.agents.shield import Shielded
from apollonius.agents.store import describe, save_agent
from apollonius.agents.trained import learned_elsewhere
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player, find_pool, player_names
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from tests.acting import act, act_in_rows

PAPER = make_game("paper")


@pytest.fixture(scope="module")
def pursuer():
    return describe(make_network("encoded", 4, 2, jax.random.key(0)), Role.PURSUER, {}, {"seed": 5})


def test_a_file_plays_greedily_its_own_side_and_brings_its_header(pursuer, tmp_path):
    save_agent(pursuer, tmp_path / "chaser.safetensors")
    found = find_player(str(tmp_path / "chaser.safetensors"), Role.PURSUER, PAPER)
    assert (found.name, type(found.policy), found.header) == ("chaser", Greedy, pursuer.header)
    assert eqx.tree_equal(found.policy.network, pursuer.network)
    with pytest.raises(InvalidInput, match="plays the pursuer, not the evader"):
        find_player(str(tmp_path / "chaser.safetensors"), Role.EVADER, PAPER)


def test_an_agent_of_a_run_is_called_after_it_and_found_by_that_name(pursuer, tmp_path, monkeypatch):
    """Two runs give their agents the same names, and those of the zoo."""
    monkeypatch.chdir(tmp_path)
    file = Path("runs/demo/agents/P_stage1.safetensors")
    file.parent.mkdir(parents=True)
    save_agent(pursuer, file)
    for name in ("demo/P_stage1", "runs/demo/P_stage1", str(file), str(file.resolve())):
        found = find_player(name, Role.PURSUER, PAPER)
        assert found.name == "demo/P_stage1"
        assert found.header == pursuer.header
    shielded = find_player("shielded:demo/P_stage1", Role.PURSUER, PAPER)
    assert shielded.name == "shielded:demo/P_stage1"
    assert find_player("P_stage1", Role.PURSUER, PAPER).name == "P_stage1"
    assert find_player("zoo/P_stage1", Role.PURSUER, PAPER).name == "zoo/P_stage1"
    assert eqx.tree_equal(
        find_player("zoo/P_stage1", Role.PURSUER, PAPER).policy,
        find_player("P_stage1", Role.PURSUER, PAPER).policy,
    )
    with pytest.raises(InvalidInput, match="'demo/P_stage2': choose one of"):
        find_player("demo/P_stage2", Role.PURSUER, PAPER)


class Echo(AbstractKind):
    """A kind of one's own: players that are called after what they do."""

    looks = "always:ACTION"

    def find(self, name, role, game):
        return Named(name, Still()) if name == "always:1" else None


def test_a_new_kind_is_known_everywhere_once_it_is_registered(monkeypatch):
    with pytest.raises(InvalidInput, match="no agent is called 'always:1'"):
        find_player("always:1", Role.EVADER, PAPER)
    monkeypatch.setattr(catalogue, "KINDS", (*catalogue.KINDS, Echo()))
    assert isinstance(find_player("always:1", Role.EVADER, PAPER).policy, Still)
    guarded = find_player("shielded:always:1", Role.EVADER, PAPER)
    assert (guarded.name, type(guarded.policy)) == ("shielded:always:1", Shielded)
    assert isinstance(find_pool(["always:1"], Role.EVADER, PAPER).members, Still)
    with pytest.raises(InvalidInput, match=r"'always:2': .*a file of a solved game, .*always:ACTION"):
        find_player("always:2", Role.EVADER, PAPER)


def test_which_side_an_agent_of_the_zoo_plays_its_file_says(monkeypatch, pursuer, tmp_path):
    save_agent(pursuer, tmp_path / "Eager.safetensors")
    for module in (names, trained):
        monkeypatch.setattr(module, "ZOO", tmp_path)
    assert "Eager" in player_names(Role.PURSUER, PAPER)
    assert "Eager" not in player_names(Role.EVADER, PAPER)


def test_a_pool_has_trained_agents_random_and_still_side_by_side(pursuer, tmp_path):
    other = describe(make_network("encoded", 4, 2, jax.random.key(1)), Role.PURSUER, {}, {})
    files = []
    for index, agent in enumerate((pursuer, other)):
        files.append(str(tmp_path / f"{index}.safetensors"))
        save_agent(agent, tmp_path / f"{index}.safetensors")
    pool = find_pool([files[0], "random", files[1], "still"], Role.PURSUER, PAPER)
    assert pool.size == 4
    observation = jnp.tile(jnp.linspace(-1, 1, 17), (2000, 1))
    words = jax.random.bits(jax.random.key(2), (2000,))
    acts = jax.jit(act_in_rows)
    actions = [np.asarray(acts(pool, jnp.full(2000, member), observation, words)) for member in range(4)]
    for member, name in ((0, files[0]), (2, files[1]), (3, "still")):
        alone = act(find_player(name, Role.PURSUER, PAPER).policy, observation[0], words[0])
        assert (actions[member] == int(alone)).all()
    assert np.bincount(actions[1], minlength=9).min() > 150


@pytest.mark.parametrize("names", [[], ["random", "still"], ["random", "random"]], ids=str)
def test_players_that_do_not_go_together_make_no_pool(names):
    with pytest.raises(InvalidInput, match="pursuers = "):
        find_pool(names, Role.PURSUER, PAPER)


def test_it_is_known_who_has_learned_in_another_arena_only():
    paper, maze = PAPER, find_game("maze")
    prioritised = find_player("P_prioritised", Role.PURSUER, PAPER)
    assert not learned_elsewhere(prioritised, paper)
    assert not learned_elsewhere(prioritised, charted(paper))
    assert learned_elsewhere(prioritised, maze)
    assert not learned_elsewhere(find_player("pursuer", Role.PURSUER, maze), maze)
    assert not learned_elsewhere(find_player("still", Role.PURSUER, PAPER), maze)
