"""Size and speed of `jaxpr2c` beside XLA, ONNX Runtime and IREE: a function's program, and a call.

    taskset -c 0 python benchmarks/translator.py --out FILE

Functions: `add one` to a number, which shows what a call costs by itself; a `network` of 4 x 256
from 17 to 9 numbers; a `step` of the paper's game. Weights and game are constants of each program.
Times are processor seconds of calls from Python with arguments that are in place, the routes in
turns, medians of rounds; IREE's, whose calls from Python take longer, are its own tool's. All run
on one thread. Each result is compared with JAX's. Routes that are not installed are left out: pip
install jax2onnx onnxruntime iree-base-compiler iree-base-runtime.
"""

import os

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"  # before JAX is imported

import argparse
import itertools
import json
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import export
from jax.experimental.serialize_executable import serialize

import apollonius
from jaxpr2c import CompiledProgram, translate
from jaxpr2c.compiler import FLAGS, compile_texts

ROUNDS = 9
CALLS_SECONDS = 0.03
"""Processor seconds of the calls of a round."""
FAST_FLAGS = ("-std=c99", "-O3", "-march=native")


@dataclass(frozen=True)
class Workload:
    """A function from arrays to a list of arrays."""

    name: str
    function: Callable[..., list[jax.Array]]
    arguments: tuple[jax.Array, ...]


@dataclass(frozen=True)
class Route:
    """A way from a JAX function to a program: a call of it, its results, its sizes [bytes].

    Attributes:
        name: Its name.
        call: Calls the program with arguments that are in place; None where `seconds` are measured
            by another tool.
        results: The results of a call.
        program: Size of the program, its weights included.
        runtime: Size of the libraries that run it, but for Python's and C's own.
        seconds: Processor seconds of a call, by another tool.
    """

    name: str
    call: Callable[[], object] | None
    results: Sequence[Any]
    program: int
    runtime: int
    seconds: float = 0.0


def workloads() -> Iterator[Workload]:
    """Yield the functions."""
    yield Workload("add one", lambda x: [x + 1], (jnp.zeros(()),))
    sizes = (17, 256, 256, 256, 256, 9)
    rng = np.random.default_rng(0)
    layers = [
        rng.normal(0, (2 / size_in) ** 0.5, (size_in, size_out)).astype(np.float32)
        for size_in, size_out in itertools.pairwise(sizes)
    ]

    def network(x: jax.Array) -> list[jax.Array]:
        for weight in layers[:-1]:
            x = jax.nn.relu(x @ weight + 0.01)
        return [x @ layers[-1]]

    yield Workload("network", network, (jnp.asarray(rng.normal(size=sizes[0]), jnp.float32),))
    game = apollonius.make_game("paper")

    def step(robots: jax.Array, actions: jax.Array) -> list[jax.Array]:
        pursuer, evader = (apollonius.RobotState(*row) for row in robots)
        state = apollonius.GameState.at_start(apollonius.BySide((pursuer,), (evader,)))
        timestep = game.step(state, actions[0], actions[1])
        rows = [jnp.stack(jax.tree.leaves(side)) for side in timestep.state.robots]
        return [jnp.stack(rows), timestep.outcome, jnp.stack([*timestep.reward])]

    robots = jnp.array([[2.0, 7.0, 0.5, 0.3], [8.0, 7.0, 0.5, 2.0]])
    yield Workload("step", step, (robots, jnp.array([7, 4], jnp.int32)))


def by_c(workload: Workload, name: str, flags: Sequence[str]) -> Route:
    """Translate and compile by gcc; the program is the shared library without symbols."""
    program = translate(workload.function, *workload.arguments, name="workload")
    command = ["gcc", *flags, "-s", "-shared", "-fPIC", "workload.c", "-lm"]
    with compile_texts(program.files(), "gcc", command) as library:
        size = library.stat().st_size
    compiled = CompiledProgram(program, flags)
    results = compiled(*workload.arguments)
    return Route(name, compiled.rerun, results, size, 0)


