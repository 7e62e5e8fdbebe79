"""Trained players: how they draw from continuous actions, and agents as files, which come back to the same bits."""

import os
from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save_file
from scipy.stats import kstest, norm

from apollonius.agents.greedy import SquashedGaussian, normal_pair
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.policy import AbstractContinuous
from apollonius.agents.pool import stack
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.agents.trained import exploring, greedy
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_pool
from apollonius.cli.main import main
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.document import write_atomically
from apollonius.io.errors import InvalidInput
from apollonius.observe.paper import PAPER
from tests.acting import act, act_in_rows

WORDS = jnp.asarray(np.random.default_rng(3).integers(2**32, size=20_000, dtype=np.uint32))
ACTOR = make_actor("paper", 8, 2, jax.random.key(1))
SEEN = jnp.asarray(np.linspace(-1, 1, 8, dtype=np.float32))


class Wants(AbstractContinuous):
    """Always the same levels."""

    levels: tuple[float, float] = eqx.field(static=True)

    observation = PAPER

    def __call__(self, observation, memory, bits):
        return jnp.array(self.levels), memory


def test_the_numbers_of_a_word_are_two_independent_standard_normal_ones():
    draw = jax.jit(jax.vmap(normal_pair))
    pairs = np.asarray(draw(WORDS))
    for numbers in pairs.T:
        assert kstest(numbers, norm.cdf).pvalue > 0.01
    assert abs(np.corrcoef(pairs.T)[0, 1]) < 0.03
    assert abs(np.corrcoef((pairs**2).T)[0, 1]) < 0.03
    ends = jnp.array([0, 2**16 - 1, 2**32 - 2**16, 2**32 - 1], jnp.uint32)
    assert np.abs(draw(ends)).max() < 4.9


def layers_in_numpy(actor, seen):
    hidden = np.asarray(seen, np.float64)
    for layer in actor.layers[:-1]:
        hidden = np.maximum(np.asarray(layer.weight) @ hidden + np.asarray(layer.bias), 0)
    return np.asarray(actor.layers[-1].weight) @ hidden + np.asarray(actor.layers[-1].bias)


def test_at_its_best_it_plays_the_hyperbolic_tangent_of_its_means():
    mean = layers_in_numpy(ACTOR, SEEN)[:2]
    action = act(greedy(ACTOR), SEEN, WORDS[0])
    np.testing.assert_allclose(action, np.tanh(mean), atol=1e-6)
    np.testing.assert_allclose(ACTOR.batch(SEEN[None])[0][0], mean, atol=1e-6)
    np.testing.assert_array_equal(act(exploring(ACTOR, jnp.asarray(0.0)), SEEN, WORDS[0]), action)


def test_exploring_it_draws_from_its_distributions():
    """Before the hyperbolic tangent: normal, with its own means and standard deviations, these times the spread."""
    mean, deviation = ACTOR(SEEN)
    for spread in (1.0, 0.5):
        player = SquashedGaussian(ACTOR, jnp.asarray(spread))
        drawn = np.arctanh(np.asarray(jax.jit(jax.vmap(partial(act, player, SEEN)))(WORDS), np.float64))
        for numbers, middle, width in zip(drawn.T, mean, deviation, strict=True):
            assert kstest((numbers - float(middle)) / (spread * float(width)), norm.cdf).pvalue > 0.01


@pytest.mark.parametrize(
    ("levels", "allowed", "action"),
    [((1.0, 1.0), range(9), 8), ((0.4, -0.6), range(9), 3), ((0.4, -0.6), (0, 1, 8), 0), ((-9.0, 0.2), (2, 4), 2)],
)
def test_where_only_some_actions_are_allowed_it_takes_that_with_the_nearest_levels(levels, allowed, action):
    mask = jnp.isin(jnp.arange(9), jnp.array(list(allowed)))
    assert Wants(levels).choose(act(Wants(levels), SEEN, WORDS[0]), mask) == action


def test_who_is_given_words_of_its_own_acts_by_them_and_is_drawn_by_the_games():
    pool = stack([exploring(make_actor("paper", 8, 1, jax.random.key(seed)), jnp.asarray(1.0)) for seed in range(2)])
    member, seen = jnp.array([0, 1, 1, 0]), jnp.tile(SEEN, (4, 1))
    held, acts = replace(pool, bits=WORDS[4:8]), jax.jit(act_in_rows)
    own = np.asarray(acts(held, member, seen, WORDS[:4]))
    np.testing.assert_array_equal(own, acts(pool, member, seen, WORDS[4:8]))
    assert (own != acts(pool, member, seen, WORDS[:4])).all()


def test_trained_ones_go_together_but_not_with_random_and_have_no_values(tmp_path, capsys):
    files = []
    for seed in range(2):
        files.append(str(tmp_path / f"E_{seed}.safetensors"))
        save_agent(describe(make_actor("paper", 8, 1, jax.random.key(seed)), Role.EVADER, {}, {}), tmp_path / files[-1])
    assert find_pool(files, Role.EVADER, make_game("paper")).size == 2
    with pytest.raises(InvalidInput, match="random and still beside discrete ones"):
        find_pool([files[0], "random"], Role.EVADER, make_game("paper"))
    assert main(["slice", files[0], "--opponent", "5", "5", "--out", str(tmp_path / "a.png")]) == 2
    assert "continuous actions and values none" in capsys.readouterr().err


GAME = to_dict(make_game("paper"))
TRAINING = {"command": "apollonius train", "seed": 3, "env_steps": 1000}


@pytest.mark.parametrize(
    ("make", "observation", "about"),
    [
        (make_network, "paper", ("values", 9, 2)),
        (make_network, "encoded", ("values", 9, 2)),
        (make_actor, "encoded", ("gaussian", 0, 2)),
    ],
)
def test_an_agent_comes_back_to_the_last_bit(make, observation, about, tmp_path):
    agent = describe(make(observation, 4, 2, jax.random.key(1)), Role.PURSUER, GAME, TRAINING)
    save_agent(agent, tmp_path / "agent.safetensors")
    loaded = load_agent(tmp_path / "agent.safetensors")
    assert loaded.header == agent.header
    assert (loaded.header.network, loaded.header.num_actions, loaded.header.depth) == about
    assert jax.tree.structure(loaded.network) == jax.tree.structure(agent.network)
    for ours, theirs in zip(jax.tree.leaves(agent.network), jax.tree.leaves(loaded.network), strict=True):
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)


def test_what_is_no_whole_agent_file_is_refused(tmp_path):
    path, weights = tmp_path / "agent.safetensors", {"weight": np.zeros((3, 3), np.float32)}
    for spoil, said in (
        (lambda: None, "there is no agent file"),
        (path.mkdir, "there is no agent file"),
        (lambda: (path.rmdir(), save_file(weights, path)), "no Apollonius agent"),
        (lambda: save_file(weights, path, {"format": "pt"}), "no Apollonius agent"),
        (lambda: path.write_bytes(path.read_bytes()[:-1]), "not a whole safetensors file"),
    ):
        spoil()
        with pytest.raises(InvalidInput, match=f"{path}.*{said}|{said}.*{path}"):
            load_agent(path)


def test_a_write_is_on_disk_before_it_takes_the_old_ones_place(tmp_path, monkeypatch):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    calls = []
    fsync, rename = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda number: (calls.append("fsync"), fsync(number)))
    monkeypatch.setattr(
        os, "replace", lambda source, target: (calls.append(f"replace {path.read_text()}"), rename(source, target))
    )
    write_atomically(path, b"new")
    assert calls == ["fsync", "replace old"]
    assert path.read_bytes() == b"new"
