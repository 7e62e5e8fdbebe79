"""Games by name; they and other configurations as records; and games as TOML or JSON files."""

import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import tomli_w

from apollonius.arenas.map_file import load_map
from apollonius.arenas.names import GALLERY, SUITES, game_names, unknown_game
from apollonius.arenas.random_arena import is_random_map, random_map
from apollonius.arenas.suite import (
    arena_names,
    find_scenario,
    is_scenario,
    scenario_game,
    suite_arena,
)
from apollonius.game.arena import Arena, find_obstacle_kind, table_of
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.models import MODELS, model_name
from apollonius.game.names import TEAM
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Polygon
from apollonius.game.presets import PRESETS, in_teams, make_game
from apollonius.game.scenario import Scenario
from apollonius.io.document import parse_json, parse_toml, read_bytes, to_json, write_atomically
from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import GAME_FILES, ROBOTS
from apollonius.io.record import Hooks, read_record, write_record

T = TypeVar("T")


def describe_game(name: str) -> str:
    """Describe a game that ships with the package in a line: a preset's docstring, or a file's
    first comment.
    """
    if name in PRESETS:
        return (PRESETS[name].__doc__ or "").splitlines()[0]
    return (GALLERY / f"{name}.toml").read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")


def split_team(name: str) -> tuple[str | None, str]:
    """Split a game's name into its teams, as `team-3v1`, or None, and the game that they play."""
    team, slash, game = name.partition("/")
    if TEAM.fullmatch(team) and (game or not slash):
        return team, game or "paper"
    return None, name


def find_game(name: str) -> Game:
    """Return the game of a name: a preset, of the gallery, a `.toml` or `.json` file, or in an
    arena of a suite.

    `suite-v1/racks-07` is the `paper` game in that arena, `suite-v1/held-out` that in any of the
    arenas of that part, `suite-v1/maze-00,maze-01` that in either of the two. `team-3v1/office` is
    the game `office` with three pursuers and one evader. Raises InvalidInput for an unknown name,
    and as `load_game`, `suite_arena` and `scenario_game`.
    """
    team, of_two = split_team(name)
    counts = team and TEAM.fullmatch(team)
    if counts:
        return in_teams(find_game(of_two), int(counts[1]), int(counts[2]))
    suite, _, within = name.partition("/")
    if name.lower().endswith(GAME_FILES):
        return load_game(Path(name))
    if is_scenario(name):
        return scenario_game(name)
    if suite in SUITES and within:
        return replace(make_game("paper"), arena=suite_arena(suite, within))
    if name in PRESETS:
        return make_game(name)
    if name not in game_names():
        raise InvalidInput(unknown_game(name))
    return load_game(GALLERY / f"{name}.toml")


def game_in_one_arena(name: str, caller: str) -> Game:
    """Return the game of a name, for `caller`, which knows one arena only: raises InvalidInput for
    several.
    """
    game = find_game(name)
    if game.scenario is not None:
        team, _ = split_team(name)
        first = f"{team}/" * bool(team) + arena_names(game.scenario.name)[0]
        bound = (
            f"in one arena, which {caller} needs, and this one is in several: name one, as {first}"
        )
        require(False, "game", name, bound)
    return game


def as_game(data_or_name: object) -> Game:
    """Return a game, or that of a name; raises InvalidInput for anything else (`find_game`)."""
    if isinstance(data_or_name, Game):
        return data_or_name
    require(isinstance(data_or_name, str), "game", data_or_name, "a game, or the name of one")
    return find_game(str(data_or_name))


def to_dict(config: Any) -> dict[str, Any]:
    """Return a configuration (a game, a training run) as nested dictionaries, lists and numbers.

    An occupancy map, millions of numbers, is given by its file, or its random arena, and its
    SHA-256.
    """
    hooks: Hooks = {
        Scenario: _name,
        **dict.fromkeys(MODELS.values(), _robot_data),
        OccupancyMap: lambda occupancy: {"file": occupancy.file, "sha256": occupancy.digest},
    }
    return write_record(
        config, hooks | {Arena: partial(_arena_data, hooks=hooks)}, derived=("chart",)
    )


