"""A sweep of trainings: one for each seed and each value of any fields of their config."""

import difflib
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from apollonius.arenas.record import from_dict, to_dict
from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import TRAININGS
from apollonius.learn.config import RunConfig


def sweep(config: RunConfig, values: Mapping[str, Sequence[Any]]) -> dict[str, RunConfig]:
    """Return the trainings of a sweep by name, as `dqn.batch=64,seed=3`: all combinations of the values.

    Args:
        values: of each varied field, by its dotted path in a config's file.

    Raises:
        InvalidInput: for an unknown field, a value that it cannot have, and too many trainings.
    """
    combinations = list(itertools.product(*values.values()))
    TRAININGS.require("trainings", len(combinations))
    found: dict[str, RunConfig] = {}
    for combination in combinations:
        changes = dict(zip(values, combination, strict=True))
        name = ",".join(f"{field}={_in_name(value)}" for field, value in changes.items())
        data = to_dict(config)
        for field, value in changes.items():
            _set(data, field, value)
        found[name] = from_dict(RunConfig, data, name)
    require(len(found) == len(combinations), "values", ", ".join(found), "different ones")
    return found


def _in_name(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return "".join(letter if letter.isalnum() or letter in "+-._" else "-" for letter in text)


def _set(data: dict[str, Any], field: str, value: Any) -> None:
    """Set a field of a config's record; one that is misspelt is refused when the record is read."""
    *tables, key = field.split(".")
    inner = data
    for table in tables:
        if not isinstance(inner.get(table), dict):
            near = difflib.get_close_matches(field, _dotted(data), n=1, cutoff=0.0)[0]
            raise InvalidInput(f"the training has no field '{field}': did you mean '{near}'?")
        inner = inner[table]
    inner[key] = value


def _dotted(data: dict[str, Any]) -> list[str]:
    inner = {name: _dotted(value) if isinstance(value, dict) else None for name, value in data.items()}
    return [f"{name}.{deeper}" if deeper else name for name, below in inner.items() for deeper in below or [""]]
