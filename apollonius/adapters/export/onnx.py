"""A policy as an ONNX model: observation, network and choice in one graph, the batch free.

The observation's linear parts are in the weights of the network's first layer.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32
from onnx import ModelProto, TensorProto, ValueInfoProto, checker, helper

from apollonius.adapters.export.blueprint import FALLBACK, FALLBACK_GEARS, LARGEST, Blueprint
from apollonius.adapters.export.egocentric import egocentric
from apollonius.adapters.export.features import INPUTS, encoded, paper
from apollonius.adapters.export.graph import Graph, Layers, matrix
from apollonius.adapters.export.parity import Answer, CannotRun, Decide
from apollonius.errors import install

SUFFIX = ".onnx"
OPSET = 17
"""Of June 2022: onnxruntime 1.12 and later."""
IR_VERSION = 8
_ERRORS = 3
"""What onnxruntime tells from: it else warns of each part of a chart that it can be given another."""
_OBSERVATIONS = {"paper": paper, "encoded": encoded, "egocentric": egocentric}


def make_files(blueprint: Blueprint, out: Path) -> dict[Path, bytes]:
    """The file."""
    return {out: make_model(blueprint).SerializeToString()}


def load(model: Path) -> Decide:
    """The model in onnxruntime.

    Raises:
        CannotRun: where that is not installed.
    """
    session = _session(model.read_bytes())

    def decide(state: Float32[np.ndarray, "8"]) -> Answer:
        outputs = session.run(None, {"state": state[None]})
        return tuple(number for output in outputs for number in output.ravel().tolist())

    return decide


def load_network(
    blueprint: Blueprint, entries: Mapping[str, str] | None = None
) -> Callable[[Float32[np.ndarray, " size"]], int | list[float]]:
    """The network alone in onnxruntime, an observation in and an action or gears out: by this all formats are measured.

    Args:
        entries: of the session's configuration, as onnxruntime names them.

    Raises:
        CannotRun: where that is not installed.
    """
    session = _session(make_network(blueprint).SerializeToString(), entries)
    return lambda observation: session.run(None, {"observation": observation[None]})[0][0].tolist()


def _session(model: bytes, entries: Mapping[str, str] | None = None) -> Any:
    """One thread: a second is of no use to a single decision."""
    try:
        import onnxruntime
    except ModuleNotFoundError as error:
        raise CannotRun(f"onnxruntime is not installed: {install('export')}") from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = _ERRORS
    for key, value in (entries or {}).items():
        options.add_session_config_entry(key, value)
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def make_model(blueprint: Blueprint) -> ModelProto:
    """The model: `state` float32 [batch, 8] in, `controls` float32 [batch, 2] out.

    A discrete policy has another output before it: `action` int64 [batch]. The arrays of a chart (`chart_file.PARTS`)
    are inputs of a policy that reads one; they need not be given in the arena that the model was made for.
    """
    graph = Graph(columns={"state": INPUTS})
    encode = _OBSERVATIONS[blueprint.header.observation]
    features, observation = encode(graph, blueprint)
    (weight, bias), *others = blueprint.layers
    factors, constants = matrix(graph.columns[features], observation)
    first = (weight.astype(float) @ factors, bias + weight.astype(float) @ constants)
    outputs = (_steer if blueprint.continuous else _choose)(graph, blueprint, features, [first, *others])
    model = _model(graph, "state", len(INPUTS), outputs)
    model.doc_string = f"input state: {', '.join(INPUTS)} [m, m/s, rad]; output controls: u1 [m/s^2], u2 [rad/s]"
    helper.set_model_props(model, blueprint.metadata())
    return model


def make_network(blueprint: Blueprint) -> ModelProto:
    """The network alone: `observation` in, `action` or `gears` out."""
    graph, layers = Graph(), [*blueprint.layers]
    if blueprint.continuous:
        graph.add("Tanh", [graph.network("observation", layers, "means")], "gears")
        output = helper.make_tensor_value_info("gears", TensorProto.FLOAT, ["batch", 2])
    else:
        graph.add("ArgMax", [graph.network("observation", layers, "values")], "action", axis=1, keepdims=0)
        output = helper.make_tensor_value_info("action", TensorProto.INT64, ["batch"])
    return _model(graph, "observation", blueprint.header.observation_size, [output])


def _choose(graph: Graph, blueprint: Blueprint, features: str, layers: Layers) -> list[ValueInfoProto]:
    """The action of highest value and its controls: the outputs of a discrete policy."""
    values = graph.network(features, layers, "values")
    known = _known(graph, keepdims=0)
    best = graph.add("ArgMax", [values], "best", axis=1, keepdims=0)
    action = graph.add("Where", [known, best, np.array(FALLBACK)], "action")
    graph.add("Gather", [blueprint.controls, action], "controls")
    return [helper.make_tensor_value_info("action", TensorProto.INT64, ["batch"]), _controls()]


def _steer(graph: Graph, blueprint: Blueprint, features: str, layers: Layers) -> list[ValueInfoProto]:
    """The shares of the largest controls that the network means: the output of a continuous policy."""
    best = graph.add("Tanh", [graph.network(features, layers, "means")], "best")
    known = _known(graph, keepdims=1)
    gears = graph.add("Where", [known, best, np.array(FALLBACK_GEARS, np.float32)], "gears")
    graph.add("Mul", [gears, blueprint.largest_controls], "controls")
    return [_controls()]


def _known(graph: Graph, keepdims: int) -> str:
    """Whether a state can be, [batch] or, with `keepdims`, [batch, 1]."""
    square = graph.add("ReduceSumSquare", ["state"], "square", axes=[1], keepdims=keepdims)
    return graph.add("LessOrEqual", [square, np.array(LARGEST**2, np.float32)], "known")


def _controls() -> ValueInfoProto:
    return helper.make_tensor_value_info("controls", TensorProto.FLOAT, ["batch", 2])


def _model(graph: Graph, name: str, size: int, outputs: list[ValueInfoProto]) -> ModelProto:
    inputs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", size])]
    inputs += [helper.make_tensor_value_info(part.name, part.data_type, part.dims) for part in graph.given]
    drawn = helper.make_graph(graph.nodes, "policy", inputs, outputs, graph.constants + graph.given)
    opset = [helper.make_opsetid("", OPSET)]
    model = helper.make_model(drawn, producer_name="apollonius", opset_imports=opset, ir_version=IR_VERSION)
    checker.check_model(model, full_check=True)
    return model
