"""A policy as one Python file that needs NumPy alone: code to read, and the weights in base64 below it.

One that plays by a chart has it in a second file, since that is larger than all the rest, and differs from map to map.
"""

import base64
import importlib.util
import textwrap
from dataclasses import asdict
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from apollonius.adapters.export import chart_file
from apollonius.adapters.export.blueprint import LARGEST, Blueprint, Body, identifier
from apollonius.adapters.export.parity import Answer, Decide
from apollonius.adapters.export.template import fill

SUFFIX = ".py"
_LINE = 116


def make_files(blueprint: Blueprint, out: Path) -> dict[Path, bytes]:
    """The file, and beside it the chart if it reads one."""
    numbers = np.concatenate([part.ravel() for layer in blueprint.layers for part in layer]).astype("<f4")
    sizes = [blueprint.header.observation_size, *(len(bias) for _, bias in blueprint.layers)]
    text = fill(
        "policy.py.in",
        blueprint,
        name=identifier(out),
        about="\n".join(blueprint.about),
        largest_square=f"{LARGEST**2:g}",
        own=_body(blueprint.own),
        opponent=_body(blueprint.opponent),
        walls=", ".join(map(repr, blueprint.walls)),
        discs=blueprint.discs,
        capture_distance=float(blueprint.game.capture_distance),
        chart=", chart" if blueprint.charted else "",
        controls="[\n" + "".join(f"    ({u1!s}, {u2!s}),\n" for u1, u2 in blueprint.controls) + "]",
        sizes=sizes,
        observation=fill(f"{blueprint.header.observation}.py.in", blueprint).rstrip(),
        weights=textwrap.fill(base64.b64encode(numbers.tobytes()).decode(), _LINE),
    )
    files = {out: text.encode()}
    if blueprint.charted:
        files[out.with_suffix(chart_file.SUFFIX)] = chart_file.chart_bytes(blueprint.chart)
    return files


def load(source: Path) -> Decide:
    """Import the file and call it."""
    spec = importlib.util.spec_from_file_location(identifier(source), source)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    decide = module.decide

    def decide_on(state: Float32[np.ndarray, "8"]) -> Answer:
        return decide(state.tolist())

    return decide_on


def _body(body: Body) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in asdict(body).items())
