"""What statements name, and statements without those that nothing needs."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from apollonius.export.program import Allocate, Branch, Buffer, Let, Loop, Name, Statement, Store, While


def parts(part: Any, inside: Callable[[Any], Any] = lambda part: part) -> Iterator[Name | Buffer]:
    """Yield the names and buffers in statements.

    Args:
        inside: returns what counts of a statement or an expression; all of it unless given.
    """
    part = inside(part)
    if isinstance(part, Name | Buffer):
        yield part
    elif isinstance(part, tuple | list):
        for one in part:
            yield from parts(one, inside)
    elif is_dataclass(part) and not isinstance(part, type):
        for field in fields(part):
            yield from parts(getattr(part, field.name), inside)


def swept(statements: Sequence[Statement]) -> tuple[Statement, ...]:
    """Return statements without those that compute what nothing reads."""
    while True:
        read = {part.name for part in parts(statements, _read)}
        kept = _kept(statements, read)
        if kept == tuple(statements):
            return kept
        statements = kept


def _read(part: Any) -> Any:
    """What a statement reads; of what it writes, the buffers that are not the function's own."""
    match part:
        case Let(_, value):
            return value
        case Allocate():
            return ()
        case Store(buffer, index, value):
            return (index, value, buffer) if buffer.given or buffer.leaf else (index, value)
        case _:
            return part


def _kept(statements: Sequence[Statement], read: set[str]) -> tuple[Statement, ...]:
    kept: list[Statement] = []
    for statement in statements:
        match statement:
            case Let(name, _) if name.name not in read:
                continue
            case Allocate(buffer) | Store(buffer) if buffer.name not in read:
                continue
            case Loop(counter, count, body):
                if inner := _kept(body, read):
                    kept.append(Loop(counter, count, inner))
            case While(before, condition, body):
                kept.append(While(_kept(before, read), condition, _kept(body, read)))
            case Branch(condition, true, false):
                both = _kept(true, read), _kept(false, read)
                kept += [Branch(condition, *both)] if any(both) else []
            case _:
                kept.append(statement)
    return tuple(kept)
