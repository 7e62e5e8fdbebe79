"""Names of games and arenas, known without JAX, so that a misspelt one is refused at once."""

from pathlib import Path

from apollonius.game.names import PRESETS
from apollonius.io.errors import closest_names, unknown_name

GALLERY = Path(__file__).parent / "gallery"
"""Folder of the game files that ship with the package."""
SUITES = ("suite-v1", "suite-v2", "suite-v3")
"""All suites. Each is a file beside this one and never changes: another list is another suite."""
PARTS = ("train", "held-out")
"""Purposes of the arenas of a suite."""
KINDS = (
    *("discs", "blocks", "rooms", "maze", "racks", "caves", "labyrinth", "fences", "floors"),
    "buildings",
)
"""Kinds of random arenas."""


def game_names() -> list[str]:
    """Return the names of the presets, then those of the gallery."""
    return [*PRESETS, *sorted(path.stem for path in GALLERY.glob("*.toml"))]


def unknown_game(name: str) -> str:
    in_suite = f"one of a suite, as '{SUITES[0]}/racks-07'"
    in_teams = "one of teams, as 'team-3v1' or 'team-3v1/office'"
    named = f"choose one of {', '.join(game_names())}"
    choices = f"{named}, or give {in_suite}, {in_teams}, or a .toml or .json file"
    return unknown_name("game", name, choices, closest_names(name, game_names()))
