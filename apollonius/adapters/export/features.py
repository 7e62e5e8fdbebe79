"""What a network sees (`apollonius.observe`), in an ONNX graph.

A node costs onnxruntime a quarter of a microsecond whatever it computes, and the whole network some 13. So the
observation is a few products of matrices and not formula by formula.
"""

import math

import numpy as np

from apollonius.adapters.export.blueprint import STATE, Blueprint, Body
from apollonius.adapters.export.graph import ONE, Graph, Row

SIDES = ("own", "opponent")
INPUTS = [f"{side} {what}" for side in SIDES for what in STATE]


def paper(graph: Graph, blueprint: Blueprint) -> tuple[str, list[Row]]:
    """A tensor, and the `paper` observation's eight numbers as linear in its columns."""
    beyond = {f"{side} turns": {f"{side} heading": 1.0, ONE: -math.pi} for side in SIDES}
    ratio = graph.add("Div", [graph.linear("state", "beyond", beyond), np.array([2 * math.pi], np.float32)], "ratio")
    graph.add("Ceil", [ratio], "turns", [*beyond])
    observation = []
    for side, body in zip(SIDES, (blueprint.own, blueprint.opponent), strict=True):
        heading = {f"{side} heading": 1 / math.pi, f"{side} turns": -2.0}
        observation += [*_position_and_speed(blueprint, body, side), heading]
    return graph.join(["state", "turns"], "features"), observation


def encoded(graph: Graph, blueprint: Blueprint) -> tuple[str, list[Row]]:
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


def _position_and_speed(blueprint: Blueprint, body: Body, side: str) -> list[Row]:
    x_min, x_max, y_min, y_max = blueprint.walls
    return [
        _scaled(x_min, x_max, f"{side} x"),
        _scaled(y_min, y_max, f"{side} y"),
        _scaled(body.v_min, body.v_max, f"{side} v"),
    ]


def _scaled(low: float, high: float, name: str) -> Row:
    """From [low, high] to [-1, 1]."""
    span = max(high - low, 1e-6)
    return {name: 2 / span, ONE: -(low + high) / span}


def _opponent_from_own(blueprint: Blueprint) -> tuple[Row, Row]:
    """The opponent's position, less the own robot's, over the arena's longer side."""
    x_min, x_max, y_min, y_max = blueprint.walls
    size = max(x_max - x_min, y_max - y_min)
    dx, dy = ({f"opponent {axis}": 1 / size, f"own {axis}": -1 / size} for axis in "xy")
    return dx, dy


def _minus(row: Row) -> Row:
    return {name: -factor for name, factor in row.items()}
