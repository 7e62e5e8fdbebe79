"""Records as plain data and back: strict, so that a misspelt key is an error and not a default."""

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin

import dacite

from apollonius.io.errors import InvalidInput, closest_names, format_value, require

T = TypeVar("T")
Hooks = Mapping[type, Callable[[Any], Any]]
"""Functions by class, for values that a record holds in another form than their fields'."""
_LARGEST_WHOLE = 2**1000
"""A whole number below this has a real one."""
_SINGULAR = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
_PLURAL = {bool: "true and false", int: "whole numbers", float: "numbers", str: "names"}


def write_record(value: Any, hooks: Hooks, derived: tuple[str, ...] = ()) -> Any:
    """Return a dataclass as nested dictionaries, lists and numbers, without None and without
    `derived` fields.
    """
    if type(value) in hooks:
        return hooks[type(value)](value)
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.name not in derived]
        value = {name: getattr(value, name) for name in names}
    if isinstance(value, dict):
        items = {key: item for key, item in value.items() if item is not None}
        return {key: write_record(item, hooks, derived) for key, item in items.items()}
    if isinstance(value, (list, tuple)):
        return [write_record(item, hooks, derived) for item in value]
    return value


def read_record(
    kind: type[T], data: dict[str, Any], source: str, hooks: Hooks, named: tuple[type, ...] = ()
) -> T:
    """Make a dataclass from nested dictionaries; missing values have their defaults.

    Args:
        kind: The dataclass.
        data: The dictionaries.
        source: Where they are from, for messages.
        hooks: Functions by class, for values in another form.
        named: Classes that are represented by a name instead of their fields.

    Raises:
        InvalidInput: For an unknown key, a value of the wrong kind, or an impossible one.
    """
    try:
        _require_lists(kind, data, "")
        config = dacite.Config(
            strict=True, cast=[tuple], type_hooks={float: _real, int: _no_truth} | dict(hooks)
        )
        return dacite.from_dict(kind, data, config)
    except dacite.UnexpectedDataError as error:
        unknown = sorted(error.keys)[0]
        raise InvalidInput(f"{source}: {_unknown_key(unknown, kind, named)}") from error
    except dacite.WrongTypeError as error:  # and where none of several types fits
        raise InvalidInput(f"{source}: {_wrong_kind(error, data)}") from error
    except dacite.MissingValueError as error:
        raise InvalidInput(f"{source}: {error.field_path} is missing: add it.") from error
    except dacite.DaciteError as error:
        raise InvalidInput(f"{source}: {error}; correct the value.") from error
    except InvalidInput as error:
        raise InvalidInput(f"{source}: {error}") from error
    except (TypeError, ValueError, ArithmeticError, AttributeError, RecursionError) as error:
        # A number in the place of a list, a table in the place of several.
        raise InvalidInput(
            f"{source}: a value is of the wrong kind ({error}); correct it."
        ) from error


def _real(value: Any) -> Any:
    """Accept a whole number for a real one, as people write 1 for 1.0; leave the rest for the type
    check.
    """
    if type(value) is int and abs(value) < _LARGEST_WHOLE:
        return float(value)
    return _no_truth(value)


def _no_truth(value: Any) -> Any:
    """Return a value that the type check refuses for True and False, which Python counts among the
    numbers.
    """
    return str(value) if isinstance(value, bool) else value


def _kinds(kind: Any) -> list[Any]:
    """Return the types that a value may have, without None."""
    members = get_args(kind) if isinstance(kind, UnionType) else (kind,)
    return [member for member in members if member is not NoneType]


def _require_lists(kind: Any, value: Any, path: str) -> None:
    """Refuse anything but lists for tuples, at a path and within: dacite takes text for a list of
    letters.
    """
    kinds = _kinds(kind)
    if all(get_origin(alternative) is tuple for alternative in kinds) and value is not None:
        require(isinstance(value, list | tuple), path, _quoted(value), "a list")
        for item in value:
            _require_lists(get_args(kinds[0])[0], item, path)
    if not isinstance(value, dict):
        return
    for table in filter(is_dataclass, kinds):
        for name in table.__dataclass_fields__.keys() & value.keys():
            type_of_field = table.__dataclass_fields__[name].type
            _require_lists(type_of_field, value[name], f"{path}.{name}" if path else name)


def _wrong_kind(error: dacite.WrongTypeError, data: Any) -> str:
    """Return the complaint about a value of a wrong type."""
    value = data
    for part in str(error.field_path).split("."):
        value = value.get(part, error.value) if isinstance(value, dict) else error.value
    bound = _in_words(error.field_type)
    shown = format_value(_quoted(value))
    return f"{error.field_path} = {shown} is not possible: it must be {bound}."


def _quoted(value: Any) -> Any:
    """Return text with its quotation marks, so that "1" is not taken for 1."""
    return f'"{value}"' if isinstance(value, str) else value


def _in_words(kind: Any) -> str:
    first, *_ = _kinds(kind)
    if get_origin(first) is Literal:
        return f"one of {', '.join(map(str, get_args(first)))}"
    if get_origin(first) is tuple:
        inner = get_args(first)[0]
        if is_dataclass(inner):
            return "a list of tables"
        parts = get_args(inner)
        if get_origin(inner) is tuple and ... not in parts:
            return f"a list of lists of {len(parts)} {_PLURAL.get(_kinds(parts[0])[0], 'values')}"
        return f"a list of {_PLURAL.get(inner, 'lists')}"
    return "a table" if is_dataclass(first) else _SINGULAR.get(first, "of another kind")


def _unknown_key(key: str, kind: Any, named: tuple[type, ...]) -> str:
    """Return the complaint about a key in a wrong table, or misspelt."""
    tables = _tables(kind, named)
    homes = [
        f"[{table}]" if table else "the top, before all tables" for table in tables.get(key, [])
    ]
    if homes:
        places = " or ".join(homes[:3])
        return f"'{key}' is in another table than its own: move it to {places}."
    near = closest_names(key, tables)
    return f"unknown key '{key}'; " + (f"did you mean '{near}'?" if near else "remove it.")


def _tables(kind: Any, named: tuple[type, ...], within: str = "") -> dict[str, list[str]]:
    """Return the tables that have each field of a nested dataclass; the outermost is empty."""
    tables_by_field: dict[str, list[str]] = {}
    for name, field in kind.__dataclass_fields__.items():
        tables_by_field.setdefault(name, []).append(within)
        for inner in (field.type, *get_args(field.type)):
            if is_dataclass(inner) and inner not in named:
                inner_name = f"{within}.{name}" if within else name
                for deeper, tables in _tables(inner, named, inner_name).items():
                    tables_by_field.setdefault(deeper, []).extend(tables)
    return tables_by_field
