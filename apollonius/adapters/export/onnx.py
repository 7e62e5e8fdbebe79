"""A policy as an ONNX model: observation, network and choice in one graph, the batch free.

A node costs onnxruntime a quarter of a microsecond whatever it computes, and the whole network some 13. So the
observation (`apollonius.game.observation`) is a few products of matrices and not formula by formula, and its linear
parts are in the weights of the network's first layer.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32
from onnx import ModelProto, TensorProto, checker, helper

from apollonius.adapters.export.blueprint import FALLBACK, LARGEST, STATE, Blueprint, Body
from apollonius.adapters.export.graph import ONE, Graph, Row, matrix
from apollonius.adapters.export.parity import CannotRun, Decide

SUFFIX = ".onnx"
OPSET = 17
"""Of June 2022: onnxruntime 1.12 and later."""
IR_VERSION = 8
SIDES = ("own", "opponent")
INPUTS = [f"{side} {what}" for side in SIDES for what in STATE]


def make_files(blueprint: Blueprint, out: Path) -> dict[Path, bytes]:
    """The file."""
    return {out: make_model(blueprint).SerializeToString()}


def load(model: Path) -> Decide:
    """The model in onnxruntime.

    Raises:
        CannotRun: where that is not installed.
    """
    session = _session(model.read_bytes())

    def decide(state: Float32[np.ndarray, "8"]) -> tuple[int, float, float]:
        action, controls = session.run(None, {"state": state[None]})
        return int(action[0]), float(controls[0, 0]), float(controls[0, 1])

    return decide


def load_network(
    blueprint: Blueprint, entries: Mapping[str, str] | None = None
) -> Callable[[Float32[np.ndarray, " size"]], int]:
    """The network alone in onnxruntime, an observation in and an action out: by this all formats are measured.

    Args:
        entries: of the session's configuration, as onnxruntime names them.

    Raises:
        CannotRun: where that is not installed.
    """
    session = _session(make_network(blueprint).SerializeToString(), entries)
    return lambda observation: int(session.run(None, {"observation": observation[None]})[0][0])


def _session(model: bytes, entries: Mapping[str, str] | None = None) -> Any:
    """One thread: a second is of no use to a single decision."""
    try:
        import onnxruntime
    except ModuleNotFoundError as error:
        raise CannotRun("onnxruntime is not installed: pip install 'apollonius[export]'") from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    for key, value in (entries or {}).items():
        options.add_session_config_entry(key, value)
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def make_model(blueprint: Blueprint) -> ModelProto:
    """The model: `state` float32 [batch, 8] in, `action` int64 [batch] and `controls` float32 [batch, 2] out."""
    graph = Graph(columns={"state": INPUTS})
    encode = _encoded if blueprint.header.observation == "encoded" else _paper
    features, observation = encode(graph, blueprint)
    (weight, bias), *others = blueprint.layers
    factors, constants = matrix(graph.columns[features], observation)
    first = (weight.astype(float) @ factors, bias + weight.astype(float) @ constants)
    values = graph.network(features, [first, *others], "values")

    square = graph.add("ReduceSumSquare", ["state"], "square", axes=[1], keepdims=0)
    known = graph.add("LessOrEqual", [square, np.array(LARGEST**2, np.float32)], "known")
    best = graph.add("ArgMax", [values], "best", axis=1, keepdims=0)
    action = graph.add("Where", [known, best, np.array(FALLBACK)], "action")
    graph.add("Gather", [blueprint.controls, action], "controls")
    outputs = [
        helper.make_tensor_value_info("action", TensorProto.INT64, ["batch"]),
        helper.make_tensor_value_info("controls", TensorProto.FLOAT, ["batch", 2]),
    ]
    model = _model(graph, "state", len(INPUTS), outputs)
    model.doc_string = f"input state: {', '.join(INPUTS)} [m, m/s, rad]; output controls: u1 [m/s^2], u2 [rad/s]"
    helper.set_model_props(model, blueprint.metadata())
    return model


def make_network(blueprint: Blueprint) -> ModelProto:
    """The network alone: `observation` in, `action` out."""
    graph = Graph()
    values = graph.network("observation", [*blueprint.layers], "values")
    graph.add("ArgMax", [values], "action", axis=1, keepdims=0)
    size = blueprint.header.observation_size
    return _model(graph, "observation", size, [helper.make_tensor_value_info("action", TensorProto.INT64, ["batch"])])


def _model(graph: Graph, name: str, size: int, outputs: list[Any]) -> ModelProto:
    inputs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", size])]
    drawn = helper.make_graph(graph.nodes, "policy", inputs, outputs, graph.constants)
    opset = [helper.make_opsetid("", OPSET)]
    model = helper.make_model(drawn, producer_name="apollonius", opset_imports=opset, ir_version=IR_VERSION)
    checker.check_model(model, full_check=True)
    return model


def _scaled(low: float, high: float, name: str) -> Row:
    """From [low, high] to [-1, 1]."""
    span = max(high - low, 1e-6)
    return {name: 2 / span, ONE: -(low + high) / span}


def _position_and_speed(blueprint: Blueprint, body: Body, side: str) -> list[Row]:
    x_min, x_max, y_min, y_max = blueprint.walls
    return [
        _scaled(x_min, x_max, f"{side} x"),
        _scaled(y_min, y_max, f"{side} y"),
        _scaled(body.v_min, body.v_max, f"{side} v"),
    ]


def _minus(row: Row) -> Row:
    return {name: -factor for name, factor in row.items()}


def _opponent_from_own(blueprint: Blueprint) -> tuple[Row, Row]:
    """The opponent's position, less the own robot's, over the arena's longer side."""
    x_min, x_max, y_min, y_max = blueprint.walls
    size = max(x_max - x_min, y_max - y_min)
    dx, dy = ({f"opponent {axis}": 1 / size, f"own {axis}": -1 / size} for axis in "xy")
    return dx, dy


