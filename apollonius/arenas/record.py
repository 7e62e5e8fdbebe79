"""Games and other configurations as records: an occupancy map and a scenario by their names."""

from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from apollonius.arenas.map_file import load_map
from apollonius.arenas.random_arena import is_drawn, random_map
from apollonius.arenas.suite import find_scenario
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.presets import make_game
from apollonius.game.scenario import Scenario
from apollonius.io.errors import InvalidInput, require
from apollonius.io.record import read_record, write_record

T = TypeVar("T")


def to_dict(config: Any) -> dict[str, Any]:
    """Return a configuration (a game, a training run) as nested dictionaries, lists and numbers.

    An occupancy map, millions of numbers, is given by its file, or its random arena, and its SHA-256.
    """
    hooks = {Scenario: _name, OccupancyMap: lambda found: {"file": found.file, "sha256": found.digest}}
    return write_record(config, hooks, derived=("chart",))


def from_dict(kind: type[T], data: dict[str, Any], source: str, folder: Path = Path()) -> T:
    """Return a configuration from nested dictionaries; missing values have their defaults.

    A game within a configuration can be the name of a preset. The walls of an arena with a map are the map's ends,
    unless the record gives others. Files that it names lie in the folder. Raises InvalidInput for an unknown key, and
    for a value that is of the wrong kind or impossible, with the source of the data.
    """
    hooks = {
        Game: lambda given: make_game(given) if isinstance(given, str) else given,
        Arena: partial(_with_map, folder=folder),
        Scenario: lambda named: named if isinstance(named, Scenario) else find_scenario(named),
    }
    return read_record(kind, data, source, hooks, named=(Scenario, OccupancyMap))


def _name(scenario: Scenario) -> str:
    require(scenario.name, "scenario", "without a name", "written as a game in each of its arenas, as no file holds it")
    return scenario.name


def _with_map(arena: Any, folder: Path) -> Any:
    """Read the map that the data of an arena name, by its YAML file or as `to_dict` does."""
    if not isinstance(arena, dict) or arena.get("map") is None:
        return arena
    named = arena["map"]
    wanted = {"file": named, "sha256": None} if isinstance(named, str) else named
    is_named = isinstance(wanted, dict) and set(wanted) == {"file", "sha256"}
    if not is_named or not isinstance(wanted["file"], str) or not isinstance(wanted["sha256"], str | None):
        raise InvalidInput(f"map = {named} is not possible: it must be the name of a ROS map's YAML file.")
    name, digest = wanted["file"], wanted["sha256"]
    found = random_map(name, digest) if is_drawn(name) else load_map(folder / name, digest)
    ends = {"x_min": found.x, "x_max": found.x_max, "y_min": found.y, "y_max": found.y_max}
    return ends | arena | {"map": found}
