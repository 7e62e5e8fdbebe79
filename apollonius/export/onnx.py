"""A player as an ONNX model, by jax2onnx over the very function that plays, and that model in
onnxruntime.
"""

import itertools
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
import onnxruntime  # pyright: ignore[reportMissingImports]
from jax.extend.core import Jaxpr, Literal
from jax.interpreters.partial_eval import dce_jaxpr
from jax2onnx import to_onnx  # pyright: ignore[reportMissingImports]

from apollonius.export.parity import Decide
from apollonius.export.player import Player
from apollonius.io.errors import InvalidInput
from jaxpr2c.translator import CALLED

OPSET = 21
"""Of 2024: onnxruntime 1.18 and later."""
_ERRORS = 3
"""Least severity of onnxruntime's messages; below it there is a warning for every unused constant.
"""


def model_of(player: Player) -> bytes:
    """Return the model; raises InvalidInput for what jax2onnx cannot take, with its reason.

    Inputs are `state`, in teams `active`, with movers `movers`, the arrays of a memory, `memory_0`
    and so on, and `bits`, but those that the player does not read; outputs `action`, `controls`,
    and `next_memory_0` and so on: see `Player.decide`.
    """
    policy, game, *inputs_of_step = player.arguments
    leaves, shape = jax.tree.flatten(tuple(inputs_of_step))
    names = _names(*inputs_of_step)

    def decide(*leaves_of_call: Any) -> list[Any]:
        decision = player.decide(policy, game, *jax.tree.unflatten(shape, leaves_of_call))
        return [decision["action"], decision["controls"], *jax.tree.leaves(decision["memory"])]

    closed_jaxpr = jax.make_jaxpr(decide)(*leaves)
    jaxpr, is_read = dce_jaxpr(closed_jaxpr.jaxpr, [True] * len(closed_jaxpr.jaxpr.outvars))
    read_leaves = itertools.compress(leaves, is_read)
    inputs = [
        jax.ShapeDtypeStruct(np.shape(leaf), jax.numpy.asarray(leaf).dtype) for leaf in read_leaves
    ]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model: Any = to_onnx(
                lambda *leaves_of_call: tuple(_run(jaxpr, closed_jaxpr.consts, leaves_of_call)),
                inputs,
                model_name="player",
                opset=OPSET,
                input_names=[*itertools.compress(names, is_read)],
                output_names=[
                    "action",
                    "controls",
                    *(f"next_{name}" for name in names if name.startswith("memory")),
                ],
            )
        return model.SerializeToString()
    except Exception as reason:  # jax2onnx says in many ways what it cannot take
        first = (
            str(reason).strip().splitlines()[0] if str(reason).strip() else type(reason).__name__
        )
        raise InvalidInput(
            f"'{player.name}' cannot become ONNX, jax2onnx says: {first}; C takes it."
        ) from reason


def load(model: bytes) -> tuple[Decide, Callable[[], object]]:
    """Return a model in onnxruntime, and a call of it with what it was given last."""
    options = onnxruntime.SessionOptions()
    options.log_severity_level = _ERRORS
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    input_names = {model_input.name for model_input in session.get_inputs()}
    inputs = dict[str, Any]()

    def decide(
        state: np.ndarray, active: Any, movers: Any, memory: Any, bits: np.uint32
    ) -> tuple[np.ndarray, np.ndarray]:
        arguments = state, active, movers, memory, bits
        arrays_by_name = dict(zip(_names(*arguments), jax.tree.leaves(arguments), strict=True))
        inputs.update({name: np.asarray(arrays_by_name[name]) for name in input_names})
        action, controls = session.run(["action", "controls"], inputs)
        return np.asarray(action), np.asarray(controls)

    return decide, lambda: session.run(None, inputs)


def _names(state: Any, active: Any, movers: Any, memory: Any, bits: Any) -> list[str]:
    """Return the inputs' names: those of several arrays are numbered."""
    several = [f"memory_{number}" for number in range(len(jax.tree.leaves(memory)))]
    optional = {"active": active, "movers": movers}
    present = [name for name, value in optional.items() if value is not None]
    return ["state", *present, *several, "bits"]


def _run(jaxpr: Jaxpr, consts: Sequence[Any], arguments: Sequence[Any]) -> list[Any]:
    """Run equations with called functions inlined, of which jax2onnx knows only some."""
    variables = [*jaxpr.constvars, *jaxpr.invars]
    values: dict[Any, Any] = dict(zip(variables, [*consts, *arguments], strict=True))

    def value_of(variable: Any) -> Any:
        return variable.val if isinstance(variable, Literal) else values[variable]

    for equation in jaxpr.eqns:
        operands = [value_of(variable) for variable in equation.invars]
        primitive = equation.primitive
        if primitive.name in CALLED:
            function = equation.params[CALLED[primitive.name]]
            results = _run(function.jaxpr, function.consts, operands)
        else:
            results = primitive.bind(*operands, **equation.params)
            results = results if primitive.multiple_results else [results]
        values |= dict(zip(equation.outvars, results, strict=True))
    return [value_of(variable) for variable in jaxpr.outvars]
