"""Slices show the network's own values, place by place, for either side."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, RobotState, Role
from apollonius.observe.view import look
from apollonius.show.slices import slice_values

OPPONENT = RobotState(*map(jnp.float32, (7.5, 7.0, 0.4, -1.0)))
OWN = (0.6, 0.8)


@pytest.fixture
def network():
    return make_network("encoded", width=8, depth=2, key=jax.random.key(1))


@pytest.mark.parametrize("role", Role)
def test_every_cell_has_the_networks_values_there(network, role):
    game = make_game("paper")
    x, y, values = slice_values(Greedy(network), game, role, OWN, OPPONENT, cells=8)
    np.testing.assert_allclose(x, np.arange(8) * 1.25 + 0.625)
    assert values.shape == (8, 8, 9)
    for row, column in ((0, 0), (2, 5), (7, 1)):
        own = RobotState(*map(jnp.float32, (x[column], y[row], *OWN)))
        pursuer, evader = (own, OPPONENT) if role == Role.PURSUER else (OPPONENT, own)
        observation = network.observation(look(game, GameState.of_two(pursuer, evader, jnp.int32(0)), role))
        np.testing.assert_allclose(values[row, column], network(observation), atol=1e-5)


def test_there_is_no_value_where_the_body_cannot_be(network):
    game = make_game("robot")
    x, y, values = slice_values(Greedy(network), game, Role.PURSUER, OWN, OPPONENT, cells=200)
    missing = np.isnan(values[..., 0])
    x, y = np.meshgrid(x, y)
    for disc in game.arena.discs:
        away = np.hypot(x - disc.x, y - disc.y)
        assert missing[away < disc.radius + 0.14].all()
        assert not missing[(away > disc.radius + 0.2) & (away < disc.radius + 0.5)].any()
    assert missing[0].all()
    assert not missing[10, 10]
