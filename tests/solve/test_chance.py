"""Responses to opponents that act by chance: they know how often which action comes, not what a dice showed once."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.greedy import EpsilonGreedy, Greedy
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.policy import acts_by_chance
from apollonius.agents.squashed import SquashedGaussian, SquashedMean
from apollonius.agents.uniform import Uniform
from apollonius.catalogue import find_player
from apollonius.game.game import reset_batch
from apollonius.game.types import NUM_ACTIONS, Role
from apollonius.observe.view import look
from apollonius.solve.foresight import ResponsePolicy
from apollonius.solve.grid import lanes_of, make_grid
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.response import make_response, solve_response
from apollonius.solve.zero_sum_game import make_zero_sum_game
from tests.acting import of_views
from tests.solve.small import BODY, MOVING, SMALL

GRID = make_grid(SMALL.arena, BODY, (3, 4, 2, 5))
CONTEST = make_zero_sum_game(SMALL, (GRID, GRID), 10, Role.PURSUER, "win")
NOTHING = jnp.zeros((GRID.size // lanes_of(GRID), GRID.size, lanes_of(GRID)))
"""A table that knows nothing of what comes after the hold."""
AHEAD, TURNING_BACK = 7, 0
"""The action that accelerates straight ahead; the one that brakes in a turn, which random bits 0 draws."""


def always(action):
    """A network that thinks one action best, whatever it sees."""
    network = make_network("paper", 4, 1, jax.random.key(0))
    zero = jax.tree.map(jnp.zeros_like, network)
    return jax.tree.map(lambda leaf: leaf.at[action].set(1.0) if leaf.shape == (NUM_ACTIONS,) else leaf, zero)


@pytest.fixture(scope="module")
def starts():
    return jax.jit(reset_batch, static_argnames="games")(MOVING, jax.random.key(0), games=400)


def promised(opponent, starts):
    """What a response to an evader sees for itself within the hold."""
    return np.asarray(ResponsePolicy(CONTEST, NOTHING, opponent).best_value(starts))


def test_an_agent_that_hardly_ever_explores_looks_no_safer_than_one_that_never_does(starts):
    """Asked with random bits 0 it would seem to explore always, and by one and the same action."""
    sure, misled = (promised(Greedy(always(action)), starts) for action in (AHEAD, TURNING_BACK))
    assert np.mean(np.abs(sure - misled)) > 0.02
    rarely = promised(EpsilonGreedy(always(AHEAD), jnp.asarray(1e-4)), starts)
    assert np.mean(np.abs(rarely - sure)) < 0.002


def test_what_comes_by_chance_counts_as_often_as_it_comes(starts):
    """A hold of one step, so that the mean over nine actions is known."""
    zero_sum_game = make_zero_sum_game(SMALL, (GRID, GRID), 1, Role.PURSUER, "win")
    table = jax.random.uniform(jax.random.key(1), NOTHING.shape)
    robots = jax.tree.map(lambda leaf: jnp.tile(leaf[:20], 60), (starts.pursuer, starts.evader))
    bits = jax.random.bits(jax.random.key(0), (20 * 60,), jnp.uint32)

    @jax.jit
    def action_values(network):
        return ResponsePolicy(zero_sum_game, table, Greedy(network)).action_values(*robots, bits)

    known = np.mean([action_values(always(action))[:, :20] for action in range(NUM_ACTIONS)], axis=0)
    random = ResponsePolicy(zero_sum_game, table, Uniform())
    drawn = np.asarray(jax.jit(lambda bits: random.action_values(*robots, bits))(bits)).reshape(9, 60, 20)
    assert np.max(np.std(drawn, axis=1)) > 1e-3
    np.testing.assert_allclose(np.mean(drawn, axis=1), known, atol=0.02)


def test_whether_the_random_word_matters_is_read_from_the_program():
    network, actor = always(0), make_actor("paper", 4, 1, jax.random.key(0))
    drawn = EpsilonGreedy(network, jnp.asarray(0.0)), SquashedGaussian(actor, jnp.asarray(1.0)), Uniform()
    view = look(SMALL, SMALL.reset(jax.random.key(0)), Role.EVADER)
    assert all(acts_by_chance(policy, view) for policy in drawn)
    assert not any(acts_by_chance(policy, view) for policy in (Greedy(network), SquashedMean(actor)))
    shielded = {name: find_player(f"shielded:{name}", Role.EVADER, SMALL).policy for name in ("random", "flee")}
    assert [acts_by_chance(policy, view) for policy in shielded.values()] == [True, False]


@pytest.mark.slow
def test_on_the_grid_chance_that_never_comes_changes_nothing():
    zero_sum_game = make_zero_sum_game(SMALL, (GRID, GRID), 5, Role.EVADER, "win")
    never, always_ahead = EpsilonGreedy(always(AHEAD), jnp.asarray(0.0)), Greedy(always(AHEAD))
    by_chance, sure, drawn = (
        np.asarray(solve_response(make_response(zero_sum_game, opponent)).table)
        for opponent in (never, always_ahead, EpsilonGreedy(always(AHEAD), jnp.asarray(1.0)))
    )
    np.testing.assert_allclose(by_chance, sure, atol=1e-6)
    assert np.mean(np.abs(drawn - sure)) > 1e-3


@pytest.mark.slow
def test_a_batch_of_games_is_decided_as_one_game_after_the_other(starts):
    """Also where every game has a player of its own."""
    players = [SaddlePolicy(CONTEST, NOTHING + level) for level in (0.0, 0.5)]
    few = jax.tree.map(lambda leaf: leaf[:4], starts)
    states = [jax.tree.map(lambda leaf, i=i: leaf[i], few) for i in range(4)]
    together = np.asarray(of_views(players[1].values, SMALL, few, Role.PURSUER))
    alone = jax.jit(lambda player, state: player.values(look(SMALL, state, Role.PURSUER)))
    np.testing.assert_allclose(together, [alone(players[1], state) for state in states], atol=1e-5)
    both = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *players)
    first = jax.tree.map(lambda leaf: leaf[:2], few)
    own = np.asarray(of_views(lambda view, player: player.values(view), SMALL, first, Role.PURSUER, both))
    np.testing.assert_allclose(
        own, [alone(player, state) for player, state in zip(players, states[:2], strict=True)], atol=1e-5
    )
