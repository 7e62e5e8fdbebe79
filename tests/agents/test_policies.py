"""Who acts: each player keeps the rule it is named for, and networks value a batch as they value each of it."""

from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from apollonius.agents.classical import Still, Uniform, uniform_action
from apollonius.agents.greedy import EpsilonGreedy, Greedy, SquashedGaussian
from apollonius.agents.holding import Holding
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import Apart, solo
from apollonius.game.by_side import BySide
from apollonius.game.game import sample_starts
from apollonius.game.types import NUM_ACTIONS
from apollonius.play.playout import play_out
from apollonius.play.replay import trace
from apollonius.play.rollout import begin, collect
from tests.acting import act, act_in_rows
from tests.solve.small import SMALL

WORDS = jnp.asarray(np.random.default_rng(7).integers(2**32, size=200_000, dtype=np.uint32))
NOTHING = jnp.asarray(np.zeros(8, np.float32))


def network_with(values):
    """A network whose nine action values are these, whatever it sees."""
    network = make_network("paper", width=4, depth=1, key=jax.random.key(0))
    last = network.layers[-1]
    constant = eqx.tree_at(
        lambda layer: (layer.weight, layer.bias), last, (jnp.zeros_like(last.weight), jnp.asarray(values, jnp.float32))
    )
    return eqx.tree_at(lambda network: network.layers[-1], network, constant)


def best_is(action):
    return network_with(np.eye(NUM_ACTIONS)[action])


def action_counts(policy):
    actions = jax.vmap(partial(act, policy, NOTHING))(WORDS)
    return np.bincount(actions, minlength=NUM_ACTIONS)


def test_uniform_actions_share_the_random_words_to_within_one():
    upper_halves = jnp.arange(2**16, dtype=jnp.uint32) << 16
    counts = np.bincount(jax.vmap(uniform_action)(upper_halves))
    assert len(counts) == NUM_ACTIONS
    assert counts.max() - counts.min() <= 1


@pytest.mark.parametrize("epsilon", [0.0, 0.3, 1.0])
def test_epsilon_is_the_share_of_uniformly_random_actions(epsilon):
    counts = action_counts(EpsilonGreedy(best_is(4), jnp.asarray(epsilon)))
    shares = np.full(NUM_ACTIONS, epsilon / NUM_ACTIONS)
    shares[4] += 1 - epsilon
    assert chisquare(counts + 1, shares * len(WORDS) + 1).pvalue > 0.01


@pytest.mark.parametrize(
    ("values", "chosen"),
    [([0] * 9, 0), ([0, 1, 1, 0, 0, 0, 0, 0, 1], 1), ([-3, -2, -3, -3, -3, -3, -1, -1, -9], 6)],
)
def test_greedy_takes_the_first_of_the_best_actions(values, chosen):
    assert act(Greedy(network_with(values)), NOTHING, WORDS[0]) == chosen


def test_still_brakes_straight_ahead():
    assert act(Still(), NOTHING, WORDS[0]) == 1


def allowing(*actions):
    return jnp.isin(jnp.arange(NUM_ACTIONS), jnp.array(actions))


def test_where_only_some_actions_are_allowed_greedy_takes_the_best_of_them():
    player = Greedy(network_with([0, 5, 1, 9, 3, 4, 2, 8, 7]))
    for allowed, action in (((3, 7), 3), ((7, 8), 7), ((0, 2, 4), 4), ((6,), 6)):
        assert int(player.choose(player.weigh(NOTHING, (), WORDS[0])[0], allowing(*allowed))) == action


def test_where_only_some_actions_are_allowed_random_keeps_its_own_or_takes_the_first():
    actions = np.asarray(jax.vmap(partial(act, Uniform()))(jnp.zeros((50, 8)), WORDS[:50]))
    held = jax.vmap(lambda bits: Uniform().choose(act(Uniform(), NOTHING, bits), allowing(2, 5, 6)))(WORDS[:50])
    assert held.tolist() == [action if action in (2, 5, 6) else 2 for action in actions]


GAME = replace(SMALL, max_steps=120)
RUNNER = Uniform()


@pytest.fixture(scope="module")
def drawn():
    """Starts, and the key of their games."""
    return sample_starts(GAME, jax.random.key(0), 40), jax.random.key(1)


class Drifting(AbstractPolicy):
    """Speeds up every other time that it is asked, and turns by its random bits."""

    @property
    def memory(self):
        return jnp.int32(0)

    def __call__(self, seen, memory, bits):
        return 3 * (1 + memory % 2) + bits.astype(jnp.int32) % 3, memory + 1


