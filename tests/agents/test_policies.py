"""Who acts: each player keeps the rule it is named for."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from apollonius.agents.classical import Still, Uniform, uniform_action
from apollonius.agents.greedy import EpsilonGreedy, Greedy
from apollonius.agents.network import make_network
from apollonius.game.presets import make_game
from apollonius.game.types import NUM_ACTIONS, GameState, RobotState
from tests.acting import act

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


def play_still(v, steps):
    """Where a robot that plays `Still` is after a number of steps, from (1, 5) heading 0.5 rad."""
    game = make_game("paper")
    start = RobotState(*jnp.array([1.0, 5.0, v, 0.5]))
    action = act(Still(), NOTHING, WORDS[0])
    move = jax.jit(lambda state: game.step(state, action, action).state)
    state = GameState.of_two(start, start, jnp.asarray(0))
    for _ in range(steps):
        state = move(state)
    return start, state.evader


def test_still_brakes_straight_ahead_when_it_moves():
    start, end = play_still(v=0.6, steps=30)
    braking = 0.6**2 / (2 * 0.3)
    assert end.v == 0, "and it stays where it rests"
    assert end.heading == start.heading
    np.testing.assert_allclose(end.x - start.x, braking * np.cos(0.5), atol=1e-5)
    np.testing.assert_allclose(end.y - start.y, braking * np.sin(0.5), atol=1e-5)


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
