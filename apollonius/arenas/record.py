"""Configurations as plain data and back: strict, so that a misspelt key is an error and not a default."""

from dataclasses import fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin

import dacite

from apollonius.arenas.map_file import load_map
from apollonius.arenas.random_arena import is_drawn, random_map
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.scenario import Scenario
from apollonius.io.errors import InvalidInput, nearest, require, shown

T = TypeVar("T")
_LARGEST_WHOLE = 2**1000
"""A whole number below this has a real one."""
_SINGULAR = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
_PLURAL = {bool: "true and false", int: "whole numbers", float: "numbers", str: "names"}
_DERIVED = ("chart",)
"""Fields that follow from others: no file says them."""


def to_dict(config: Any) -> dict[str, Any]:
    """A configuration (a game, a training run) as nested dictionaries, lists and numbers.

    Of an occupancy map, millions of numbers, it says the file, or how it was drawn, and the SHA-256 of what is in it.
    """
    return _plain(config)


def from_dict(kind: type[T], data: dict[str, Any], source: str, folder: Path = Path()) -> T:
    """A configuration from nested dictionaries; what is left out has its default.

    Args:
        kind: class of the configuration.
        data: what `to_dict` wrote, or a user did.
        source: where the data come from, for the message.
        folder: where the files are that they name.

    Raises:
        InvalidInput: for an unknown key, a value of the wrong kind, or an impossible one.
    """
    hooks = {float: _real, int: _whole, OccupancyMap: lambda named: find_map(named, folder), Scenario: _scenario}
    try:
        _require_lists(kind, data)
        return dacite.from_dict(kind, data, dacite.Config(strict=True, cast=[tuple], type_hooks=hooks))
    except dacite.UnexpectedDataError as error:
        unknown = sorted(error.keys)[0]
        raise InvalidInput(f"{source}: {_unknown_key(unknown, kind)}") from error
    except dacite.WrongTypeError as error:  # and where none of several types fits
        raise InvalidInput(f"{source}: {_wrong_kind(error, data)}") from error
    except dacite.DaciteError as error:
        raise InvalidInput(f"{source}: {error}; correct the value.") from error
    except InvalidInput as error:
        raise InvalidInput(f"{source}: {error}") from error
    except (
        TypeError,
        ValueError,
        ArithmeticError,
        AttributeError,
        RecursionError,
    ) as error:  # a number where a list is due, a table where there are several
        raise InvalidInput(f"{source}: a value is of the wrong kind ({error}); correct it.") from error


def find_map(named: Any, folder: Path) -> OccupancyMap:
    """The map that a record names: by its YAML file, or by that and its digest, as `to_dict` does.

    In the file's place may stand the name of a map that was drawn at random.

    Raises:
        InvalidInput: for anything else, and as `load_map` and `random_map`.
    """
    if isinstance(named, OccupancyMap):
        return named
    said = {"file": named, "sha256": None} if isinstance(named, str) else named
    if isinstance(said, dict) and set(said) == {"file", "sha256"} and isinstance(said["file"], str):
        name, digest = said["file"], said["sha256"]
        if digest is None or isinstance(digest, str):
            return random_map(name, digest) if is_drawn(name) else load_map(folder / name, digest)
    raise InvalidInput(f"map = {named} is not possible: it must be the name of a ROS map's YAML file.")


def _scenario(named: Any) -> Scenario:
    """Those that a record names."""
    from apollonius.arenas.suite import find_scenario  # which reads records itself

    return named if isinstance(named, Scenario) else find_scenario(named)


def _real(value: Any) -> Any:
    """A whole number serves as a real one, as people write 1 for 1.0; anything else is left for the type check."""
    return float(value) if type(value) is int and abs(value) < _LARGEST_WHOLE else value


def _whole(value: Any) -> Any:
    """True and False, which Python counts among the whole numbers, are none."""
    if isinstance(value, bool):
        raise InvalidInput(f"{value} is not possible: it must be a whole number.")
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, Scenario):
        if not value.name:
            raise InvalidInput("a game in one of several arenas has no file: write it in each of them.")
        return value.name
    if isinstance(value, OccupancyMap):
        return {"file": value.file, "sha256": value.digest}
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value) if field.name not in _DERIVED}
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def _kinds(kind: Any) -> list[Any]:
    """Return the types that a value may have, without None."""
    return [one for one in (get_args(kind) if isinstance(kind, UnionType) else (kind,)) if one is not NoneType]


def _require_lists(kind: Any, data: dict[str, Any], within: str = "") -> None:
    """Refuse what is no list where there must be one: dacite takes text for a list of letters."""
    for name in kind.__dataclass_fields__.keys() & data.keys():
        value, kinds = data[name], _kinds(kind.__dataclass_fields__[name].type)
        if all(get_origin(one) is tuple for one in kinds) and value is not None:
            require(isinstance(value, list | tuple), within + name, value, "a list")
        for inner in kinds:
            if is_dataclass(inner) and isinstance(value, dict):
                _require_lists(inner, value, f"{within}{name}.")


def _wrong_kind(error: dacite.WrongTypeError, data: Any) -> str:
    """Return what is wrong with a value whose type is none that it may have."""
    given = data
    for part in str(error.field_path).split("."):
        given = given.get(part, error.value) if isinstance(given, dict) else error.value
    return f"{error.field_path} = {shown(given)} is not possible: it must be {_in_words(error.field_type)}."


def _in_words(kind: Any) -> str:
    """Return what values of a type are called in a file."""
    first, *_ = _kinds(kind)
    if get_origin(first) is Literal:
        return f"one of {', '.join(map(str, get_args(first)))}"
    if get_origin(first) is tuple:
        inner = get_args(first)[0]
        return f"a list of {'tables' if is_dataclass(inner) else _PLURAL.get(inner, 'lists')}"
    return "a table" if is_dataclass(first) else _SINGULAR.get(first, "of another kind")


def _unknown_key(key: str, kind: Any) -> str:
    """Return what is wrong with a key: it is in another table than its own, or misspelt."""
    tables = _tables(kind)
    if homes := [f"[{table}]" if table else "the top, before all tables" for table in tables.get(key, [])]:
        return f"'{key}' is in another table than its own: move it to {' or '.join(homes[:3])}."
    near = nearest(key, tables)
    return f"'{key}' is no known key: remove it" + (f", or did you mean '{near}'?" if near else ".")


def _tables(kind: Any, within: str = "") -> dict[str, list[str]]:
    """Return for the name of each field of a nested configuration the tables that have it; the outermost is empty."""
    found: dict[str, list[str]] = {}
    for name, field in kind.__dataclass_fields__.items():
        found.setdefault(name, []).append(within)
        for inner in (field.type, *get_args(field.type)):
            if is_dataclass(inner) and inner not in (Scenario, OccupancyMap):  # which records name
                for deeper, tables in _tables(inner, f"{within}.{name}" if within else name).items():
                    found.setdefault(deeper, []).extend(tables)
    return found
