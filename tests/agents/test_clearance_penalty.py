"""A player with a clearance penalty: its values, its file, and its place in a pool."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.names import ZOO
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.agents.trained import Greedy, agent_policy
from apollonius.agents.wrappers.clearance_penalty import COST, ClearancePenalty
from apollonius.catalogue import find_pool
from apollonius.game.presets import make_game
from apollonius.game.types import NUM_ACTIONS, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.egocentric import BRAKING, EGOCENTRIC, ROOM
from apollonius.observe.team import TEAM
from tests.acting import act, act_in_rows

BITS = jnp.uint32(0)


def observations(size, rows=200):
    return jax.random.uniform(jax.random.key(1), (rows, size), minval=-1, maxval=1)


@pytest.mark.parametrize("observation", [EGOCENTRIC, TEAM])
def test_each_action_costs_its_missing_clearance(observation):
    inner = Greedy(make_network(observation.name, 32, 2, jax.random.key(0)))
    player, rows = ClearancePenalty(inner, 0.06, 2.0), observations(observation.size)
    missing = np.maximum(0.06 - ROOM * np.asarray(rows)[:, BRAKING : BRAKING + NUM_ACTIONS], 0)
    assert 0.3 < np.mean(missing > 0) < 0.8
    values = jax.vmap(player.values)(rows)
    np.testing.assert_allclose(values, jax.vmap(inner.values)(rows) - 2 * COST * missing, atol=2e-5)
    assert player.observation is observation
    best = jax.vmap(lambda row: act(player, row, BITS))(rows)
    np.testing.assert_array_equal(best, np.argmax(values, axis=1))


def test_agent_plays_with_the_margin_of_its_header(tmp_path):
    network = make_network("egocentric", 8, 1, jax.random.key(0))
    files = [tmp_path / "plain.safetensors", tmp_path / "careful.safetensors"]
    for file, margin in zip(files, (0.0, 0.05), strict=True):
        save_agent(describe(network, Role.EVADER, {}, {}, clearance_margin=margin, loss_value=3.0), file)
    plain, careful = (agent_policy(load_agent(file)) for file in files)
    assert isinstance(plain, Greedy)
    assert (careful.margin, careful.loss_value) == (0.05, 3.0)
    (pressed,) = jnp.zeros((1, EGOCENTRIC.size)).at[:, BRAKING : BRAKING + NUM_ACTIONS].set(-1.0)
    np.testing.assert_allclose(plain.values(pressed) - careful.values(pressed), 3 * COST * 0.35, rtol=1e-4)


@pytest.mark.parametrize(
    ("network", "loss_value", "message"),
    [
        (make_network("egocentric", 4, 1, jax.random.key(0)), None, "loss_value = missing"),
        (make_network("encoded", 4, 1, jax.random.key(0)), 1.0, "clearance_margin = 0.05 .*reads 'encoded'"),
        (make_actor("egocentric", 4, 1, jax.random.key(0)), 1.0, "clearance_margin = 0.05 .*does not value actions"),
    ],
)
def test_margin_without_values_clearances_or_unit_is_refused(network, loss_value, message, tmp_path):
    path = tmp_path / "agent.safetensors"
    save_agent(describe(network, Role.EVADER, {}, {}, clearance_margin=0.05, loss_value=loss_value), path)
    with pytest.raises(InvalidInput, match=message):
        load_agent(path)


def test_pool_keeps_the_margin_of_each_player(tmp_path):
    files = [str(tmp_path / f"{number}.safetensors") for number in range(2)]
    for number, (file, margin) in enumerate(zip(files, (0.0, 0.2), strict=True)):
        network = make_network("egocentric", 8, 1, jax.random.key(number))
        save_agent(describe(network, Role.EVADER, {}, {}, clearance_margin=margin, loss_value=3.0), tmp_path / file)
    pool, rows = find_pool([*files, "random", "still"], Role.EVADER, make_game("paper")), observations(EGOCENTRIC.size)
    bits, acts = jax.random.bits(jax.random.key(2), (len(rows),)), jax.jit(act_in_rows)
    actions = [np.asarray(acts(pool, jnp.full(len(rows), member), rows, bits)) for member in range(4)]
    for member, file in enumerate(files):
        player = agent_policy(load_agent(tmp_path / file))
        np.testing.assert_array_equal(actions[member], jax.vmap(lambda row, one=player: act(one, row, BITS))(rows))
    assert np.bincount(actions[2], minlength=NUM_ACTIONS).min() > 5
    assert (actions[3] == 1).all()


@pytest.mark.parametrize("name", ["pursuer", "evader"])
def test_agents_for_any_arena_keep_five_centimetres(name):
    policy = agent_policy(load_agent(ZOO / f"{name}.safetensors"))
    assert (policy.margin, policy.loss_value) == (0.05, 500.0)