def _paper(graph: Graph, blueprint: Blueprint) -> tuple[str, list[Row]]:
    """A tensor, and the `paper` observation's eight numbers as linear in its columns."""
    beyond = {f"{side} turns": {f"{side} heading": 1.0, ONE: -math.pi} for side in SIDES}
    ratio = graph.add("Div", [graph.linear("state", "beyond", beyond), np.array([2 * math.pi], np.float32)], "ratio")
    graph.add("Ceil", [ratio], "turns", [*beyond])
    observation = []
    for side, body in zip(SIDES, (blueprint.own, blueprint.opponent), strict=True):
        heading = {f"{side} heading": 1 / math.pi, f"{side} turns": -2.0}
        observation += [*_position_and_speed(blueprint, body, side), heading]
    return graph.join(["state", "turns"], "features"), observation


def _encoded(graph: Graph, blueprint: Blueprint) -> tuple[str, list[Row]]:
    """A tensor, and the `encoded` observation's seventeen numbers as linear in its columns."""
    known = graph.join(["state", *_products(graph, blueprint)], "known columns")
    bodies = dict(zip(SIDES, (blueprint.own, blueprint.opponent), strict=True))
    # Where each robot is, and where braking straight ahead would stop it.
    points: dict[str, tuple[Row, Row]] = {}
    for side in SIDES:
        here: list[Row] = [{f"{side} x": 1.0}, {f"{side} y": 1.0}]
        points[f"{side} here"] = (here[0], here[1])
        points[f"{side} stop"] = (here[0] | {f"{side} braking x": 1.0}, here[1] | {f"{side} braking y": 1.0})
    seen = _clearances(graph, blueprint, known, points)
    observation = []
    for side, body in bodies.items():
        direction: list[Row] = [{f"{side} cos": 1.0}, {f"{side} sin": 1.0}]
        observation += [*_position_and_speed(blueprint, body, side), *direction]
    observation += [{"cos dx": 1.0, "sin dy": 1.0}, {"cos dy": 1.0, "-sin dx": 1.0}, {"apart": 1.0}]
    return seen, [*observation, *({f"room {point}": 1.0} for point in points)]


