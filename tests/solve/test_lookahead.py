"""A search of one hold: what it says is that of plain loops over the rules, and it minds what the network does not."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.evaluate.match import play_match
from apollonius.game.game import reset_batch
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS
from apollonius.game.types import NUM_ACTIONS, Outcome, Role
from apollonius.observe.view import Views, look
from apollonius.solve.lookahead import lookahead
from apollonius.solve.motion import HORIZON
from tests.matches import a_match
from tests.solve.small import MOVING

NETWORK = make_network("encoded", 32, 2, jax.random.key(3))
GAMES = 5
"""As many are played through by hand."""
SCALE = 2.0
HOLD = 10


def player(role, slack=0.0, network=NETWORK):
    return replace(lookahead(Greedy(network), MOVING, role, SCALE), slack=slack)


@pytest.fixture(scope="module")
def starts():
    """Of moving robots close together, so that some holds end games."""
    drawn = jax.jit(reset_batch, static_argnames="games")(MOVING, jax.random.key(1), games=400)
    apart = np.hypot(drawn.pursuer.x - drawn.evader.x, drawn.pursuer.y - drawn.evader.y)
    return jax.tree.map(lambda leaf: leaf[np.argsort(apart)[:100]], drawn)


def by_hand(role, start):
    """What each action is worth by its worst answer: step by step."""
    step = jax.jit(MOVING.step)
    network = eqx.filter_jit(lambda state: NETWORK(NETWORK.observation(look(MOVING, state, role))))
    worst = np.full(NUM_ACTIONS, np.inf)
    for action, answer in np.ndindex(NUM_ACTIONS, NUM_ACTIONS):
        state, outcome = start, Outcome.ONGOING
        pair = (action, answer) if role == Role.PURSUER else (answer, action)
        while int(state.steps) < HOLD and outcome == Outcome.ONGOING:
            after = step(state, *map(jnp.int32, pair))
            state, outcome = after.state, Outcome(int(after.outcome))
        worth = 0.0
        if outcome == Outcome.ONGOING:
            worth = np.clip(np.max(network(replace(state, steps=start.steps))) / SCALE, -1, 1)
        elif outcome in PURSUER_WINS + PURSUER_FAILS:
            worth = 1.0 if (outcome in PURSUER_WINS) == (role == Role.PURSUER) else -1.0
        worst[action] = min(worst[action], worth * np.exp(-float(state.steps) * MOVING.dt / HORIZON))
    return worst


def weighed(player, seen):
    """What a player's actions are worth to it."""
    bits = jnp.zeros(len(seen.states.steps), jnp.uint32)
    return np.asarray(eqx.filter_jit(lambda one: one.weigh_together(seen, bits))(player))


@pytest.mark.parametrize("role", [Role.PURSUER, pytest.param(Role.EVADER, marks=pytest.mark.slow)])
def test_an_action_is_worth_what_its_worst_answer_leaves(starts, role):
    few = [jax.tree.map(lambda leaf: leaf[game], starts) for game in range(GAMES)]  # noqa: B023
    seen = Views(MOVING, jax.tree.map(lambda leaf: leaf[:GAMES], starts), role)
    own = np.asarray(NETWORK.together(NETWORK.observation.together(seen))) / SCALE
    expected = np.stack([by_hand(role, start) for start in few])
    np.testing.assert_allclose(weighed(player(role), seen) - 1e-3 * own, expected, atol=1e-5)
    assert np.any(np.abs(expected) > 0.9), "some holds end games"
    # One game is as many are.
    alone = jax.jit(lambda state: player(role).values(look(MOVING, state, role)))
    np.testing.assert_allclose(
        alone(jax.tree.map(lambda leaf: leaf[0], starts)) - 1e-3 * own[0], expected[0], atol=1e-5
    )


def test_what_is_nearly_as_good_is_left_to_the_network(starts):
    seen = Views(MOVING, starts, Role.EVADER)
    strict, own = weighed(player(Role.EVADER), seen), np.asarray(NETWORK.together(NETWORK.observation.together(seen)))
    chosen = np.argmax(weighed(player(Role.EVADER, slack=0.02), seen), axis=1)
    for game in range(len(chosen)):
        nearly = np.flatnonzero(strict[game] > strict[game].max() - 0.02)
        assert chosen[game] == nearly[np.argmax(own[game, nearly])]
    assert np.any(chosen != np.argmax(strict, axis=1))
    assert np.any(chosen != np.argmax(own, axis=1))


@pytest.mark.slow
def test_it_does_not_run_into_walls_as_its_network_does():
    ahead = eqx.tree_at(lambda network: network.layers[-1], jax.tree.map(jnp.zeros_like, NETWORK), NETWORK.layers[-1])
    ahead = eqx.tree_at(lambda network: network.layers[-1].bias, ahead, jnp.eye(NUM_ACTIONS)[7] / 10)
    still = Still()

    def crashes(evader):
        match = a_match(replace(MOVING, max_steps=100), still, evader, games=200)
        return play_match(match).outcomes["no_result"] / match.games

    bare, looking = Greedy(ahead), player(Role.EVADER, network=ahead)
    assert crashes(bare) < 0.05
    assert crashes(looking) > 0.5
