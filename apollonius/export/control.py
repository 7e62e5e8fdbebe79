"""Control flow of JAX: loops that carry values from step to step, and branches."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from apollonius.export.elementwise import Params, is_at_most
from apollonius.export.program import Apply, Branch, Expression, Loop, Name, Number, While
from apollonius.export.values import Block, Place, Value, placed, row_along, scalar

Run = Callable[[Block, Any, Sequence[Any], Sequence[Value]], list[Value]]
"""From a block to write in, a function, its constants and its arguments to its results."""


def scan(run: Run, block: Block, given: list[Value], params: Params) -> list[Value]:
    """Return the carry after the last step and what every step put out."""
    consts, carried = params["num_consts"], params["num_carry"]
    jaxpr, length = params["jaxpr"], params["length"]
    fixed, first, rows = given[:consts], given[consts : consts + carried], given[consts + carried :]
    carry = _variables(block, first)
    outs = jaxpr.jaxpr.outvars[carried:]
    ys = [block.empty(str(out.aval.dtype), (length, *out.aval.shape)) for out in outs]
    (step,), inner = block.loops((length,)) if length != 1 else ((Number(0),), block.inner())
    here: Expression = step
    if params["reverse"]:
        here = Apply("sub", "int32", (Number(length - 1), step)) if length != 1 else Number(0)
    results = run(inner, jaxpr.jaxpr, jaxpr.consts, [*fixed, *carry, *(row_along(one, here) for one in rows)])
    for value, row in zip(results[carried:], ys, strict=True):
        inner.copy(value, row_along(row, here))
    _assign(inner, results[:carried], carry)
    block.add(Loop(step, length, tuple(inner.statements))) if isinstance(step, Name) else block.close((), (), inner)
    return [*carry, *ys]


def while_loop(run: Run, block: Block, given: list[Value], params: Params) -> list[Value]:
    """Return the carry when the condition no longer holds."""
    asked, done = params["cond_nconsts"], params["body_nconsts"]
    carry = _variables(block, given[asked + done :])
    before, inner = block.inner(), block.inner()
    cond, body = params["cond_jaxpr"], params["body_jaxpr"]
    (holds,) = run(before, cond.jaxpr, cond.consts, [*given[:asked], *carry])
    _assign(inner, run(inner, body.jaxpr, body.consts, [*given[asked : asked + done], *carry]), carry)
    block.add(While(tuple(before.statements), holds.read(()), tuple(inner.statements)))
    return carry


def cond(run: Run, block: Block, given: list[Value], params: Params) -> list[Value]:
    """Return the results of the branch that is asked for; of the last one for a number beyond."""
    which, branches = block.let(given[0].read(())), params["branches"]
    made = [_variable(block, str(out.aval.dtype), out.aval.shape) for out in branches[0].jaxpr.outvars]

    def of_branch(place: int) -> Block:
        inner = block.inner()
        branch = branches[place]
        for value, target in zip(run(inner, branch.jaxpr, branch.consts, given[1:]), made, strict=True):
            inner.copy(value, target)
        return inner

    last = of_branch(len(branches) - 1)
    for place in range(len(branches) - 2, -1, -1):
        outer = block.inner()
        outer.add(Branch(is_at_most(which, place), tuple(of_branch(place).statements), tuple(last.statements)))
        last = outer
    block.statements += last.statements
    return made


def _variable(block: Block, kind: str, shape: tuple[int, ...]) -> Value:
    """A value that can be assigned to."""
    if int(np.prod(shape, dtype=int)) != 1:
        return block.empty(kind, shape)
    return placed(shape, Place(block.allocate(kind, 1, cell=True), Number(0), (0,) * len(shape)))


def _variables(block: Block, first: Sequence[Value]) -> list[Value]:
    made = [_variable(block, value.kind, value.shape) for value in first]
    for value, variable in zip(first, made, strict=True):
        block.copy(value, variable)
    return made


def _assign(block: Block, values: Sequence[Value], variables: Sequence[Value]) -> None:
    """Assign all at once: what reads another variable is copied before that one changes."""
    changing = {variable.place.buffer.name for variable in variables if variable.place is not None}

    def apart(value: Value, variable: Value) -> Value:
        if value.place is None:
            return value
        if value.place == variable.place or value.place.buffer.name not in changing:
            return value
        if value.size == 1:
            return scalar(block.let(value.first), value.shape)
        return block.copied(value)

    ready = [apart(value, variable) for value, variable in zip(values, variables, strict=True)]
    for value, variable in zip(ready, variables, strict=True):
        if value.place != variable.place:
            block.copy(value, variable)


CONTROL = {"scan": scan, "while": while_loop, "cond": cond}
"""By the name of the primitive."""
