"""A player as an ONNX model, by jax2onnx over the very function that plays, and that model in onnxruntime."""

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
from apollonius.export.translate import CALLED
from apollonius.io.errors import InvalidInput

OPSET = 21
"""Of 2024: onnxruntime 1.18 and later."""
_ERRORS = 3
"""What onnxruntime tells from: it else warns of every constant that is left over."""


def model_of(player: Player) -> bytes:
    """Return the model; raises InvalidInput for what jax2onnx cannot take, with its reason.

    Inputs are `state`, in teams `active`, the arrays of a memory, `memory_0` and so on, and `bits`, but those that the
    player does not read; outputs `action`, `controls`, and `next_memory_0` and so on: see `Player.decide`.
    """
    policy, game, *rest = player.arguments
    leaves, shape = jax.tree.flatten(tuple(rest))
    names = _names(*rest)

    def decide(*given: Any) -> list[Any]:
        made = player.decide(policy, game, *jax.tree.unflatten(shape, given))
        return [made["action"], made["controls"], *jax.tree.leaves(made["memory"])]

    closed = jax.make_jaxpr(decide)(*leaves)
    jaxpr, is_read = dce_jaxpr(closed.jaxpr, [True] * len(closed.jaxpr.outvars))
    read = itertools.compress(leaves, is_read)
    inputs = [jax.ShapeDtypeStruct(np.shape(leaf), jax.numpy.asarray(leaf).dtype) for leaf in read]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model: Any = to_onnx(
                lambda *given: tuple(_run(jaxpr, closed.consts, given)),
                inputs,
                model_name="player",
                opset=OPSET,
                input_names=[*itertools.compress(names, is_read)],
                output_names=["action", "controls", *(f"next_{name}" for name in names if name.startswith("memory"))],
            )
        return model.SerializeToString()
    except Exception as reason:  # jax2onnx says in many ways what it cannot take
        first = str(reason).strip().splitlines()[0] if str(reason).strip() else type(reason).__name__
        raise InvalidInput(f"'{player.name}' cannot become ONNX, jax2onnx says: {first}; C takes it.") from reason


def load(model: bytes) -> tuple[Decide, Callable[[], object]]:
    """Return a model in onnxruntime, and a call of it with what it was given last."""
    options = onnxruntime.SessionOptions()
    options.log_severity_level, options.intra_op_num_threads = _ERRORS, 1
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    read, last = {one.name for one in session.get_inputs()}, dict[str, Any]()

    def decide(state: np.ndarray, active: Any, memory: Any, bits: np.uint32) -> tuple[np.ndarray, np.ndarray]:
        asked = state, active, memory, bits
        given = dict(zip(_names(*asked), jax.tree.leaves(asked), strict=True))
        last.update({name: np.asarray(given[name]) for name in read})
        action, controls = session.run(["action", "controls"], last)
        return np.asarray(action), np.asarray(controls)

    return decide, lambda: session.run(None, last)


def _names(state: Any, active: Any, memory: Any, bits: Any) -> list[str]:
    """Return the inputs' names: those of several arrays are numbered."""
    several = [f"memory_{number}" for number in range(len(jax.tree.leaves(memory)))]
    return ["state", *(["active"] if active is not None else []), *several, "bits"]


def _run(jaxpr: Jaxpr, consts: Sequence[Any], given: Sequence[Any]) -> list[Any]:
    """Run equations as they are, with called functions in their place, of which jax2onnx knows some only."""
    known: dict[Any, Any] = dict(zip([*jaxpr.constvars, *jaxpr.invars], [*consts, *given], strict=True))
    for equation in jaxpr.eqns:
        read = [one.val if isinstance(one, Literal) else known[one] for one in equation.invars]
        if equation.primitive.name in CALLED:
            called = equation.params[CALLED[equation.primitive.name]]
            made = _run(called.jaxpr, called.consts, read)
        else:
            made = equation.primitive.bind(*read, **equation.params)
        many = made if equation.primitive.multiple_results or equation.primitive.name in CALLED else [made]
        known |= dict(zip(equation.outvars, many, strict=True))
    return [one.val if isinstance(one, Literal) else known[one] for one in jaxpr.outvars]
