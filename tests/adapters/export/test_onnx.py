"""The ONNX model: its batch, its header, and what it says of itself."""

import json

import numpy as np
import onnx
import onnxruntime
import pytest

from apollonius.adapters.export.onnx import make_model, make_network
from tests.adapters.export.conftest import CONTINUOUS, ONE_OF_EACH


def run(model, name, batch):
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {name: batch})


def test_a_batch_of_any_size_is_decided_as_its_states_are(case):
    model = make_model(case.blueprint)
    broken = case.states.copy()
    broken[::7, 3] = np.nan
    action, controls = run(model, "state", broken)
    assert action.dtype == np.int64
    assert controls.dtype == np.float32
    np.testing.assert_array_equal(action, np.where(np.arange(len(broken)) % 7 == 0, 1, case.actions))
    np.testing.assert_array_equal(controls, case.blueprint.controls[action])
    assert [part.shape for part in run(model, "state", broken[:0])] == [(0,), (0, 2)]


@pytest.mark.parametrize("case", CONTINUOUS, indirect=True)
def test_a_continuous_ones_only_output_is_controls_for_a_batch_of_any_size(case):
    model = make_model(case.blueprint)
    broken = case.states.copy()
    broken[::7, 3] = np.nan
    (controls,) = run(model, "state", broken)
    assert controls.dtype == np.float32
    brake = np.float32([-case.blueprint.own.u1_max, 0])
    np.testing.assert_allclose(
        controls, np.where(np.arange(len(broken))[:, None] % 7 == 0, brake, case.controls), atol=1e-5
    )
    assert [output.name for output in model.graph.output] == ["controls"]
    assert [part.shape for part in run(model, "state", broken[:0])] == [(0, 2)]


@pytest.mark.parametrize("case", ONE_OF_EACH[2:], indirect=True)
def test_a_continuous_network_alone_says_gears(case):
    (gears,) = run(make_network(case.blueprint), "observation", case.observations)
    np.testing.assert_allclose(gears, case.actions, atol=1e-5)


def test_the_network_alone_decides_the_same_from_observations(case):
    (action,) = run(make_network(case.blueprint), "observation", case.observations)
    np.testing.assert_array_equal(action, case.actions)


@pytest.mark.parametrize("case", ONE_OF_EACH, indirect=True)
def test_it_says_what_it_is(case):
    model = onnx.load_from_string(make_model(case.blueprint).SerializeToString())
    assert [(opset.domain, opset.version) for opset in model.opset_import] == [("", 17)]
    said = {entry.key: entry.value for entry in model.metadata_props}
    header = case.blueprint.header
    assert [said[name] for name in ("format", "role", "observation", "network")] == [
        "apollonius-agent",
        header.role,
        header.observation,
        "gaussian" if case.blueprint.continuous else "values",
    ]
    assert json.loads(said["game"])["arena"]["x_max"] == case.blueprint.game.arena.x_max
    assert "own x, own y, own v, own heading, opponent x" in model.doc_string
