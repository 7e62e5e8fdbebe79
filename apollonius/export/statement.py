"""Statements in C99, and those among them that nothing needs."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

_WORD = re.compile(r"\b[A-Za-z_]\w*(?:->\w+)?")


def words(text: str) -> frozenset[str]:
    """Return the names in a text in C."""
    return frozenset(_WORD.findall(text))


@dataclass(frozen=True)
class Line:
    """A statement that contains no others.

    Attributes:
        sets: the name that it does nothing but set; empty if it does more.
        reads: names.
    """

    text: str
    sets: str = ""
    reads: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Nest:
    """A loop or a choice."""

    heading: str
    body: tuple["Line | Nest", ...]
    otherwise: tuple["Line | Nest", ...] = ()


Statements = Sequence[Line | Nest]


def printed(statements: Statements, depth: int = 0) -> str:
    """Return statements in braces."""
    space, lines = "    " * depth, list[str]()
    for one in statements:
        if isinstance(one, Line):
            lines += [f"{space}    {line}" for line in one.text.splitlines()]
        else:
            otherwise = f" else {printed(one.otherwise, depth + 1)}" if one.otherwise else ""
            lines.append(f"{space}    {one.heading} {printed(one.body, depth + 1)}{otherwise}")
    return "\n".join(["{", *lines, space + "}"])


def swept(statements: Statements) -> Statements:
    """Return statements without those that compute what nothing reads."""
    while True:
        kept = _kept(statements, frozenset[str]().union(*_reads(statements)))
        if kept == tuple(statements):
            return kept
        statements = kept


def _reads(statements: Statements) -> Iterator[frozenset[str]]:
    for one in statements:
        if isinstance(one, Line):
            yield one.reads
        else:
            yield words(one.heading)
            yield from _reads((*one.body, *one.otherwise))


def _kept(statements: Statements, read: frozenset[str]) -> tuple[Line | Nest, ...]:
    kept = list[Line | Nest]()
    for one in statements:
        if isinstance(one, Line):
            kept += [one] if not one.sets or one.sets in read else []
        elif (body := _kept(one.body, read)) or one.otherwise:
            otherwise = _kept(one.otherwise, read)
            kept += [Nest(one.heading, body, otherwise)] if body or otherwise else []
    return tuple(kept)
