"""Configurations as plain data and back: strict, so that a misspelt key is an error and not a default."""

import difflib
from dataclasses import asdict, is_dataclass
from typing import Any, TypeVar

import dacite

from apollonius.errors import InvalidInput

T = TypeVar("T")


def to_dict(config: Any) -> dict[str, Any]:
    """A configuration (a game, a training run) as nested dictionaries, lists and numbers."""
    return _plain(asdict(config))


def from_dict(kind: type[T], data: dict[str, Any], source: str) -> T:
    """A configuration from nested dictionaries; what is left out has its default.

    Args:
        kind: class of the configuration.
        data: what `to_dict` wrote, or a user did.
        source: where the data come from, for the message.

    Raises:
        InvalidInput: for an unknown key, a value of the wrong kind, or an impossible one.
    """
    try:
        return dacite.from_dict(kind, data, dacite.Config(strict=True, cast=[tuple], type_hooks={float: _real}))
    except dacite.UnexpectedDataError as error:
        unknown = sorted(error.keys)[0]
        near = difflib.get_close_matches(unknown, _known_keys(kind), n=1, cutoff=0.0)[0]
        raise InvalidInput(f"{source}: '{unknown}' is no known key: remove it, or did you mean '{near}'?") from error
    except dacite.DaciteError as error:
        raise InvalidInput(f"{source}: {error}; correct the value.") from error
    except InvalidInput:
        raise
    except (TypeError, ValueError) as error:  # a number where a list is due, a table where there are several
        raise InvalidInput(f"{source}: a value is of the wrong kind ({error}); correct it.") from error


def _real(value: Any) -> Any:
    """A whole number serves as a real one, as people write 1 for 1.0; anything else is left for the type check."""
    return float(value) if type(value) is int else value


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def _known_keys(kind: Any) -> set[str]:
    """Names of all fields of a nested configuration."""
    names: set[str] = set()
    for name, field in kind.__dataclass_fields__.items():
        names |= {name} | (_known_keys(field.type) if is_dataclass(field.type) else set())
    return names