def test_what_was_decided_is_held_from_the_start_of_each_game(drawn):
    """Games begin as others end; its own memory goes on as it decides."""
    players = BySide(solo(Holding(Drifting(), 7)), solo(RUNNER))
    results = play_out(GAME, players, *drawn, slots=16)
    for game in (0, 39):
        course = trace(GAME, players, *drawn, game)
        actions = np.asarray(course.actions)[:, 0]
        assert len(actions) == results.steps[game] > 14
        decided = actions[::7]
        np.testing.assert_array_equal(actions, np.repeat(decided, 7)[: len(actions)])
        np.testing.assert_array_equal(decided // 3, 1 + np.arange(len(decided)) % 2)
        assert len(set(decided % 3)) > 1


def test_players_of_several_kinds_have_games_of_their_own(drawn):
    """Each plays its part of a batch as it would play all of it, with a memory of its own."""
    kinds, games = (Holding(Drifting(), 2), Drifting()), (2, 3)
    starts, key = jax.tree.map(lambda leaf: leaf[:5], drawn[0]), drawn[1]

    @jax.jit
    def played(pursuers):
        players = BySide(pursuers, solo(RUNNER))
        begun = begin(GAME, starts, players, jnp.zeros((2, 5), jnp.uint32))
        return collect(GAME, players, begun, jax.tree.map(lambda leaf: leaf[None], starts), key, 6)[1].sides.pursuer

    together = played(Apart(kinds, games))
    assert together.member[-1].tolist() == [0, 0, 1, 1, 1]
    for number, one in enumerate(kinds):
        own = np.repeat([0, 1], games) == number
        np.testing.assert_array_equal(together.action[:, own], played(solo(one)).action[:, own])


SEEN = jnp.asarray(np.random.default_rng(1).normal(size=(40, 17)).astype(np.float32))
WANTED = jnp.asarray(np.random.default_rng(2).normal(size=(40, 9)).astype(np.float32))


@pytest.fixture(scope="module")
def network():
    return make_network("encoded", 16, 3, jax.random.key(0))


def one_by_one(network, seen):
    return jax.vmap(network)(seen)


def together(network, seen):
    return network.batch(seen)


def error(values):
    return lambda network, seen: jnp.mean((values(network, seen) - WANTED) ** 2)


def test_a_batch_has_the_values_of_each_observation(network):
    values = jax.jit(together)(network, SEEN)
    assert values.shape == (40, 9)
    np.testing.assert_allclose(values, jax.jit(one_by_one)(network, SEEN), atol=1e-6)


@pytest.mark.parametrize("of", ["weights", "observations"])
def test_its_gradient_is_that_of_the_same_values(of, network):
    if of == "weights":
        slopes = [jax.jit(jax.grad(error(values)))(network, SEEN) for values in (together, one_by_one)]
    else:
        slopes = [jax.jit(jax.grad(error(values), argnums=1))(network, SEEN) for values in (together, one_by_one)]
    mine, theirs = map(jax.tree.leaves, slopes)
    assert len(mine) == (8 if of == "weights" else 1)
    for one, other in zip(mine, theirs, strict=True):
        assert np.abs(other).max() > 1e-4
        np.testing.assert_allclose(one, other, atol=1e-7, rtol=1e-4)


@pytest.mark.parametrize("games", [64, 40], ids=["whole blocks", "fewer"])
@pytest.mark.parametrize("kind", ["discrete", "continuous"])
def test_players_of_many_games_act_as_each_of_them_would(kind, games):
    """Quicker ways through the network are taken for whole blocks only."""
    if kind == "discrete":
        player = EpsilonGreedy(make_network("encoded", 64, 2, jax.random.key(0)), jnp.float32(0.3))
    else:
        player = SquashedGaussian(make_actor("encoded", 64, 2, jax.random.key(0)), jnp.float32(1.0))
    seen = jax.random.normal(jax.random.key(1), (games, 17))
    bits = jax.random.bits(jax.random.key(2), (games,), jnp.uint32)
    together = jax.jit(act_in_rows)(solo(player), jnp.zeros(games, jnp.int32), seen, bits)
    alone = jax.jit(act)
    each = np.stack([alone(player, *one) for one in zip(seen, bits, strict=True)])
    assert len(np.unique(each, axis=0)) > 5
    np.testing.assert_allclose(together, each, atol=1e-6)
