"""Slices show the network's own values, place by place, for either side."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, RobotState, Role
from apollonius.observe.view import look
from apollonius.show.slices import _TURNS, _draw_actions, slice_values

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


def test_the_turn_of_the_best_action_is_a_colour_and_its_acceleration_a_sign():
    places = np.arange(32.0)
    best = (places // 11 + 3 * (places[:, None] // 11)).astype(int)
    values = np.eye(9)[best]
    values[:2] = np.nan
    axes = Figure().subplots()
    _draw_actions(axes, (places, places, values))
    (mesh,), chosen = axes.collections, np.arange(1, 32, 2)
    colours, turns = mesh.to_rgba(mesh.get_array()), [to_rgba(colour) for colour in _TURNS.values()]
    np.testing.assert_allclose(colours[2:], np.array(turns)[best % 3][2:])
    assert mesh.get_array().mask[:2].all()
    for level, line in enumerate(axes.lines):
        rows, columns = np.nonzero(best[np.ix_(chosen, chosen)][1:] // 3 == level)
        np.testing.assert_array_equal(line.get_xydata(), np.stack([chosen[columns], chosen[rows + 1]], axis=1))
