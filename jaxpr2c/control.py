"""Primitives of JAX with several results: loops, branches, and an array that is split."""

from collections.abc import Callable, Sequence
from typing import Any

from jaxpr2c.block import Block, Value, buffer_of, row_along
from jaxpr2c.elementwise import is_at_most
from jaxpr2c.indexing import part

ControlRule = Callable[[Block, Any, Sequence[Any], Sequence[Value]], list[Value]]
"""From a block to write in, a function, its constants and its arguments to its results."""


def scan(run: ControlRule, block: Block, operands: list[Value], params: Any) -> list[Value]:
    """Write a scan; return the carry after the last step and the outputs of all steps.

    Args:
        run: Writes the equations of a function.
        block: Block to write in.
        operands: Constants, first carry and rows.
        params: Parameters of JAX's primitive.
    """
    consts = params["num_consts"]
    num_carry = params["num_carry"]
    jaxpr = params["jaxpr"]
    length = params["length"]
    fixed = operands[:consts]
    rows = operands[consts + num_carry :]
    carry = list(map(block.new_array, operands[consts : consts + num_carry]))
    outs = [out.aval for out in jaxpr.jaxpr.outvars[num_carry:]]
    ys = [block.array(str(out.dtype), (length, *out.shape)) for out in outs]
    with block.loops((length,)) as (step,):
        step_index = f"({length - 1} - {step})" if params["reverse"] else step
        inputs = [*fixed, *carry, *(row_along(row, step_index) for row in rows)]
        results = run(block, jaxpr.jaxpr, jaxpr.consts, inputs)
        for value, row in zip(results[num_carry:], ys, strict=True):
            block.copy(value, row_along(row, step_index))
        _assign(block, results[:num_carry], carry)
    return [*carry, *ys]


def while_loop(run: ControlRule, block: Block, operands: list[Value], params: Any) -> list[Value]:
    """Write a loop; return the carry when the condition no longer holds.

    Args:
        run: Writes the equations of a function.
        block: Block to write in.
        operands: Constants of the condition, constants of the body, and the first carry.
        params: Parameters of JAX's primitive.
    """
    body_start = params["cond_nconsts"]
    carry_start = body_start + params["body_nconsts"]
    condition = params["cond_jaxpr"]
    body = params["body_jaxpr"]
    carry = list(map(block.new_array, operands[carry_start:]))
    with block.braces("for (;;)"):
        condition_inputs = [*operands[:body_start], *carry]
        (holds,) = run(block, condition.jaxpr, condition.consts, condition_inputs)
        block.put(f"if (!{holds.first}) break;")
        body_inputs = [*operands[body_start:carry_start], *carry]
        _assign(block, run(block, body.jaxpr, body.consts, body_inputs), carry)
    return carry


def cond(run: ControlRule, block: Block, operands: list[Value], params: Any) -> list[Value]:
    """Write a choice of branches; return the results of the chosen one.

    Args:
        run: Writes the equations of a function.
        block: Block to write in.
        operands: Number of the branch, of the last one if it is larger, and the inputs of all.
        params: Parameters of JAX's primitive.
    """
    branches = params["branches"]
    results = [
        block.array(str(out.aval.dtype), out.aval.shape) for out in branches[0].jaxpr.outvars
    ]
    for place, branch in enumerate(branches):
        words = ["else"] if place else []
        if place < len(branches) - 1:
            choice = operands[0]
            words.append(f"if ({is_at_most(choice.first, choice.kind, place)})")
        with block.braces(" ".join(words)):
            values = run(block, branch.jaxpr, branch.consts, operands[1:])
            for value, target in zip(values, results, strict=True):
                block.copy(value, target)
    return results


def _assign(block: Block, values: Sequence[Value], variables: Sequence[Value]) -> None:
    """Assign values to variables at once: a value that may read another variable is copied
    first.
    """
    changing = {"", *map(buffer_of, variables)}
    ready = [
        value if value is variable or buffer_of(value) not in changing else block.copy_of(value)
        for value, variable in zip(values, variables, strict=True)
    ]
    for value, variable in zip(ready, variables, strict=True):
        if value is not variable:
            block.copy(value, variable)


def _split(run: ControlRule, block: Block, operands: list[Value], params: Any) -> list[Value]:
    (value,) = operands
    axis = params["axis"]
    pieces = list[Value]()
    start = 0
    for size in map(int, params["sizes"]):
        shape = tuple(size if own == axis else length for own, length in enumerate(value.shape))
        starts = [str(start if own == axis else 0) for own in range(len(shape))]
        pieces.append(part(value, shape, starts))
        start += size
    return pieces


CONTROL: dict[str, Callable[[ControlRule, Block, list[Value], Any], list[Value]]] = {
    **{"scan": scan, "while": while_loop, "cond": cond, "split": _split},
    "optimization_barrier": lambda run, block, operands, params: operands,
}
"""Rules of the primitives with several results, by name."""