def from_dict(
    kind: type[T],
    data: dict[str, Any],
    source: str,
    folder: Path = Path(),
    hooks: Hooks = MappingProxyType({}),
) -> T:
    """Return a configuration from nested dictionaries; missing values have their defaults.

    A game within a configuration can be a name, as of `find_game`. The walls of an arena with a map
    are the map's ends, unless the record gives others.

    Args:
        kind: class of the configuration.
        data: its values by name.
        source: where they are from, for messages.
        folder: the folder of files that they name.
        hooks: functions by class, for further classes that a record holds in another form.

    Raises:
        InvalidInput: for an unknown key, and for a value of the wrong kind or an impossible one.
    """
    own_hooks: Hooks = {
        Game: lambda data_or_name: (
            find_game(data_or_name) if isinstance(data_or_name, str) else data_or_name
        ),
        Arena: lambda arena: _with_map(_with_extra(arena), folder),
        Polygon: _read_document,
        Unicycle: _read_robot,
        Scenario: lambda value: value if isinstance(value, Scenario) else find_scenario(value),
    }
    return read_record(kind, data, source, {**own_hooks, **hooks}, named=(Scenario, OccupancyMap))


def _name(scenario: Scenario) -> str:
    require(
        scenario.name,
        "scenario",
        "without a name",
        "written as a game in each of its arenas, as no file holds it",
    )
    return scenario.name


def _robot_data(body: Unicycle) -> dict[str, Any]:
    """Return a robot's record, with its model unless that is the usual one."""
    model = {} if type(body) is Unicycle else {"model": model_name(body)}
    return model | write_record(body, {})


def _read_robot(robot: Any) -> Any:
    """Read a robot of another model than the usual one, which stays as it is."""
    if not isinstance(robot, dict) or "model" not in robot:
        return robot
    limits = dict(robot)
    model = limits.pop("model")
    bound = f"one of {', '.join(MODELS)}"
    require(isinstance(model, str) and model in MODELS, "model", model, bound)
    kind = MODELS[model]
    return (
        limits if kind is Unicycle else read_record(kind, limits, f"a robot of model '{model}'", {})
    )


def _arena_data(arena: Arena, hooks: Hooks) -> dict[str, Any]:
    """Return an arena's record, with a list of tables for each kind of obstacles of other
    packages.
    """
    record = write_record(arena, hooks, derived=("extra",))
    for obstacle in arena.extra:
        table = table_of(type(obstacle))
        bound = (
            "one that register_obstacle, or an entry point of its package, gives a table in "
            "game files"
        )
        require(table is not None, "obstacle", type(obstacle).__name__, bound)
        record.setdefault(table, []).append(write_record(obstacle, hooks))
    return record


def _with_extra(arena: Any) -> Any:
    """Read the obstacles of other packages' kinds from the data of an arena; tables of no kind stay
    as they are.
    """
    if not isinstance(arena, dict) or arena.keys() <= Arena.__dataclass_fields__.keys() - {"extra"}:
        return arena
    require(
        "extra" not in arena,
        "arena.extra",
        "given",
        "left out: each kind of obstacles has a table of its own",
    )
    record = dict(arena)
    extra = []
    for table in [key for key in arena if key not in Arena.__dataclass_fields__]:
        kind = find_obstacle_kind(str(table))
        if kind:
            obstacles = record.pop(table)
            name = f"arena.{table}"
            is_list = isinstance(obstacles, list) and all(
                isinstance(obstacle, dict) for obstacle in obstacles
            )
            require(is_list, name, obstacles, f"tables [[{name}]]")
            extra += [
                read_record(kind, obstacle, f"{name}[{index}]", {})
                for index, obstacle in enumerate(obstacles)
            ]
    return record | {"extra": tuple(extra)}


