"""The equations of a traced function: which are needed, what need not be stored, where they come from."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Var

from apollonius.export.arrays import FOLDS, PRODUCTS
from apollonius.export.control import INDEXED
from apollonius.export.elementwise import COMPUTED, VIEWS

CALLED = {
    **{"jit": "jaxpr", "remat": "jaxpr", "checkpoint": "jaxpr", "closed_call": "call_jaxpr"},
    **{"custom_jvp_call": "call_jaxpr", "custom_vjp_call": "call_jaxpr", "custom_vmap_call": "call"},
}
"""Primitives that call a function, and the parameter that is this function."""
RULES = COMPUTED | VIEWS | FOLDS | PRODUCTS | INDEXED
"""All others but control flow, by name."""
_READS_ONCE = {*COMPUTED, *FOLDS, "squeeze", "transpose", "expand_dims"}
"""Those that read each element of an operand once, if it is of their result's size or they fold it."""
_KINDS = {"float32", "int32", "uint32", "bool", "uint8", "uint16", "int8", "int16"}


def needed(jaxpr: Jaxpr) -> list[JaxprEqn]:
    """Return the equations that the results depend on."""
    wanted, found = {var for var in jaxpr.outvars if isinstance(var, Var)}, []
    for equation in reversed(jaxpr.eqns):
        if wanted.intersection(equation.outvars):
            found.append(equation)
            wanted |= {var for var in equation.invars if isinstance(var, Var)}
    return found[::-1]


def waiting(jaxpr: Jaxpr, equations: Sequence[JaxprEqn]) -> set[Var]:
    """Return the arrays that need not be stored: one equation reads them, each element once."""
    uses = Counter(var for equation in equations for var in equation.invars if isinstance(var, Var))
    uses.update(var for var in jaxpr.outvars if isinstance(var, Var))
    wait = set()
    for equation in equations:
        name = equation.primitive.name
        alone = [var for var in equation.invars if isinstance(var, Var) and uses[var] == 1 and name in _READS_ONCE]
        for var in alone:
            if _size(var) > 1 and (name in FOLDS or _size(var) == _size(equation.outvars[0])):
                wait.add(var)
    return wait


def length(jaxpr: Jaxpr) -> int:
    """Return the number of equations, those of called functions and of loops included."""
    return sum(1 + sum(map(length, _inside(equation))) for equation in jaxpr.eqns)


def unknown_kind(equation: JaxprEqn) -> str | None:
    """Return the kind of an equation's results if it is one that programs do not know."""
    kinds = {str(getattr(var.aval, "dtype", "?")) for var in equation.outvars} - _KINDS
    return min(kinds, default=None)


def line_of(equation: JaxprEqn) -> str | None:
    """Return the line of Python that an equation comes from, outside of libraries; None if it is of one."""
    traceback, libraries = equation.source_info.traceback, Path(jax.__file__).parents[1]
    for frame in traceback.frames if traceback else ():
        if libraries not in Path(frame.file_name).parents:
            return f"line {frame.line_num} of {frame.file_name}"
    return None


def _size(var: Any) -> int:
    return int(np.prod(var.aval.shape, dtype=int))


def _inside(equation: JaxprEqn) -> Iterator[Jaxpr]:
    for value in equation.params.values():
        for one in value if isinstance(value, tuple | list) else (value,):
            if isinstance(one, ClosedJaxpr | Jaxpr):
                yield one.jaxpr if isinstance(one, ClosedJaxpr) else one
