"""Files that are not as they were written: their data lie, or their bytes are damaged, at random."""

import json
import math
import struct
import tomllib
import zlib
from contextlib import suppress
from datetime import date
from typing import Any

import tomli_w
import yaml


def nested(depth):
    return {"a": nested(depth - 1)} if depth else 1


ODD = (
    None, True, False, -1, 0, 1, 2, 3, 17, 2**31, 2**63, 2**70, 10**400, 0.1, 0.5, 1e308, -1e308, 1e-320, math.nan,
    math.inf, "", "x", "1", "nan", "\x1b[2J\nok", "\0", "\ud800", "a" * 5_000, "..", "/dev/zero", "paper", "pursuer",
    "suite-v1/train", [], {}, [[]], [1], [0.5, 0.5], ["a"], {"x": 1}, [[1, 2], [3, 4], [1, 2]], nested(60), nested(400),
    date(2020, 2, 29),
)  # fmt: skip
"""Values in the place of others."""
NAMES = (
    "map", "scenario", "teams", "sensors", "drives", "chart", "discs", "vertices", "kinds", "evaluation", "__class__",
    "x" * 5_000, "\x1b[2J", "",
)  # fmt: skip
"""Keys beside others."""
PIECES = (
    b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\x1b[2J", b"\n", b"[" * 1_000, b"9" * 5_000, b"1e400", b"nan", b"-", b'"',
    b"'", b"{", b"}", b"#", b"=", b": ", b"&a ", b"*a", b"!!python/object:os.system ", struct.pack("<Q", 2**63),
    *(struct.pack("<f", number) for number in (math.nan, math.inf, 1e38)),
)  # fmt: skip
"""Bytes between others, or in their place."""


def damaged(content, rng):
    """Return bytes of which some are flipped, cut out, doubled, put in or written over."""
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4))):
        start, size = rng.randrange(len(changed) + 1), rng.choice((1, 1, 4, 20, len(content)))
        here = slice(start, start + size)
        match rng.randrange(6):
            case 0 if start < len(changed):
                changed[start] ^= 1 << rng.randrange(8)
            case 1 if start < len(changed):
                changed[start] = rng.randrange(256)
            case 2:
                del changed[here]
            case 3:
                changed[start:start] = changed[here]
            case 4:
                changed[start:start] = rng.choice(PIECES)
            case _:
                piece = rng.choice((*PIECES, bytes(changed[rng.randrange(len(changed) + 1) :][:size])))
                changed[start : start + len(piece)] = piece
    return bytes(changed)


def lie(data, rng):
    """Change one value at any depth of a list or table."""
    place = data
    while True:
        keys = list(place) if isinstance(place, dict) else range(len(place))
        key = rng.choice(keys) if keys else None
        if key is None or not isinstance(place[key], dict | list) or rng.random() < 0.3:
            break
        place = place[key]
    what = rng.randrange(12) if keys else 0
    value = None if key is None else place[key]
    if what == 0 and isinstance(place, dict):
        place[rng.choice(NAMES)] = rng.choice(ODD)
    elif what == 0:
        place.append(rng.choice(ODD))
    elif what == 1:
        del place[key]
    elif what == 2:
        place[key] = place[rng.choice(keys)]
    elif what < 7 and isinstance(value, list):
        place[key] = value * rng.choice((2, 300))
    elif what < 7 and type(value) in (int, float):
        place[key] = value * rng.choice((0.5, 1.01, 2, -1))
    else:
        alike = [one for one in ODD if type(one) is type(value)] if rng.random() < 0.5 else ()
        place[key] = rng.choice(alike or ODD)


def header_of(content):
    """Return the header of a file in safetensors: the package's texts, which are JSON, and what it says of arrays."""
    arrays = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    return {"texts": {name: json.loads(text) for name, text in arrays.pop("__metadata__").items()}, "arrays": arrays}


def with_header(header, content):
    """Return the same file with another header."""
    texts = {name: text if isinstance(text, str) else json.dumps(text) for name, text in header["texts"].items()}
    written = json.dumps(header["arrays"] | {"__metadata__": texts}).encode()
    return len(written).to_bytes(8, "little") + written + content[8 + int.from_bytes(content[:8], "little") :]


def with_damaged_chunks(content, rng):
    """Return a PNG image of which one part has changed, and has the right length and sum."""
    parts, start = [], 8
    while start < len(content):
        size = int.from_bytes(content[start : start + 4], "big")
        parts.append([content[start + 4 : start + 8], content[start + 8 : start + 8 + size]])
        start += 12 + size
    part = rng.choice(parts)
    part[1] = damaged(part[1], rng)
    return content[:8] + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in parts
    )


FORMS: dict[str, tuple[Any, Any]] = {
    "json": (json.loads, lambda data, _: json.dumps(data).encode()),
    "toml": (lambda content: tomllib.loads(content.decode()), lambda data, _: tomli_w.dumps(data).encode()),
    "yaml": (yaml.safe_load, lambda data, _: yaml.safe_dump(data).encode()),
    "lines": (
        lambda content: [json.loads(line) for line in content.splitlines()],
        lambda data, _: b"".join(json.dumps(line).encode() + b"\n" for line in data),
    ),
    "arrays": (header_of, with_header),
}
"""How files of each form become data, and data become files."""


def mutated(form, content, rng):
    """Return another file in place of one that is sound: its data lie, or its bytes are damaged."""
    if form == "png" and rng.random() < 0.7:
        return with_damaged_chunks(content, rng)
    if form not in FORMS or rng.random() < 0.3:
        return damaged(content, rng)
    loads, dumps = FORMS[form]
    while True:
        data = loads(content)
        # Some lies cannot be written: TOML has no null, JSON no date, UTF-8 no half of a character.
        with suppress(LookupError, TypeError, ValueError, ArithmeticError, RecursionError, AttributeError):
            for _ in range(rng.choice((1, 1, 1, 1, 2))):
                lie(data, rng)
            return dumps(data, content)
