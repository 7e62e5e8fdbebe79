"""How long the ways are that a network sees by a chart (`apollonius.observe.egocentric`), in an ONNX graph."""

import numpy as np

from apollonius.adapters.export.blueprint import Blueprint
from apollonius.adapters.export.graph import ONE, Graph
from apollonius.game.chart import SIDE, STOP_BITS, STOPS
from apollonius.observe.egocentric import AHEAD, COURSES, NEAR, RAYS

STATE_OR_ZERO = "state or zero"
"""The tensor of the state, numbers that are none left out."""
_COURSES = range(0, RAYS, RAYS // COURSES)
"""Those of the rays."""
_FIRST = (0.0, 1.0, float(STOPS), STOPS + 1.0)
"""What the four stops around a point have more than the first of them in their numbers."""
_SHARPNESS = 4


def add_ways(graph: Graph, blueprint: Blueprint) -> None:
    """Tensors of what comes of them: how much longer those through each course are, the shares of the courses by that,
    who would be first ahead, and the way to the opponent, which is straight where it is seen.

    The graph has rays and ranges, and how far apart the robots are.
    """
    _points(graph)
    _places(graph)
    ways = _lengths(graph)
    more = {f"longer {course}": {f"near way {course}": 1 / NEAR, "whole": -1 / NEAR} for course in range(COURSES)}
    longer = graph.clip(graph.linear(ways, "longer unclipped", more), -1, 1, "longer", [*more])
    sharp = graph.add("Mul", [longer, np.array(-_SHARPNESS, np.float32)], "sharpened")
    graph.add("Softmax", [sharp], "shares", [f"share {course}" for course in range(COURSES)], axis=1)
    times = graph.join([ways, "far along"], "times")
    mine, theirs = blueprint.opponent.v_max, blueprint.own.v_max  # each multiplied by the other's speed
    later, both = (
        graph.linear(
            times,
            name,
            {
                f"first {course}": {f"far way {course}": theirs, f"far {course}": sign * mine, ONE: least}
                for course in range(COURSES)
            },
        )
        for name, sign, least in (("later by", -1, 0.0), ("together", 1, 1e-3))
    )
    graph.add("Div", [later, both], "first", [f"first {course}" for course in range(COURSES)])
    around = graph.linear(ways, "around", {"around": {"around": 1.0}})
    graph.add("Where", ["sees", "apart", around], "way", ["way"])


def _points(graph: Graph) -> None:
    """How far ahead it is looked in each course, near and far; and all points from which ways are measured.

    These are the opponent's and the robot's own, then those near, then those far, [points, 2].
    """
    before = {f"before {course}": {f"range {number}": 1.0, ONE: -0.1} for course, number in enumerate(_COURSES)}
    before_walls = graph.linear("ranges", "before walls", before)
    for name, reach in (("near", NEAR), ("far", AHEAD)):
        names = [f"{name} {course}" for course in range(COURSES)]
        graph.clip(before_walls, 0, reach, f"{name} along", names)
    graph.join(["near along", "far along"], "along")
    steps = graph.add("Reshape", ["along", np.array([-1, 2 * COURSES, 1])], "steps")
    twice = [f"ray {number} {axis}" for _ in range(2) for number in _COURSES for axis in "xy"]
    turned = graph.linear("rays", "courses", {f"{name} {place}": {name: 1.0} for place, name in enumerate(twice)})
    pairs = graph.add("Reshape", [turned, np.array([-1, 2 * COURSES, 2])], "courses in pairs")
    own, both = (
        graph.linear(
            STATE_OR_ZERO, name, {f"{side} {axis}": {f"{side} {axis}": 1.0} for side in sides for axis in "xy"}
        )
        for name, sides in (("own place", ("own",)), ("both places", ("opponent", "own")))
    )
    own = graph.add("Reshape", [own, np.array([-1, 1, 2])], "own place in a pair")
    both = graph.add("Reshape", [both, np.array([-1, 2, 2])], "both places in pairs")
    ahead = graph.add("Add", [own, graph.add("Mul", [steps, pairs], "courses gone")], "ahead")
    points = graph.add("Concat", [both, ahead], "points by state", axis=1)
    graph.add("Reshape", [points, np.array([-1, 2])], "points")


def _places(graph: Graph) -> None:
    """Stops that can be seen from the points, and their weights, [points, 4] both; `Chart.places`."""
    inside = graph.add("Sub", ["points", "corner"], "points from the corner")
    shares = graph.add("Div", [inside, "side"], "points over the side")
    graph.columns[shares] = ["x", "y"]
    at = graph.add("Floor", [graph.add("Mul", [shares, np.array(SIDE, np.float32)], "in cells")], "cells unclipped")
    cells = graph.clip(at, 0, SIDE - 1, "cells", ["x", "y"])
    number = graph.linear(cells, "cell numbers", {"cell": {"x": 1.0, "y": float(SIDE)}})
    cell = graph.add("Cast", [number], "whole cell numbers", to=7)
    known = graph.add("Cast", [graph.add("Gather", ["beside in a row", cell], "beside the cell")], "known of it", to=1)

    step = {axis: {axis: STOPS / SIDE, ONE: 0.5 * STOPS / SIDE - 0.5} for axis in "xy"}
    floor = graph.add("Floor", [graph.linear(cells, "between stops", step)], "stops before unclipped")
    before = graph.clip(floor, 0, STOPS - 2, "stops before", ["x", "y"])
    in_stops = graph.add("Mul", [shares, np.array(STOPS, np.float32)], "in stops")
    beyond = graph.add(
        "Sub", [graph.add("Sub", [in_stops, np.array(0.5, np.float32)], "from middles"), before], "beyond"
    )
    on = graph.clip(beyond, 0, 1, "on", ["x", "y"])
    columns = {f"x {number}": ({"x": 1.0} if number % 2 else {"x": -1.0, ONE: 1.0}) for number in range(4)}
    rows = {f"y {number}": ({"y": 1.0} if number > 1 else {"y": -1.0, ONE: 1.0}) for number in range(4)}
    factors = [graph.linear(on, f"on {axis}", parts) for axis, parts in (("x", columns), ("y", rows))]
    weights = graph.add("Add", [graph.add("Mul", [*factors], "bilinear"), np.array(1e-3, np.float32)], "unmasked")

    shifts = np.array([[2.0 ** -(STOP_BITS + bit) for bit in range(4)]], np.float32)
    shifted = graph.add("Floor", [graph.add("Mul", [known, shifts], "shifted")], "whole shifted")
    bits = graph.add("Mod", [shifted, np.array(2, np.float32)], "bits", fmod=1)
    masked = graph.add("Mul", [weights, bits], "masked")
    total = graph.add("ReduceSum", [masked, np.array([1])], "total", keepdims=1)
    blind = graph.add("Equal", [total, np.array(0, np.float32)], "blind")
    some = graph.add("Where", [blind, np.array(1, np.float32), total], "some")
    alone = np.array([[1, 0, 0, 0]], np.float32)
    graph.add("Where", [blind, alone, graph.add("Div", [masked, some], "of the total")], "weights")
    four = {f"stop {bit}": {"x": 1.0, "y": float(STOPS), ONE: more} for bit, more in enumerate(_FIRST)}
    nearest = graph.add("Mod", [known, np.array(2**STOP_BITS, np.float32)], "nearest", fmod=1)
    graph.add("Where", [blind, nearest, graph.linear(before, "stops around", four)], "stops")


def _lengths(graph: Graph) -> str:
    """Ways [m]: from the stop beside the opponent to the robot and to all points ahead, and from where it is itself."""
    for what in ("stops", "weights"):
        by_state = graph.add("Reshape", [what, np.array([-1, 2 + 2 * COURSES, 4])], f"{what} by state")
        names = [f"{what} there", f"{what} here", f"{what} ahead"]
        graph.split(by_state, [1, 1, 2 * COURSES], names)
    best = graph.add("ArgMax", ["weights there"], "heaviest", axis=2, keepdims=1)
    stop = graph.add("GatherElements", ["stops there", best], "stop", axis=2)
    ends = graph.add("Concat", ["stops here", "stops ahead"], "ends", axis=1)
    end_weights = graph.add("Concat", ["weights here", "weights ahead"], "end weights", axis=1)
    upright = np.array([-1, 4, 1])
    starts, start_weights = (
        graph.add("Reshape", [f"{what} there", upright], f"{what} there, upright") for what in ("stops", "weights")
    )
    every = np.array(STOPS**2, np.float32)
    counts = {"from one stop": 4 * (1 + 2 * COURSES), "from all": 16}
    indices, shares = [], []
    for name, start, end, weights in (
        ("from one stop", stop, ends, end_weights),
        ("from all", starts, "stops here", graph.add("Mul", [start_weights, "weights here"], "both weights")),
    ):
        row = graph.add("Mul", [start, every], f"rows {name}")
        index = graph.add("Add", [row, end], f"indices {name}")
        flat = np.array([-1, counts[name]])
        indices.append(graph.add("Reshape", [index, flat], f"flat indices {name}"))
        shares.append(graph.add("Reshape", [weights, flat], f"flat weights {name}"))
    index = graph.add("Cast", [graph.add("Concat", [*indices], "indices", axis=1)], "whole indices", to=7)
    lengths = graph.add(
        "Cast", [graph.add("Gather", ["ways in a row", index], "lengths in cm")], "lengths of ways", to=1
    )
    parts = [f"part {number}" for number in range(sum(counts.values()))]
    graph.add("Mul", [lengths, graph.add("Concat", [*shares], "shares of ways", axis=1)], "parts", parts)
    ends_of = ["whole", *(f"{name} way {course}" for name in ("near", "far") for course in range(COURSES))]
    rows = {name: {f"part {4 * place + number}": 0.01 for number in range(4)} for place, name in enumerate(ends_of)}
    rows["around"] = dict.fromkeys(parts[counts["from one stop"] :], 0.01)
    return graph.linear("parts", "ways from there", rows)
