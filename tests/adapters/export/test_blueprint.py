"""What cannot be exported is refused."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.adapters.export.blueprint import identifier, make_blueprint
from apollonius.agents.store import describe
from apollonius.errors import InvalidInput
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.types import Role
from tests.adapters.export.conftest import small_actor, small_network

AGENT = describe(small_network("paper"), Role.EVADER, {}, {})


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (Unicycle(v_min=0.1), "v_min = 0.1 .* braking"),
        (Unicycle(v_min=-0.5), "v_min = -0.5 .* at rest"),
        (Unicycle(u1_max=0.0), "u1_max = 0.0 .* cannot brake"),
    ],
)
def test_a_robot_that_cannot_brake_to_rest_is_refused(body, message):
    with pytest.raises(InvalidInput, match=message):
        make_blueprint("E", AGENT, Game(evader=body))
    assert make_blueprint("E", AGENT, Game(pursuer=body)).own.v_max == 1.2  # the opponent's limits are its own affair


@pytest.mark.parametrize("broken", [jnp.nan, -jnp.inf])
def test_a_network_that_went_astray_is_refused(broken):
    network = eqx.tree_at(lambda net: net.layers[1].bias, AGENT.network, replace_fn=lambda bias: bias.at[0].set(broken))
    with pytest.raises(InvalidInput, match="weights = NaN or infinite"):
        make_blueprint("E", dataclasses.replace(AGENT, network=network), Game())


def test_of_a_continuous_policy_the_spreads_are_left_out():
    actor = small_actor("paper")
    other = eqx.tree_at(lambda net: net.layers[-1].bias, actor, replace_fn=lambda bias: bias.at[2:].add(1.0))
    one, two = (make_blueprint("E", describe(net, Role.EVADER, {}, {}), Game()) for net in (actor, other))
    assert one.layers[-1][0].shape == (2, 21)
    for (weight, bias), (same_weight, same_bias) in zip(one.layers, two.layers, strict=True):
        np.testing.assert_array_equal(weight, same_weight)
        np.testing.assert_array_equal(bias, same_bias)


def test_clearances_from_polygons_are_refused_and_not_left_out():
    game = Game(arena=Arena(polygons=(Polygon(((4.0, 4.0), (6.0, 4.0), (5.0, 6.0))),)))
    with pytest.raises(InvalidInput, match=r"obstacles = Polygon .* discs, the only"):
        make_blueprint("E", describe(small_network("encoded"), Role.EVADER, {}, {}), game)
    assert make_blueprint("E", AGENT, game).discs == []


def test_a_policy_is_called_as_its_file(tmp_path):
    assert identifier(tmp_path / "P_pool2.c") == "P_pool2"


@pytest.mark.parametrize("file", ["3.c", "_.c", "ü.c", "best-of.c", "a.b.c", 'a"b.c', "a b.c", "a\n.c"])
def test_a_file_that_nothing_can_be_called_after_is_refused(tmp_path, file):
    with pytest.raises(InvalidInput, match="begins with a letter"):
        identifier(tmp_path / file)


def test_no_agents_name_gets_out_of_a_comment():
    assert make_blueprint('a"""; */\n\\b-1.2', AGENT, Game()).agent == "a_________b-1.2"
