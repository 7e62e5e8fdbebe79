"""Primitives of JAX that go by their data: loops that carry values, and branches."""

from collections.abc import Callable, Sequence
from typing import Any

from apollonius.export.block import Block, Value, buffer_of, row_along
from apollonius.export.elementwise import is_at_most

Run = Callable[[Block, Any, Sequence[Any], Sequence[Value]], list[Value]]
"""From a block to write in, a function, its constants and its arguments to its results."""


def scan(run: Run, block: Block, given: list[Value], params: Any) -> list[Value]:
    """Return the carry after the last step and what every step put out."""
    consts, carried = params["num_consts"], params["num_carry"]
    jaxpr, length = params["jaxpr"], params["length"]
    fixed, rows = given[:consts], given[consts + carried :]
    carry = [_variable(block, one) for one in given[consts : consts + carried]]
    outs = [out.aval for out in jaxpr.jaxpr.outvars[carried:]]
    ys = [block.array(str(out.dtype), (length, *out.shape)) for out in outs]
    with block.loops((length,)) as (step,):
        here = f"({length - 1} - {step})" if params["reverse"] else step
        now = [*fixed, *carry, *(row_along(one, here) for one in rows)]
        results = run(block, jaxpr.jaxpr, jaxpr.consts, now)
        for value, row in zip(results[carried:], ys, strict=True):
            block.copy(value, row_along(row, here))
        _assign(block, results[:carried], carry)
    return [*carry, *ys]


def while_loop(run: Run, block: Block, given: list[Value], params: Any) -> list[Value]:
    """Return the carry when the condition no longer holds."""
    asked, done = params["cond_nconsts"], params["body_nconsts"]
    condition, body = params["cond_jaxpr"], params["body_jaxpr"]
    carry = [_variable(block, one) for one in given[asked + done :]]
    with block.braces("for (;;)"):
        (holds,) = run(block, condition.jaxpr, condition.consts, [*given[:asked], *carry])
        block.put(f"if (!{holds.first}) break;")
        _assign(block, run(block, body.jaxpr, body.consts, [*given[asked : asked + done], *carry]), carry)
    return carry


def cond(run: Run, block: Block, given: list[Value], params: Any) -> list[Value]:
    """Return the results of the branch that is asked for; of the last one for a number beyond."""
    branches = params["branches"]
    made = [block.array(str(out.aval.dtype), out.aval.shape) for out in branches[0].jaxpr.outvars]
    for place, branch in enumerate(branches):
        words = ["else"] if place else []
        if place < len(branches) - 1:
            words.append(f"if ({is_at_most(given[0].first, given[0].kind, place)})")
        with block.braces(" ".join(words)):
            for value, target in zip(run(block, branch.jaxpr, branch.consts, given[1:]), made, strict=True):
                block.copy(value, target)
    return made


def _variable(block: Block, first: Value) -> Value:
    """Return an array that can be assigned to, with its first value."""
    made = block.array(first.kind, first.shape)
    block.copy(first, made)
    return made


def _assign(block: Block, values: Sequence[Value], variables: Sequence[Value]) -> None:
    """Assign all at once: what may read another variable is copied before that one changes."""
    changing = {"", *map(buffer_of, variables)}
    ready = [
        value if value is variable or buffer_of(value) not in changing else block.copied(value)
        for value, variable in zip(values, variables, strict=True)
    ]
    for value, variable in zip(ready, variables, strict=True):
        if value is not variable:
            block.copy(value, variable)


CONTROL = {"scan": scan, "while": while_loop, "cond": cond}
"""Rules of the primitives with results of several kinds, by name."""
