"""What a network sees by a chart (`apollonius.observe.egocentric`), in an ONNX graph.

The chart's arrays are inputs of the model, too, with the chart of one arena as what they are unless given. Rays are
followed in all directions at once, a glance is seven nodes, and the twelve are written one after the other.
"""

import math

import numpy as np

from apollonius.adapters.export.blueprint import LARGEST, Blueprint, Body
from apollonius.adapters.export.features import INPUTS
from apollonius.adapters.export.graph import ONE, Graph, Row
from apollonius.adapters.export.ways import STATE_OR_ZERO, add_ways
from apollonius.game.chart import FARTHEST, GLANCES, SIDE
from apollonius.observe.egocentric import COURSES, RAYS

_CLOSE = ("own here", "own stop", "opponent here", "opponent stop")
_TURNS = [number * 2 * math.pi / RAYS for number in range(RAYS)]


def egocentric(graph: Graph, blueprint: Blueprint) -> tuple[str, list[Row]]:
    """A tensor, and the `egocentric` observation's 92 numbers as linear in its columns."""
    own, opponent, capture = blueprint.own, blueprint.opponent, float(blueprint.game.capture_distance)
    _chart(graph, blueprint)
    _possible(graph)
    known = _robots(graph, blueprint)
    rooms = _rooms(graph, blueprint, known)
    _ranges(graph, known)
    add_ways(graph, blueprint)
    left = graph.linear(known, "left", {"left": {"apart": 1.0, ONE: -capture}})
    graph.clip(left, 0, 3, "clipped left", ["before a capture"])
    lengths = {f"ray {number}": {f"range {number}": 1.0, ONE: -own.radius} for number in range(RAYS)}
    lengths |= {"near": {"apart": 1.0}, "far": {"way": 1.0}}
    measured = graph.join([known, "ranges", "way"], "measured")
    positive = graph.add("Relu", [graph.linear(measured, "lengths", lengths)], "positive lengths")
    more = graph.add("Add", [positive, np.array(1, np.float32)], "lengths and 1")
    graph.add("Reciprocal", [more], "reciprocals", [f"1 / {name}" for name in lengths])
    graph.add("Log", [more], "logarithms", [f"log {name}" for name in lengths])
    seen = [
        STATE_OR_ZERO,
        "products",
        rooms,
        "clipped left",
        "reciprocals",
        "logarithms",
        "seen",
        "longer",
        "shares",
        "first",
    ]
    along, across = (
        {f"share {course}": function(turn) for course, turn in enumerate(_TURNS[:: RAYS // COURSES])}
        for function in (math.cos, math.sin)
    )
    observation: list[Row] = [
        *_motion(own, "own"),
        {ONE: own.v_min / 1.2},
        {"room own here": 1.0},
        {"room own stop": 1.0},
        {"cos toward x": 1.0, "sin toward y": 1.0},
        {"cos toward y": 1.0, "sin toward x": -1.0},
        *_on_two_scales("near"),
        {"before a capture": 1 / 3},
        {"cos their cos": 1.0, "sin their sin": 1.0},
        {"cos their sin": 1.0, "sin their cos": -1.0},
        *_motion(opponent, "opponent"),
        {"room opponent here": 1.0},
        {"room opponent stop": 1.0},
        {ONE: capture / 0.3},
        *({f"1 / ray {number}": 1.0} for number in range(RAYS)),
        {"is seen": 1.0},
        *_on_two_scales("far"),
        *({f"longer {course}": 1.0} for course in range(COURSES)),
        along,
        across,
        *({f"first {course}": 1.0} for course in range(COURSES)),
    ]
    return graph.join(seen, "features"), observation


def _motion(body: Body, side: str) -> list[Row]:
    limits: list[Row] = [
        {ONE: limit}
        for limit in (body.v_max / 1.2, body.u1_max / 0.3, body.u2_max / 0.8, body.radius / 0.3)
    ]  # fmt: skip
    return [{f"{side} v": 1 / 1.2}, *limits]


def _on_two_scales(name: str) -> list[Row]:
    return [{f"1 / {name}": 1.0}, {f"log {name}": 0.5}]


def _chart(graph: Graph, blueprint: Blueprint) -> None:
    """The chart's arrays as the nodes below take them."""
    for name, array in blueprint.chart.items():
        graph.give(name, array)
    graph.add("Reshape", ["field", np.array([1, 1, SIDE + 1, SIDE + 1])], "image")
    for name in ("beside", "ways"):
        graph.add("Reshape", [name, np.array([-1])], f"{name} in a row")
    graph.add(
        "Concat", [*(graph.add("Reshape", [axis, np.array([1])], f"{axis} alone") for axis in "xy")], "corner", axis=0
    )
    graph.add("Mul", ["side", np.array(0.5, np.float32)], "half")


def _possible(graph: Graph) -> None:
    """The state, but 0 where a number is none or too large: what is looked up in a chart must be a place."""
    size = graph.add("Abs", ["state"], "sizes")
    is_possible = graph.add("LessOrEqual", [size, np.array(LARGEST, np.float32)], "is possible")
    graph.add("Where", [is_possible, "state", np.array(0, np.float32)], STATE_OR_ZERO, INPUTS)


def _robots(graph: Graph, blueprint: Blueprint) -> str:
    """The state, directions and distances, products of them, and where both robots are and would come to rest."""
    angles: dict[str, Row] = {}
    speeds: dict[str, Row] = {}
    for side, body in (("own", blueprint.own), ("opponent", blueprint.opponent)):
        angles |= {f"{side} cos": {f"{side} heading": 1.0, ONE: math.pi / 2}, f"{side} sin": {f"{side} heading": 1.0}}
        speeds[f"{side} braking"] = {f"{side} v": 1 / math.sqrt(max(2 * body.u1_max, 1e-6))}
    graph.add("Sin", [graph.linear(STATE_OR_ZERO, "angles", angles)], "directions", [*angles])
    forward = graph.add("Relu", [graph.linear(STATE_OR_ZERO, "speeds", speeds)], "forward")
    graph.add("Mul", [forward, forward], "braking", [*speeds])
    away = graph.linear(STATE_OR_ZERO, "away", {axis: {f"opponent {axis}": 1.0, f"own {axis}": -1.0} for axis in "xy"})
    graph.add("ReduceL2", [away], "apart", ["apart"], axes=[1], keepdims=1)
    far = graph.add("Max", ["apart", np.array(1e-6, np.float32)], "far")
    graph.add("Div", [away, far], "toward", ["toward x", "toward y"])
    factors = graph.join([STATE_OR_ZERO, "directions", "braking", "apart", "toward"], "factors")
    others = {name: name for name in ("toward x", "toward y")}
    others |= {f"their {turn}": f"opponent {turn}" for turn in ("cos", "sin")}
    names = {f"{mine} {name}": (f"own {mine}", other) for mine in ("cos", "sin") for name, other in others.items()}
    names |= {
        f"{side} on {turn}": (f"{side} {turn}", f"{side} braking")
        for side in ("own", "opponent")
        for turn in ("cos", "sin")
    }
    both = [
        graph.linear(factors, f"{which} factors", {name: {pair[place]: 1.0} for name, pair in names.items()})
        for place, which in enumerate(("first", "second"))
    ]
    graph.add("Mul", [*both], "products", [*names])
    return graph.join([factors, "products"], "known columns")


def _rooms(graph: Graph, blueprint: Blueprint, known: str) -> str:
    """The room [m] of both robots' centres and their bodies', clipped, where they are and where they would stop."""
    points: dict[str, Row] = {}
    for side in ("own", "opponent"):
        for axis, turn in (("x", "cos"), ("y", "sin")):
            points[f"{side} here {axis}"] = {f"{side} {axis}": 1.0}
            points[f"{side} stop {axis}"] = {f"{side} {axis}": 1.0, f"{side} on {turn}": 1.0}
    in_order = {f"{place} {axis}": points[f"{place} {axis}"] for place in _CLOSE for axis in "xy"}
    places = _places_on_the_image(graph, graph.linear(known, "close", in_order))
    sampled = _sampled(graph, places, "close rooms by place")
    centres = graph.add("Reshape", [sampled, np.array([-1, 4])], "close rooms", [f"centre {place}" for place in _CLOSE])
    radii = {place: (blueprint.own if place.startswith("own") else blueprint.opponent).radius for place in _CLOSE}
    bodies = {f"room {place}": {f"centre {place}": 1.0, ONE: -radius} for place, radius in radii.items()}
    unclipped = graph.linear(centres, "bodies' rooms", bodies)
    return graph.clip(unclipped, -1, 1, "clipped rooms", [*bodies])


def _places_on_the_image(graph: Graph, points: str) -> str:
    """Points [batch, 2 * points] as [1, 1, points, 2], from -1 to 1 across the chart."""
    pairs = graph.add("Reshape", [points, np.array([1, 1, -1, 2])], f"{points} in pairs")
    inside = graph.add("Sub", [pairs, "corner"], f"{points} from the corner")
    shares = graph.add("Div", [inside, "half"], f"{points} over half the side")
    return graph.add("Sub", [shares, np.array(1, np.float32)], f"{points} on the image")


def _sampled(graph: Graph, places: str, output: str) -> str:
    """The field at places on the image, interpolated, [1, 1, 1, points]."""
    how = {"mode": "bilinear", "padding_mode": "border", "align_corners": 1}
    return graph.add("GridSample", ["image", places], output, **how)


def _ranges(graph: Graph, known: str) -> None:
    """Distances [m] to what is met in all directions and towards the opponent, and whether it is seen."""
    ways = {}
    for number, turn in enumerate(_TURNS):
        cos, sin = math.cos(turn), math.sin(turn)
        ways[f"ray {number} x"] = {"own cos": cos, "own sin": -sin}
        ways[f"ray {number} y"] = {"own cos": sin, "own sin": cos}
    ways |= {"ray to it x": {"toward x": 1.0}, "ray to it y": {"toward y": 1.0}}
    rays = graph.linear(known, "rays", ways)
    pairs = graph.add("Reshape", [rays, np.array([1, 1, -1, 2])], "rays in pairs")
    graph.add("Div", [pairs, "half"], "rays on the image")
    starts = {f"start {number} {axis}": {f"own {axis}": 1.0} for number in range(RAYS + 1) for axis in "xy"}
    start = _places_on_the_image(graph, graph.linear(STATE_OR_ZERO, "starts", starts))
    rooms = {f"room {number}": {"centre own here": 1.0} for number in range(RAYS + 1)}
    first = graph.clip(graph.linear("close rooms", "first rooms", rooms), 0, FARTHEST, "glance 0 flat")
    upright = np.array([1, 1, -1, 1])
    along = graph.add("Reshape", [first, upright], "glance 0")
    for glance in range(1, GLANCES):
        name = f"glance {glance}"
        gone = graph.add("Mul", [along, "rays on the image"], f"{name} gone")
        there = graph.add("Add", [start, gone], f"{name} there")
        room = graph.add("Reshape", [_sampled(graph, there, f"{name} sampled"), upright], f"{name} room")
        on = graph.add("Add", [along, graph.add("Relu", [room], f"{name} free")], f"{name} on")
        along = graph.add("Min", [on, np.array(FARTHEST, np.float32)], name)
    names = [*(f"range {number}" for number in range(RAYS)), "range to it"]
    graph.add("Reshape", [along, np.array([-1, RAYS + 1])], "ranges", names)
    reach = graph.add("Min", ["apart", np.array(FARTHEST, np.float32)], "reach")
    range_to_it = graph.linear("ranges", "range to it", {"range to it": {"range to it": 1.0}})
    graph.add("GreaterOrEqual", [range_to_it, reach], "sees")
    graph.add("Cast", ["sees"], "seen", ["is seen"], to=1)
