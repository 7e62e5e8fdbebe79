"""Games as files: a TOML file says what differs from the defaults, or a preset's name stands for one."""

import tomllib
from pathlib import Path

from apollonius.errors import InvalidInput, require
from apollonius.game.game import Game
from apollonius.game.presets import PRESETS, make_game
from apollonius.game.record import find_map, from_dict

GALLERY = Path(__file__).parent.parent / "gallery"
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
    """The game of this name, preset or from the gallery, or of this `.toml` file.

    Raises:
        InvalidInput: for an unknown name, and as `load_game`.
    """
    if Path(name).suffix == ".toml":
        return load_game(Path(name))
    if name not in game_names():
        raise InvalidInput(
            f"no game is called '{name}': choose one of {', '.join(game_names())}, or give a .toml file."
        )
    return make_game(name) if name in PRESETS else load_game(GALLERY / f"{name}.toml")


def load_game(path: Path) -> Game:
    """The game of a TOML file: tables `arena`, `pursuer`, `evader`, `starts`, `reward`, and the game's own numbers.

    What is left out has its default, and the walls of an arena with a map are the map's ends; see `docs/rules.md`.

    Raises:
        InvalidInput: when the file is missing or no TOML, for an unknown key, and for a game that cannot be played.
    """
    require(path.is_file(), "game", path, "a preset's name or a .toml file; check the path")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        reason = str(error) or "it is nested too deeply"
        raise InvalidInput(f"'{path}' is no TOML file: {reason}; correct it.") from error
    arena = data.get("arena")
    if isinstance(arena, dict) and "map" in arena:
        arena["map"] = found = find_map(arena["map"], path.parent)
        data["arena"] = {"x_min": found.x, "x_max": found.x_max, "y_min": found.y, "y_max": found.y_max} | arena
    return from_dict(Game, data, f"'{path}'")
