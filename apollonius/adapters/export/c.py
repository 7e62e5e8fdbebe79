"""A policy as C99: a header of a few lines, and a source with constant arrays and no dependency but the C library.

Two files, so that a program includes what it calls and compiles the megabytes of weights once. A third is the chart
that a policy reads: its caller holds it in memory, since it is 5 MB, and another on another map.
"""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from apollonius.adapters.export import chart_file
from apollonius.adapters.export.blueprint import LARGEST, Blueprint, Body, identifier
from apollonius.adapters.export.parity import Answer, CannotRun, Decide
from apollonius.adapters.export.template import fill

SUFFIX = ".c"
FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-O3")
"""How the source is compiled to be checked."""
_ROUND = 4
"""Sizes of layers are rounded up to a multiple of this."""
_PER_LINE = 6


def make_files(blueprint: Blueprint, out: Path) -> dict[Path, bytes]:
    """The source, to be written to `out`, and its header beside it; and the chart if it reads one."""
    name, header = identifier(out), out.with_suffix(".h")
    layers = [(_padded(weight.T), _padded(bias)) for weight, bias in blueprint.layers]
    arrays = {
        declared: array
        for number, layer in enumerate(layers)
        for declared, array in zip(_declarations(number, *layer), layer, strict=True)
    }
    walls = zip(("X_MIN", "X_MAX", "Y_MIN", "Y_MAX"), blueprint.walls, strict=True)
    discs = [f"{{{x}, {y}, {radius}}}" for x, y, radius in (map(_real, disc) for disc in blueprint.discs)]
    given = dict.fromkeys(("chart", "chart_given"), "")
    if blueprint.charted:
        given = {"chart": ", chart", "chart_given": ", const apollonius_chart *chart"}
    source = fill(
        "policy.c.in",
        blueprint,
        name=name,
        header=header.name,
        largest_square=f"{LARGEST**2:g}f",
        widest=max(max(weight.shape) for weight, _ in layers),
        walls=", ".join(f"{wall} = {_real(place)}" for wall, place in walls),
        own=_body(blueprint.own),
        opponent=_body(blueprint.opponent),
        u2_max=_real(blueprint.own.u2_max),
        controls=",\n".join(f"    {{{_real(u1)}, {_real(u2)}}}" for u1, u2 in blueprint.controls.tolist()),
        declarations="\n".join(f"{declared};" for declared in arrays),
        weights="\n\n".join(f"{declared} = {{\n{_rows(array)}\n}};" for declared, array in arrays.items()),
        observation=fill(
            f"{blueprint.header.observation}.c.in",
            blueprint,
            discs=len(discs),
            disc_table=", ".join([*discs, "{0}"]),
            own_limits=_limits(blueprint.own),
            opponent_limits=_limits(blueprint.opponent),
            capture_distance=_real(float(blueprint.game.capture_distance)),
        ).rstrip(),
        layers=_calls([weight.shape for weight, _ in layers]),
        outputs="here" if len(layers) % 2 == 0 else "next",
        **given,
    )
    about = "\n".join(f"   {line}" for line in blueprint.about)
    said = fill("policy.h.in", blueprint, name=name, guard=name.upper(), about=about, **given)
    files = {out: source.encode(), header: said.encode()}
    if blueprint.charted:
        files[out.with_suffix(chart_file.RAW)] = chart_file.chart_bytes(blueprint.chart, chart_file.RAW)
    return files


def load(source: Path, flags: Sequence[str] = FLAGS) -> Decide:
    """Compile a source with GCC and call it as its header says: a discrete policy returns its action.

    Raises:
        CannotRun: where there is no gcc.
        subprocess.CalledProcessError: where it complains.
    """
    if shutil.which("gcc") is None:
        raise CannotRun("there is no gcc here")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "policy.so"
        subprocess.run(["gcc", *flags, "-shared", "-fPIC", str(source), "-lm", "-o", str(library)], check=True)
        function = getattr(ctypes.CDLL(str(library)), f"{identifier(source)}_decide")
    returns_action = f"int {function.__name__}(" in source.with_suffix(".h").read_text()
    state, controls = np.zeros(8, np.float32), np.zeros(2, np.float32)
    chart = source.with_suffix(chart_file.RAW)
    charts = [ctypes.create_string_buffer(chart.read_bytes())] if chart.exists() else []
    places = [ctypes.c_void_p(state.ctypes.data), *charts, ctypes.c_void_p(controls.ctypes.data)]

    def decide(now: Float32[np.ndarray, "8"]) -> Answer:
        state[:] = now
        action = function(*places)
        both = float(controls[0]), float(controls[1])
        return (action, *both) if returns_action else both

    return decide


def _padded(array: np.ndarray) -> np.ndarray:
    return np.pad(array, [(0, -size % _ROUND) for size in array.shape])


def _real(value: float) -> str:
    """The shortest decimal that is this single-precision number."""
    return f"{np.float32(value)!s}f"


def _exact(value: float) -> str:
    """A single-precision number as C99 writes it exactly: hexadecimal, without the zeros of double precision."""
    digits, exponent = value.hex().split("p")
    return f"{digits.rstrip('0').rstrip('.')}p{exponent}f" if "." in digits else f"{digits}p{exponent}f"


def _body(body: Body) -> str:
    return ", ".join(_real(value) for value in (body.v_min, body.v_max, body.u1_max, body.radius))


def _limits(body: Body) -> str:
    """In units of the paper's robots."""
    return ", ".join(map(_real, (body.v_max / 1.2, body.u1_max / 0.3, body.u2_max / 0.8, body.radius / 0.3)))


def _declarations(number: int, weight: np.ndarray, bias: np.ndarray) -> tuple[str, str]:
    inputs, outputs = weight.shape
    return (
        f"static const float WEIGHT_{number}[{inputs} * {outputs}]",
        f"static const float BIAS_{number}[{bias.size}]",
    )


def _rows(array: np.ndarray) -> str:
    texts = [_exact(value) for value in array.ravel().tolist()]
    return ",\n".join(", ".join(texts[start : start + _PER_LINE]) for start in range(0, len(texts), _PER_LINE))


def _calls(shapes: list[tuple[int, ...]]) -> str:
    """The lines that go through the network, back and forth between two arrays."""
    lines = []
    for number, (inputs, outputs) in enumerate(shapes):
        source, target = ("here", "next") if number % 2 == 0 else ("next", "here")
        lines.append(f"    affine({inputs}, {outputs}, WEIGHT_{number}, BIAS_{number}, {source}, {target});")
        if number < len(shapes) - 1:
            lines.append(f"    relu({outputs}, {target});")
    return "\n".join(lines)
