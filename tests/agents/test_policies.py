"""Who acts: players keep the rule they are named for, networks value a batch alike, and agents come back from files."""

import os
from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save_file
from scipy.stats import chisquare, kstest, norm

from apollonius.agents.classical import Still, Uniform, uniform_action
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import PartitionedPlayers, single_player, stack
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.agents.trained import EpsilonGreedy, Greedy, SquashedGaussian, greedy_policy
from apollonius.agents.wrappers.action_repeat import ActionRepeat
from apollonius.arenas.file import to_dict
from apollonius.catalogue import find_pool
from apollonius.cli.main import main
from apollonius.game.game import reset_batch
from apollonius.game.presets import make_game
from apollonius.game.types import NUM_ACTIONS, BySide, Role
from apollonius.io.document import write_atomically
from apollonius.io.errors import InvalidInput
from apollonius.observe.egocentric import EGOCENTRIC
from apollonius.observe.team import TEAM
from apollonius.play.rollout import collect, init_games
from tests.acting import act, act_in_rows, identical
from tests.solve.small import SMALL

WORDS = jnp.asarray(np.random.default_rng(7).integers(2**32, size=200_000, dtype=np.uint32))
NOTHING = jnp.asarray(np.zeros(8, np.float32))


def network_with(values):
    """A network whose nine action values are these, whatever it sees."""
    network = make_network("paper", width=4, depth=1, key=jax.random.key(0))
    last = jnp.zeros((NUM_ACTIONS, 4)), jnp.asarray(values, jnp.float32)
    return eqx.tree_at(lambda network: (network.layers[-1].weight, network.layers[-1].bias), network, last)


def test_uniform_action_splits_the_random_words_evenly():
    upper_halves = jnp.arange(2**16, dtype=jnp.uint32) << 16
    counts = np.bincount(jax.vmap(uniform_action)(upper_halves))
    assert len(counts) == NUM_ACTIONS
    assert counts.max() - counts.min() <= 1


@pytest.mark.parametrize("epsilon", [0.0, 0.3, 1.0])
def test_epsilon_is_the_share_of_uniformly_random_actions(epsilon):
    player = EpsilonGreedy(Greedy(network_with(np.eye(NUM_ACTIONS)[4])), jnp.asarray(epsilon))
    counts = np.bincount(jax.vmap(partial(act, player, NOTHING))(WORDS), minlength=NUM_ACTIONS)
    shares = np.full(NUM_ACTIONS, epsilon / NUM_ACTIONS)
    shares[4] += 1 - epsilon
    assert chisquare(counts + 1, shares * len(WORDS) + 1).pvalue > 0.01


def allowing(*actions):
    return jnp.isin(jnp.arange(NUM_ACTIONS), jnp.array(actions))


def test_greedy_takes_the_first_of_the_best_allowed_actions():
    unlike, every = [0, 5, 1, 9, 3, 4, 2, 8, 7], range(9)
    limited = (unlike, (3, 7), 3), (unlike, (7, 8), 7), (unlike, (0, 2, 4), 4), (unlike, (6,), 6)
    alike = (
        ([0] * 9, every, 0),
        ([0, 1, 1, 0, 0, 0, 0, 0, 1], every, 1),
        ([-3, -2, -3, -3, -3, -3, -1, -1, -9], every, 6),
    )
    for values, allowed, chosen in (*limited, *alike):
        player = Greedy(network_with(values))
        assert player.select(player.score(NOTHING, (), WORDS[0])[0], allowing(*allowed)) == chosen
        assert act(player, NOTHING, WORDS[0]) == np.argmax(values)


def test_still_brakes_and_random_falls_back_to_the_first_allowed_action():
    assert act(Still(), NOTHING, WORDS[0]) == 1
    actions = np.asarray(jax.vmap(partial(act, Uniform()))(jnp.zeros((50, 8)), WORDS[:50]))
    held = jax.vmap(lambda bits: Uniform().select(act(Uniform(), NOTHING, bits), allowing(2, 5, 6)))(WORDS[:50])
    assert held.tolist() == [action if action in (2, 5, 6) else 2 for action in actions]


GAME = replace(SMALL, max_steps=jnp.int32(17))


class Drifting(AbstractPolicy):
    """Speeds up every other time that it is asked, and turns by its random bits."""

    @property
    def memory(self):
        return jnp.int32(0)

    def __call__(self, seen, memory, bits):
        return 3 * (1 + memory % 2) + bits.astype(jnp.int32) % 3, memory + 1