def _read_document(polygon: Any) -> Any:
    """Leave out the last corner of a ring that is closed, as GeoJSON and WKT write it."""
    corners: Any = polygon.get("vertices") if isinstance(polygon, dict) else None
    is_closed = isinstance(corners, list) and len(corners) > 1 and corners[0] == corners[-1]
    return polygon | {"vertices": corners[:-1]} if is_closed else polygon


def _with_map(arena: Any, folder: Path) -> Any:
    """Read the map that the data of an arena name, by its YAML file or as `to_dict` does."""
    if not isinstance(arena, dict) or arena.get("map") is None:
        return arena
    entry = arena["map"]
    reference = {"file": entry, "sha256": None} if isinstance(entry, str) else entry
    is_reference = (
        isinstance(reference, dict)
        and set(reference) == {"file", "sha256"}
        and isinstance(reference["file"], str)
        and isinstance(reference["sha256"], str | None)
    )
    if not is_reference:
        raise InvalidInput(
            f"map = {entry} is not possible: it must be the name of a ROS map's YAML file."
        )
    name, digest = reference["file"], reference["sha256"]
    cells = random_map(name, digest) if is_random_map(name) else load_map(folder / name, digest)
    ends = {"x_min": cells.x, "x_max": cells.x_max, "y_min": cells.y, "y_max": cells.y_max}
    return ends | arena | {"map": cells}


def load_game(path: Path) -> Game:
    """Return the game of a TOML or JSON file (`docs/reference/game_files.md`).

    `pursuers = 3` gives that side three robots with the limits of the table `pursuer`; tables
    `[[pursuers]]` give it one with limits of its own for each; the same for `evaders`. Raises
    InvalidInput when the file is missing or neither, for an unknown key, and for a game that cannot
    be played.
    """
    content = read_bytes(path, "a game's .toml or .json file", "check the path, or name a preset")
    about = f"'{path}' is no JSON file; correct it"
    is_json = path.suffix.lower() == ".json"
    data = parse_json(content, about) if is_json else parse_toml(content, path)
    _read_teams(data, path)
    game = from_dict(Game, data, f"'{path}'", path.parent)
    has_one_source = game.scenario is None or game.arena == Arena()
    require(
        has_one_source,
        f"'{path}': arena",
        "given",
        "left out beside a scenario, in whose arenas the game is played",
    )
    return game


def save_game(record: dict[str, Any], path: Path) -> None:
    """Write the record of a game, of `to_dict`, to a `.toml` or `.json` file; its map is named from
    there.
    """
    arena = record["arena"]
    reference = arena.get("map")
    if isinstance(reference, dict) and not is_random_map(reference["file"]):
        file = os.path.relpath(reference["file"], path.parent)
        arena = arena | {"map": reference | {"file": file}}
    record = record | {"arena": arena}
    text = f"{to_json(record, indent=2)}\n" if path.suffix == ".json" else tomli_w.dumps(record)
    write_atomically(path, text.encode())


def _read_teams(data: dict[str, Any], path: Path) -> None:
    """Move a file's teams to their places in a game's record: the first robot, and its mates."""
    teams = {"mates_collide": data.pop("mates_collide")} if "mates_collide" in data else {}
    for side in ("pursuer", "evader"):
        entry = data.pop(f"{side}s", None)
        if entry is None:
            continue
        name, is_list = f"'{path}': {side}s", isinstance(entry, list)
        remedy = f"without a table [{side}] beside them; take that one away"
        require(not is_list or side not in data, name, "tables", remedy)
        ROBOTS.require(name, len(entry) if is_list else entry)
        bodies = entry if is_list else [data.get(side, {})] * entry
        data[side], teams[f"{side}s"] = bodies[0], bodies[1:]
    if any(teams.values()):
        data["teams"] = teams