def by_xla(workload: Workload) -> Route:
    """Compile ahead of time; the program is the executable of this machine as JAX keeps it."""
    compiled = jax.jit(workload.function).lower(*workload.arguments).compile()
    executable, *_ = serialize(compiled)

    def call() -> object:
        return jax.block_until_ready(compiled(*workload.arguments))

    results = compiled(*workload.arguments)
    return Route("XLA, compiled ahead", call, results, len(executable), library_size("jaxlib"))


def by_export(workload: Workload) -> Route:
    """Export StableHLO, which JAX compiles where it is loaded."""
    exported = export.export(jax.jit(workload.function))(*workload.arguments)
    content = exported.serialize()
    function = jax.jit(export.deserialize(content).call)

    def call() -> object:
        return jax.block_until_ready(function(*workload.arguments))

    results = function(*workload.arguments)
    return Route("jax.export, compiled there", call, results, len(content), library_size("jaxlib"))


def by_onnx(workload: Workload) -> Route:
    """Convert by jax2onnx, and run by ONNX Runtime."""
    import onnxruntime  # pyright: ignore[reportMissingImports]
    from jax2onnx import to_onnx  # pyright: ignore[reportMissingImports]

    shapes = [jax.ShapeDtypeStruct(array.shape, array.dtype) for array in workload.arguments]
    model: Any = to_onnx(lambda *arrays: tuple(workload.function(*arrays)), shapes, opset=21)
    content = model.SerializeToString()
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    arrays = map(np.asarray, workload.arguments)
    names = [model_input.name for model_input in session.get_inputs()]
    inputs = dict(zip(names, arrays, strict=True))
    results = session.run(None, inputs)
    size = library_size("onnxruntime")
    return Route(
        "jax2onnx, ONNX Runtime", lambda: session.run(None, inputs), results, len(content), size
    )


def by_iree(workload: Workload) -> Route:
    """Compile StableHLO by IREE for this processor; time it by `iree-benchmark-module`."""
    from iree import compiler, runtime  # pyright: ignore[reportMissingImports]

    exported = export.export(jax.jit(workload.function))(*workload.arguments)
    content = compiler.compile_str(
        exported.mlir_module_serialized,
        target_backends=["llvm-cpu"],
        input_type="stablehlo",
        extra_args=["--iree-llvmcpu-target-cpu=host"],
    )
    context = runtime.SystemContext(config=runtime.Config("local-sync"))
    module = runtime.VmModule.copy_buffer(context.instance, content)
    context.add_vm_module(module)
    arrays = [np.asarray(array) for array in workload.arguments]
    results: Any = context.modules[module.name]["main"](*arrays)
    results = results if isinstance(results, tuple | list) else [results]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "module.vmfb")
        path.write_bytes(content)
        seconds = seconds_of_iree(path, arrays)
    size = library_size("iree._runtime_libs")
    name = "IREE, by its benchmark tool"
    return Route(
        name, None, [np.asarray(result) for result in results], len(content), size, seconds
    )


def seconds_of_iree(module: Path, arrays: Sequence[np.ndarray]) -> float:
    """Return the processor seconds of a call, as IREE's own tool measures them without Python."""

    def text(array: np.ndarray) -> str:
        kind = {"float32": "f32", "int32": "i32", "bool": "i1", "uint32": "i32"}[str(array.dtype)]
        numbers = " ".join(str(number) for number in array.astype(float).ravel())
        sizes = "".join(f"{length}x" for length in array.shape)
        return f"--input={sizes}{kind}={numbers if kind == 'f32' else numbers.replace('.0', '')}"

    tool = Path(module_folder("iree._runtime_libs"), "iree-benchmark-module")
    command = [str(tool), f"--module={module}", "--function=main", "--device=local-sync"]
    command += [*map(text, arrays), "--benchmark_format=json", "--benchmark_repetitions=5"]
    output = subprocess.run(command, check=True, capture_output=True, text=True, encoding="utf-8")
    report = json.loads(output.stdout[output.stdout.index("{") :])
    scales = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3}
    return statistics.median(
        run["cpu_time"] * scales[run["time_unit"]]
        for run in report["benchmarks"]
        if run["run_type"] == "iteration"
    )


def module_folder(name: str) -> str:
    """Return the folder of an installed package."""
    spec = find_spec(name)
    folders = spec.submodule_search_locations if spec else None
    assert folders, f"{name} is a package that is installed"
    return next(iter(folders))


