"""Observations as programs that leave the package make them: each is the one of `apollonius.observe`, number by number.

In C, ONNX and on the page; on many states in and around several arenas, from either side.
"""

import ctypes
import shutil
import subprocess

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from onnx import TensorProto, helper

from apollonius.adapters.export import c
from apollonius.adapters.export.blueprint import make_blueprint
from apollonius.adapters.export.features import INPUTS, encoded, paper
from apollonius.adapters.export.graph import Graph, matrix
from apollonius.adapters.export.onnx import _model, _session
from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.record import to_dict
from apollonius.game.dynamics import wrap_angle
from apollonius.game.game import Game
from apollonius.game.types import GameState, RobotState, Role
from apollonius.observe.registry import OBSERVATIONS
from apollonius.observe.view import look
from tests.adapters.export.conftest import GAMES, some_states
from tests.web.test_rules_in_javascript import ask

EXPORTED = [name for name, one in OBSERVATIONS.items() if one.exported and not one.charted]
SEE = """
void see(const float *s, float *seen)
{
    const robot own = {s[0], s[1], s[2], s[3]}, opponent = {s[4], s[5], s[6], s[7]};
    observe(own, opponent, seen);
}
"""


def in_c(blueprint, agent, states, folder):
    (source, text), (header, said) = c.make_files(blueprint, folder / "policy.c").items()
    source.write_bytes(text + SEE.encode())
    header.write_bytes(said)
    library = folder / "policy.so"
    subprocess.run(["gcc", "-std=c99", "-shared", "-fPIC", str(source), "-lm", "-o", str(library)], check=True)
    see, numbers = ctypes.CDLL(str(library)).see, np.zeros((len(states), blueprint.header.observation_size), np.float32)
    for state, row in zip(states, numbers, strict=True):
        see(ctypes.c_void_p(state.ctypes.data), ctypes.c_void_p(row.ctypes.data))
    return numbers


def in_onnx(blueprint, agent, states, folder):
    graph = Graph(columns={"state": INPUTS})
    features, rows = {"encoded": encoded, "paper": paper}[blueprint.header.observation](graph, blueprint)
    factors, constants = matrix(graph.columns[features], rows)
    output = helper.make_tensor_value_info(features, TensorProto.FLOAT, ["batch", len(factors[0])])
    session = _session(_model(graph, "state", len(INPUTS), [output]).SerializeToString())
    return session.run(None, {"state": states})[0] @ factors.T + constants


def on_the_page(blueprint, agent, states, folder):
    if shutil.which("node") is None:
        pytest.skip("needs node")
    save_agent(agent, folder / "agent.safetensors")
    asked = {"path": str(folder / "agent.safetensors"), "game": to_dict(blueprint.game), "role": agent.header.role}
    turned = states.copy()
    turned[:, 3::4] = jax.vmap(jax.vmap(wrap_angle))(
        jnp.asarray(states[:, 3::4])
    )  # as the rules have them; the pursuer is first there
    return ask(agent=asked, positions=np.roll(turned, 4, axis=1).tolist())["observed"]


@pytest.mark.parametrize("elsewhere", [in_c, in_onnx, on_the_page])
@pytest.mark.parametrize("name", EXPORTED)
def test_each_version_of_an_observation_is_the_packages(elsewhere, name, tmp_path):
    agent = describe(make_network(name, 4, 1, jax.random.key(0)), Role.EVADER, {}, {})
    for where, game in GAMES.items():
        folder, states = tmp_path / where, some_states(game, 1000)
        folder.mkdir()
        seen = elsewhere(make_blueprint("small", agent, game), agent, states, folder)
        np.testing.assert_allclose(seen, packages(game, name, states), atol=2e-5, err_msg=where)


def packages(game: Game, name: str, states: np.ndarray) -> np.ndarray:
    """What the evader sees; the first four numbers of a state are its own."""

    @jax.jit
    @jax.vmap
    def see(row):
        own, opponent = (
            RobotState(x, y, v, wrap_angle(heading)) for x, y, v, heading in (tuple(row[:4]), tuple(row[4:]))
        )
        return OBSERVATIONS[name](look(game, GameState.of_two(opponent, own, jnp.int32(0)), Role.EVADER))

    return np.asarray(see(jnp.asarray(states)))
