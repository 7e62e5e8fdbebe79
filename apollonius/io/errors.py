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
        super().__init__(shown(message, LONGEST_MESSAGE))


def shown(value: object, longest: int = _LONGEST_VALUE) -> str:
    """Return a value as part of a message: one line without control characters, its middle left out if it is long."""
    try:
        text = str(value).lower() if isinstance(value, bool) else str(value)  # as TOML and JSON write it
    except ValueError:  # Python writes no whole number of more than 4,300 digits
        text = "a number of thousands of digits"
    if len(text) > longest:
        text = f"{text[: longest * 2 // 3]} ... {text[-longest // 3 :]}"
    text = " ".join(text.splitlines())
    return text if text.isprintable() else "".join(one if one.isprintable() else ascii(one)[1:-1] for one in text)


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name nearest to a misspelt one, if one is near."""
    spelt = {one.lower(): one for one in known}
    near = difflib.get_close_matches(name.lower(), spelt, n=5)
    near = [one for one in near if sorted(one) == sorted(name.lower())] or near  # two letters changed places
    return spelt[near[0]] if near else None


def unknown_name(kind: str, name: str, known: str, meant: str | None) -> str:
    """Return the message that refuses the unknown name of a kind of thing: what is `meant`, or else what is `known`."""
    remedy = f"did you mean '{meant}'?" if meant else f"{known}."
    return f"unknown {kind} '{shown(name)}'; {remedy}"


def require(holds: Any, name: str, value: object, bound: str) -> None:
    """Refuse a value of this name, by InvalidInput, unless the condition holds: "it must be" within the bound."""
    if not holds:
        raise InvalidInput(f"{name} = {shown(value)} is not possible: it must be {bound}.")


def require_printable(name: str, text: str) -> None:
    """Refuse, by InvalidInput, a text of this name unless it is one line of modest length that can be printed."""
    require(text == shown(text, LONGEST_MESSAGE), name, text, "a line that can be printed")


def require_positive(record: object, *names: str) -> None:
    """Refuse, by InvalidInput, a record unless its fields of these names are positive; whole ones of 31 bits."""
    for name in names:
        value = getattr(record, name)
        require(value > 0, name, value, "more than 0")
        require(isinstance(value, float) or value < 2**31, name, value, f"at least 1, at most {2**31 - 1:,}")


def require_within(record: object, low: int | float, high: int | float, *names: str) -> None:
    """Refuse, by InvalidInput, a record unless its fields of these names are from `low` to `high`."""
    for name in names:
        value = getattr(record, name)
        require(low <= value <= high, name, value, f"from {low:,} to {high:,}")


EXTRAS = {
    "plot": {
        "matplotlib": "matplotlib", "jinja2": "jinja2", "markupsafe": "markupsafe", "markdown_it": "markdown-it-py",
    },
    "gym": {"gymnasium": "gymnasium", "pettingzoo": "pettingzoo"},
    "slurm": {"submitit": "submitit"},
    "ray": {"ray": "ray"},
    "track": {"tensorboardX": "tensorboardX", "wandb": "wandb", "mlflow": "mlflow", "trackio": "trackio"},
    "export": {"jax2onnx": "jax2onnx", "onnxruntime": "onnxruntime"},
    "sim": {"mujoco": "mujoco"},
    "bag": {"rosbags": "rosbags"},
}  # fmt: skip
"""Modules of each extra, and what pip calls them."""
TRACKERS = {module.removesuffix("X"): module for module in EXTRAS["track"]}
"""The module of each tracker."""


def missing(extra: str, *needed: str) -> str | None:
    """Return the command that installs what an extra lacks, or these modules of it; None if nothing is missing."""
    names = [EXTRAS[extra][module] for module in needed or EXTRAS[extra] if find_spec(module) is None]
    return f"pip install {' '.join(names)} (the extra '{extra}')" if names else None


def require_extra(extra: str, what: str) -> None:
    """Refuse work that needs libraries which are not installed, by InvalidInput with the command that installs them."""
    if remedy := missing(extra):
        raise InvalidInput(f"{what} needs libraries that are not installed: {remedy}.")
