"""Games as files: a TOML file says what differs from the defaults, or a name stands for a game."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from apollonius.arenas.record import find_map, from_dict
from apollonius.arenas.scenarios import is_scenario, scenario_game
from apollonius.arenas.suite import SUITES, suite_arena
from apollonius.document import parse_toml, read_bytes
from apollonius.errors import InvalidInput, require
from apollonius.game.game import Game
from apollonius.game.presets import PRESETS, make_game
from apollonius.game.validation import FEWER, MOST_DISCS, MOST_POLYGONS

GALLERY = Path(__file__).parent / "gallery"
"""Where the games that ship with the package as files lie."""


def game_names() -> list[str]:
    """The presets, then the gallery."""
    return [*PRESETS, *sorted(path.stem for path in GALLERY.glob("*.toml"))]


def about_game(name: str) -> str:
    """What a game that ships with the package is, in a line: a preset's docstring, or a file's first comment."""
    if name in PRESETS:
        return (PRESETS[name].__doc__ or "").splitlines()[0]
    return (GALLERY / f"{name}.toml").read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")


def find_game(name: str) -> Game:
    """The game of this name, preset or from the gallery, of this `.toml` file, or in this arena of a suite.

    `suite-v1/racks-07` is the `paper` game in that arena, `suite-v1/held-out` that in any of the arenas of that part,
    `suite-v1/maze-00,maze-01` that in either of the two.

    Raises:
        InvalidInput: for an unknown name, and as `load_game`, `suite_arena` and `scenario_game`.
    """
    if Path(name).suffix == ".toml":
        return load_game(Path(name))
    suite, _, within = name.partition("/")
    if is_scenario(name):
        return scenario_game(name)
    if suite in SUITES and within:
        return replace(make_game("paper"), arena=suite_arena(suite, within))
    if name not in game_names():
        raise InvalidInput(
            f"no game is called '{name}': choose one of {', '.join(game_names())}, one of a suite, as "
            f"'{SUITES[0]}/racks-07', or give a .toml file."
        )
    return make_game(name) if name in PRESETS else load_game(GALLERY / f"{name}.toml")


def load_game(path: Path) -> Game:
    """The game of a TOML file: tables `arena`, `pursuer`, `evader`, `starts`, `reward`, and the game's own numbers.

    What is left out has its default, and the walls of an arena with a map are the map's ends; see `docs/rules.md`.

    Raises:
        InvalidInput: when the file is missing or no TOML, for an unknown key, and for a game that cannot be played.
    """
    data = parse_toml(read_bytes(path, "a game's .toml file", "check the path, or name a preset"), path)
    arena = data.get("arena")
    _check_obstacles(arena, path)
    if isinstance(arena, dict) and "map" in arena:
        arena["map"] = found = find_map(arena["map"], path.parent)
        data["arena"] = {"x_min": found.x, "x_max": found.x_max, "y_min": found.y, "y_max": found.y_max} | arena
    return from_dict(Game, data, f"'{path}'")


def _check_obstacles(arena: Any, path: Path) -> None:
    """Refuse more obstacles than a game can have before any of them is made."""
    for kind, most in (("discs", MOST_DISCS), ("polygons", MOST_POLYGONS)):
        obstacles = arena.get(kind) if isinstance(arena, dict) else None
        if isinstance(obstacles, list):
            many = f"'{path}': arena.{kind}"
            require(len(obstacles) <= most, many, f"{len(obstacles):,} of them", f"at most {most}; {FEWER}")