def library_size(name: str) -> int:
    """Return the size of the shared libraries of an installed package [bytes]."""
    libraries = Path(module_folder(name)).rglob("*.so*")
    return sum(path.stat().st_size for path in libraries if not path.is_symlink())


def routes(workload: Workload) -> Iterator[Route]:
    """Yield the routes that are installed and take the function; say of the others why not."""
    makers: list[tuple[str, Callable[[], Route]]] = [
        ("jax", lambda: by_c(workload, "jaxpr2c, gcc -O2", FLAGS)),
        ("jax", lambda: by_c(workload, "jaxpr2c, gcc -O3 -march=native", FAST_FLAGS)),
        ("jax", lambda: by_xla(workload)),
        ("jax", lambda: by_export(workload)),
        ("jax2onnx", lambda: by_onnx(workload)),
        ("iree", lambda: by_iree(workload)),
    ]
    for module, make_route in makers:
        if find_spec(module) is None:
            print(f"{module} is not installed", file=sys.stderr)
            continue
        try:
            yield make_route()
        except Exception as reason:  # each library refuses in its own way
            print(f"{workload.name}: {module}: {type(reason).__name__}: {reason}", file=sys.stderr)


def difference(workload: Workload, results: Sequence[Any]) -> float:
    """Return the largest difference of a result from JAX's."""
    expected = jax.jit(workload.function)(*workload.arguments)
    differences = [
        np.abs(np.asarray(result, float).reshape(-1) - np.asarray(array, float).reshape(-1)).max()
        for result, array in zip(results, expected, strict=True)
    ]
    return float(max(differences))


def seconds_of(call: Callable[[], object]) -> float:
    """Return the mean processor seconds of calls in one round."""
    count = 0
    start = time.process_time()
    while time.process_time() - start < CALLS_SECONDS:
        for _ in range(100):
            call()
        count += 100
    return (time.process_time() - start) / count


def measure(workload: Workload) -> list[list[Any]]:
    """Measure all routes of a function in turns; return a row for each."""
    all_routes = [*routes(workload)]
    times: dict[str, list[float]] = {route.name: [] for route in all_routes}
    for _ in range(ROUNDS):
        for route in all_routes:
            times[route.name].append(seconds_of(route.call) if route.call else route.seconds)
    return [
        [
            workload.name,
            route.name,
            round(1e6 * statistics.median(times[route.name]), 2),
            route.program,
            route.runtime,
            float(f"{difference(workload, route.results):.1e}"),
        ]
        for route in all_routes
    ]


def about() -> str:
    """Describe the machine and the versions."""
    cpu = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    gcc = subprocess.run(["gcc", "--version"], capture_output=True, text=True, encoding="utf-8")
    names = ("jax", "jax2onnx", "onnxruntime", "iree-base-compiler")
    modules = ("jax", "jax2onnx", "onnxruntime", "iree")
    versions = [
        f"{name} {version(name)}"
        for name, module in zip(names, modules, strict=True)
        if find_spec(module)
    ]
    return (
        "python benchmarks/translator.py: microseconds of the processor for a call, "
        f"{ROUNDS} rounds in turns. {cpu[1] if cpu else 'unknown processor'}; "
        f"{gcc.stdout.splitlines()[0]}; {', '.join(versions)}. Runtime: shared libraries as pip "
        "installs them."
    )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="JSON file to write")
    options = parser.parse_args()
    columns = ["function", "route", "microseconds", "program", "runtime", "difference from JAX"]
    rows: list[list[Any]] = []
    for workload in workloads():
        for row in measure(workload):
            rows.append(row)
            function, route, microseconds, program, runtime, away = row
            sizes = f"{program:>10,} bytes {runtime / 1e6:>6.1f} MB"
            print(f"{function:<8} {route:<32} {microseconds:>8.2f} us {sizes} {away:.0e}")
    if options.out:
        lines = ",\n".join(f"  {json.dumps(row)}" for row in rows)
        text = (
            f'{{\n "about": {json.dumps(about())},\n "columns": {json.dumps(columns)},\n'
            f' "rows": [\n{lines}\n ]\n}}\n'
        )
        options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
