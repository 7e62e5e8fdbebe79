"""What is kept of games that are played for a player's decisions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.errors import InvalidInput
from apollonius.evaluate.decisions import decisions
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.observe.registry import observe
from apollonius.replay import as_state


@pytest.mark.parametrize("role", Role)
def test_actions_are_those_of_the_player_in_the_states(role):
    game, player = make_game("paper"), Greedy(make_network("encoded", 16, 2, jax.random.key(3)))
    played = decisions(game, player, role, count=950)
    rows = played.states if role == Role.PURSUER else np.roll(played.states, 4, axis=1)

    def act(row):
        seen = observe(game, as_state(row, jnp.asarray(0)), role, "encoded")
        return seen, player(seen, player.memory, jnp.uint32(0))[0]

    seen, actions = jax.jit(jax.vmap(act))(jnp.asarray(rows))
    assert played.states.shape == (950, 8)
    np.testing.assert_allclose(played.observations, seen, atol=1e-5)
    assert np.mean(played.actions == np.asarray(actions)) > 0.998  # but for ties, which are compiled otherwise here
    # Many games, and more than their beginnings.
    assert len(np.unique(played.states[:100, :2], axis=0)) == 100
    assert played.states[100:, 2].max() > 0.1
    assert (played.states != decisions(game, player, role, count=950, seed=1).states).any()


def test_no_decision_is_none_to_ask_for():
    with pytest.raises(InvalidInput, match="count = 0"):
        decisions(make_game("paper"), Greedy(make_network("paper", 4, 1, jax.random.key(0))), Role.PURSUER, 0)