@jax.jit
def pursuits(pursuers):
    """What the pursuers do in twenty games, and when these end."""
    starts, players = reset_batch(GAME, jax.random.key(0), 20), BySide(pursuers, single_player(Uniform()))
    begun = init_games(GAME, starts, players, jnp.zeros((2, 20), jnp.uint32))
    moves = collect(GAME, players, begun, jax.tree.map(lambda leaf: leaf[None], starts), jax.random.key(1), 40)[1]
    return moves.sides.pursuer, moves.ended


HOLDING = ActionRepeat(Drifting(), 7)


def test_action_repeat_restarts_with_each_game():
    """Games begin as others end; its own memory goes on as it decides."""
    moves, ended = pursuits(single_player(HOLDING))
    for actions, over in zip(np.asarray(moves.action).T, np.asarray(ended).T, strict=True):
        for course in np.split(actions, np.flatnonzero(over) + 1):
            decided = course[::7]
            np.testing.assert_array_equal(course, np.repeat(decided, 7)[: len(course)])
            np.testing.assert_array_equal(decided // 3, 1 + np.arange(len(decided)) % 2)
    assert len(set((np.asarray(moves.action) % 3).ravel())) == 3
    assert ended.sum() >= 40


def test_partitioned_players_act_as_each_kind_alone():
    """Each plays its part of a batch as it would play all of it, with a memory of its own."""
    together, _ = pursuits(PartitionedPlayers((HOLDING, Drifting()), (8, 12)))
    assert together.member[-1].tolist() == [0] * 8 + [1] * 12
    for one, own in ((HOLDING, slice(8)), (Drifting(), slice(8, 20))):
        np.testing.assert_array_equal(together.action[:, own], pursuits(single_player(one))[0].action[:, own])


@pytest.mark.parametrize("observation", [EGOCENTRIC, TEAM])
def test_symmetric_network_is_equivariant_under_reflection(observation):
    """And what it says of an action is the mean of both sides, one by one, in a batch and as a player."""
    plain = make_network(observation.name, 16, 2, jax.random.key(0))
    network = replace(plain, symmetric=True)
    seen = jax.random.normal(jax.random.key(1), (5, observation.size))
    mirrored, exchanged = observation.mirror(seen), [2, 1, 0, 5, 4, 3, 8, 7, 6]
    values, expected = network.batch(seen), (plain.batch(seen) + plain.batch(mirrored)[:, exchanged]) / 2
    np.testing.assert_allclose(values, expected, atol=1e-6)
    np.testing.assert_allclose(network.batch(mirrored), values[:, exchanged], atol=1e-6)
    np.testing.assert_allclose(jax.vmap(network)(seen), values, atol=1e-6)
    np.testing.assert_allclose(jax.vmap(Greedy(network).values)(seen), values, atol=1e-6)
    assert np.abs(values - plain.batch(seen)).max() > 0.01


@pytest.mark.parametrize(
    "player",
    [
        EpsilonGreedy(Greedy(make_network("encoded", 64, 2, jax.random.key(0))), jnp.float32(0.3)),
        SquashedGaussian(make_actor("encoded", 64, 2, jax.random.key(0)), jnp.float32(1.0)),
    ],
    ids=["discrete", "continuous"],
)
def test_act_in_rows_matches_act_in_each_game(player):
    seen = jax.random.normal(jax.random.key(1), (64, 17))
    bits = jax.random.bits(jax.random.key(2), (64,), jnp.uint32)
    together, alone = jax.jit(act_in_rows), jax.jit(act)
    each = np.stack([alone(player, *one) for one in zip(seen, bits, strict=True)])
    assert len(np.unique(each, axis=0)) > 5
    for games in (64, 40):
        found = together(single_player(player), jnp.zeros(games, jnp.int32), seen[:games], bits[:games])
        np.testing.assert_allclose(found, each[:games], atol=1e-6)


ACTOR = make_actor("paper", 8, 2, jax.random.key(1))
ONE_SEEN = jnp.asarray(np.linspace(-1, 1, 8, dtype=np.float32))


def test_greedy_policy_plays_the_hyperbolic_tangent_of_the_mean():
    mean = np.asarray(ONE_SEEN, np.float64)
    for number, layer in enumerate(ACTOR.layers):
        mean = np.asarray(layer.weight) @ (np.maximum(mean, 0) if number else mean) + np.asarray(layer.bias)
    action = act(greedy_policy(ACTOR), ONE_SEEN, WORDS[0])
    np.testing.assert_allclose(action, np.tanh(mean[:2]), atol=1e-6)
    np.testing.assert_allclose(ACTOR.batch(ONE_SEEN[None])[0][0], mean[:2], atol=1e-6)
    np.testing.assert_array_equal(act(SquashedGaussian(ACTOR, jnp.asarray(0.0)), ONE_SEEN, WORDS[0]), action)


def test_squashed_gaussian_samples_the_squashed_normal_distribution():
    """Before the hyperbolic tangent: normal, with its own means and standard deviations, these times the spread.

    A word makes two independent numbers.
    """
    mean, deviation = ACTOR(ONE_SEEN)
    for spread in (1.0, 0.5):
        player = SquashedGaussian(ACTOR, jnp.asarray(spread))
        drawn = np.arctanh(np.asarray(jax.jit(jax.vmap(partial(act, player, ONE_SEEN)))(WORDS[:20_000]), np.float64))
        standard = (drawn - np.asarray(mean)) / (spread * np.asarray(deviation))
        for numbers in standard.T:
            assert kstest(numbers, norm.cdf).pvalue > 0.01
        for power in (1, 2):
            assert abs(np.corrcoef((standard**power).T)[0, 1]) < 0.03


@pytest.mark.parametrize(
    ("levels", "allowed", "action"),
    [((1.0, 1.0), range(9), 8), ((0.4, -0.6), range(9), 3), ((0.4, -0.6), (0, 1, 8), 0), ((-9.0, 0.2), (2, 4), 2)],
)
def test_greedy_policy_selects_the_allowed_action_with_the_nearest_levels(levels, allowed, action):
    assert greedy_policy(ACTOR).select(jnp.array(levels), allowing(*allowed)) == action


def test_pool_with_its_own_random_bits_acts_by_them():
    pool = stack(
        [SquashedGaussian(make_actor("paper", 8, 1, jax.random.key(seed)), jnp.asarray(1.0)) for seed in range(2)]
    )
    member, seen = jnp.array([0, 1, 1, 0]), jnp.tile(ONE_SEEN, (4, 1))
    held, acts = replace(pool, bits=WORDS[4:8]), jax.jit(act_in_rows)
    own = np.asarray(acts(held, member, seen, WORDS[:4]))
    np.testing.assert_array_equal(own, acts(pool, member, seen, WORDS[4:8]))
    assert (own != acts(pool, member, seen, WORDS[:4])).all()


def test_continuous_agents_form_a_pool_without_discrete_ones_or_values(tmp_path, capsys):
    files = []
    for seed in range(2):
        files.append(str(tmp_path / f"E_{seed}.safetensors"))
        save_agent(describe(make_actor("paper", 8, 1, jax.random.key(seed)), Role.EVADER, {}, {}), tmp_path / files[-1])
    assert find_pool(files, Role.EVADER, make_game("paper")).size == 2
    with pytest.raises(InvalidInput, match="random and still beside discrete ones"):
        find_pool([files[0], "random"], Role.EVADER, make_game("paper"))
    assert main(["slice", files[0], "--opponent", "5", "5", "--out", str(tmp_path / "a.png")]) == 2
    assert "it must be one that values its nine actions" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("make", "observation", "about"),
    [
        (make_network, "paper", ("values", 9, 2)),
        (make_network, "encoded", ("values", 9, 2)),
        (make_actor, "encoded", ("gaussian", 0, 2)),
    ],
)
def test_saved_agent_loads_to_the_last_bit(make, observation, about, tmp_path):
    training = {"command": "apollonius train", "seed": 3, "env_steps": 1000}
    network = make(observation, 4, 2, jax.random.key(1))
    agent = describe(network, Role.PURSUER, to_dict(make_game("paper")), training)
    save_agent(agent, tmp_path / "agent.safetensors")
    loaded = load_agent(tmp_path / "agent.safetensors")
    assert loaded.header == agent.header
    assert (loaded.header.network, loaded.header.num_actions, loaded.header.depth) == about
    assert identical(agent.network, loaded.network)
    assert {leaf.dtype for leaf in jax.tree.leaves(loaded.network)} == {jnp.dtype("float32")}


def test_load_agent_refuses_a_missing_foreign_or_truncated_file(tmp_path):
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


def test_write_atomically_syncs_before_it_replaces_the_old_file(tmp_path, monkeypatch):
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
