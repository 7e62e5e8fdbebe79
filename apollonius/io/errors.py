"""Refusals of impossible input: one line that names the value, the bound and the remedy."""

import difflib
from collections.abc import Iterable
from importlib.util import find_spec
from typing import Any

_LONGEST_VALUE = 200
"""Most characters of a value that a message shows."""
LONGEST_MESSAGE = 1_000
"""Most characters of a message."""


class InvalidInput(ValueError):
    """An error about given input. Its message is one line, fit to be shown as it is."""

    def __init__(self, message: str) -> None:
        super().__init__(format_value(message, LONGEST_MESSAGE))


def format_value(value: object, longest: int = _LONGEST_VALUE) -> str:
    """Format a value for a message: one line without control characters and, if long, without its
    middle.
    """
    try:
        # as TOML and JSON write it
        text = str(value).lower() if isinstance(value, bool) else str(value)
    except ValueError:  # Python writes no whole number of more than 4,300 digits
        text = "a number of thousands of digits"
    if len(text) > longest:
        text = f"{text[: longest * 2 // 3]} ... {text[-longest // 3 :]}"
    text = " ".join(text.splitlines())
    characters = (letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)
    return text if text.isprintable() else "".join(characters)


def closest_names(name: str, choices: Iterable[str]) -> str | None:
    """Return the known name nearest to a misspelt one, if one is near."""
    name_of_lower = {candidate.lower(): candidate for candidate in choices}
    near = difflib.get_close_matches(name.lower(), name_of_lower, n=5)
    # two letters changed places
    near = [candidate for candidate in near if sorted(candidate) == sorted(name.lower())] or near
    return name_of_lower[near[0]] if near else None


def unknown_name(kind: str, name: str, choices: str, suggestion: str | None) -> str:
    """Return the message that refuses an unknown name.

    Args:
        kind: The kind of thing.
        name: The unknown name.
        choices: Sentence about the possible names.
        suggestion: The nearest possible name, which replaces that sentence.
    """
    remedy = f"did you mean '{suggestion}'?" if suggestion else f"{choices}."
    return f"unknown {kind} '{format_value(name)}'; {remedy}"


def require(holds: Any, name: str, value: object, bound: str) -> None:
    """Raise InvalidInput(`name = value is not possible: it must be {bound}.`) unless a condition
    holds.

    Args:
        holds: The condition.
        name: Name of the value.
        value: The value.
        bound: The bound in words.
    """
    if not holds:
        raise InvalidInput(f"{name} = {format_value(value)} is not possible: it must be {bound}.")


def require_printable(name: str, text: str) -> None:
    """Refuse, by InvalidInput, a text of this name unless it is one line of modest length that can
    be printed.
    """
    require(text == format_value(text, LONGEST_MESSAGE), name, text, "a line that can be printed")


def require_positive(record: object, *names: str) -> None:
    """Raise InvalidInput unless these fields of a record are positive, and whole numbers below
    2^31.
    """
    for name in names:
        value = getattr(record, name)
        require(value > 0, name, value, "more than 0")
        require(
            isinstance(value, float) or value < 2**31,
            name,
            value,
            f"at least 1, at most {2**31 - 1:,}",
        )


def require_within(record: object, low: int | float, high: int | float, *names: str) -> None:
    """Raise InvalidInput unless these fields of a record are from `low` to `high`."""
    for name in names:
        value = getattr(record, name)
        require(low <= value <= high, name, value, f"from {low:,} to {high:,}")


EXTRAS = {
    "plot": {
        "matplotlib": "matplotlib",
        "jinja2": "jinja2",
        "markupsafe": "markupsafe",
        "markdown_it": "markdown-it-py",
    },
    "gym": {"gymnasium": "gymnasium", "pettingzoo": "pettingzoo"},
    "openspiel": {"pyspiel": "open_spiel"},
    "slurm": {"submitit": "submitit"},
    "ray": {"ray": "ray"},
    "track": {name: name for name in ("tensorboardX", "wandb", "mlflow", "trackio")},
    "export": {"jax2onnx": "jax2onnx", "onnxruntime": "onnxruntime"},
    "sim": {"mujoco": "mujoco"},
    "bag": {"rosbags": "rosbags"},
}
"""Modules of each extra, and their names for pip."""
TRACKERS = {module.removesuffix("X"): module for module in EXTRAS["track"]}
"""The module of each tracker."""


def missing_extra(extra: str, *needed: str) -> str | None:
    """Return the command that installs what an extra lacks, or these modules of it; None if nothing
    is missing.
    """
    modules = needed or EXTRAS[extra]
    names = [EXTRAS[extra][module] for module in modules if find_spec(module) is None]
    return f"pip install {' '.join(names)} (the extra '{extra}')" if names else None


def require_extra(extra: str, what: str) -> None:
    """Refuse work that needs libraries which are not installed, by InvalidInput with the command
    that installs them.
    """
    remedy = missing_extra(extra)
    if remedy:
        raise InvalidInput(f"{what} needs libraries that are not installed: {remedy}.")