def _products(graph: Graph, blueprint: Blueprint) -> list[str]:
    """Tensors of the headings' cosines and sines, and of what they are multiplied with.

    A cosine is the sine of a quarter turn more, so one node makes all eight; another raises speeds to squares and
    leaves lengths as they are; a third multiplies the two.
    """
    dx, dy = _opponent_from_own(blueprint)
    angles: dict[str, Row] = {}
    lengths: dict[str, Row] = {}
    for side, body in zip(SIDES, (blueprint.own, blueprint.opponent), strict=True):
        angles |= {f"{side} cos": {f"{side} heading": 1.0, ONE: math.pi / 2}, f"{side} sin": {f"{side} heading": 1.0}}
        root = 1 / math.sqrt(max(2 * body.u1_max, 1e-6))
        lengths |= {f"{side} braking x": {f"{side} v": root}, f"{side} braking y": {f"{side} v": root}}
    angles |= {f"{what} again {place}": angles[f"own {what}"] for place in (0, 1) for what in ("cos", "sin")}
    lengths |= {"cos dx": dx, "sin dy": dy, "cos dy": dy, "-sin dx": _minus(dx)}
    graph.add("Sin", [graph.linear("state", "angles", angles)], "directions", [*angles])
    least = np.array([[0.0] * 4 + [-np.inf] * 4], np.float32)  # braking begins at a speed of 0, not less
    power = np.array([[2.0] * 4 + [1.0] * 4], np.float32)
    length = graph.add("Max", [graph.linear("state", "signed lengths", lengths), least], "lengths")
    graph.add("Mul", ["directions", graph.add("Pow", [length, power], "powers")], "products", [*lengths])
    return ["directions", "products"]


def _clearances(graph: Graph, blueprint: Blueprint, known: str, points: dict[str, tuple[Row, Row]]) -> str:
    """What is known, the distance between the robots, and the clipped clearance at each point."""
    offsets: dict[str, Row] = {}
    for point, (x, y) in points.items():
        for number, (disc_x, disc_y, _) in enumerate(blueprint.discs):
            offsets |= {f"{point} {number} x": x | {ONE: -disc_x}, f"{point} {number} y": y | {ONE: -disc_y}}
    offsets["dx"], offsets["dy"] = _opponent_from_own(blueprint)
    distances = [f"{point} {number}" for point in points for number in range(len(blueprint.discs))] + ["apart"]
    flat = graph.linear(known, "offsets", offsets)
    pairs = graph.add("Reshape", [flat, np.array([-1, len(distances), 2])], "pairs")
    graph.add("ReduceL2", [pairs], "distances", distances, axes=[2], keepdims=0)
    measured = graph.join([known, "distances"], "measured")

    x_min, x_max, y_min, y_max = blueprint.walls
    rooms: dict[str, Row] = {}
    for point, (x, y) in points.items():
        radius = (blueprint.own if point.startswith("own") else blueprint.opponent).radius
        rooms |= {
            f"{point} left": x | {ONE: -x_min - radius},
            f"{point} right": _minus(x) | {ONE: x_max - radius},
            f"{point} bottom": y | {ONE: -y_min - radius},
            f"{point} top": _minus(y) | {ONE: y_max - radius},
        }
        for number, (*_, disc_radius) in enumerate(blueprint.discs):
            rooms[f"{point} disc {number}"] = {f"{point} {number}": 1.0, ONE: -disc_radius - radius}
    flat = graph.linear(measured, "rooms", rooms)
    per_point = graph.add("Reshape", [flat, np.array([-1, len(points), 4 + len(blueprint.discs)])], "rooms by point")
    least = graph.add("ReduceMin", [per_point], "least rooms", axes=[2], keepdims=0)
    bounds = [np.array(-1, np.float32), np.array(1, np.float32)]
    graph.add("Clip", [least, *bounds], "clearances", [f"room {point}" for point in points])
    return graph.join([measured, "clearances"], "features")
