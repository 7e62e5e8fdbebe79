"""Games as files: what is written is what is played, and what is wrong in one is said in a line."""

import pytest
import tomli_w

from apollonius.arenas.file import find_game, load_game, save_game
from apollonius.arenas.record import to_dict
from apollonius.game.arena import Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import PRESETS
from apollonius.io.errors import InvalidInput
from apollonius.io.limits import GAME_FILES

HALL = """
capture_distance = 0.6
max_steps = 300

[arena]
x_max = 12
y_max = 6.5

[[arena.discs]]
x = 6
y = 3
radius = 0.5

[pursuer]
v_max = 0.8
radius = 0.25

[evader]
v_max = 1
u2_max = 1.5
radius = 0.2

[starts]
clearance = 0.4
separation = 2
"""


@pytest.fixture
def written(tmp_path):
    """A function that writes a file and loads the game in it."""

    def load(content):
        path = tmp_path / "game.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return load_game(path)

    return load


def test_a_file_says_what_differs_from_the_defaults(written):
    game = written(HALL)
    assert game.pursuer == Unicycle(v_max=0.8, radius=0.25)
    assert game.evader == Unicycle(v_max=1.0, u2_max=1.5, radius=0.2)
    assert game.arena.discs == (Disc(6.0, 3.0, 0.5),)
    assert (game.arena.x_max, game.arena.y_max, game.arena.x_min) == (12.0, 6.5, 0.0)
    assert (game.capture_distance, game.max_steps, game.dt) == (0.6, 300, Game().dt)
    assert (game.starts.clearance, game.starts.separation, game.starts.speed) == (0.4, 2.0, "rest")
    assert written("") == Game()


@pytest.mark.parametrize("name", [*PRESETS, "team-3v1"])
@pytest.mark.parametrize("suffix", GAME_FILES)
def test_every_preset_is_itself_again_from_its_file(name, suffix, tmp_path):
    game = find_game(name)
    save_game(to_dict(game), tmp_path / f"game{suffix}")
    assert find_game(str(tmp_path / f"game{suffix}")) == game


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("dt = ", "no TOML file"),
        (b"\xff\xfe", "no TOML file"),
        ("a = " + "[" * 5000, "no TOML file"),
        ("dt = true", "dt = True .* finite number"),
        ("dt = 1" + "0" * 400, "dt = .* within 1e"),
        ("dt = 1e-320", "more than 0 s"),
        ("max_steps = 99999999999999", "max_steps = 99999999999999 .* at most 2147483647"),
        ("[arena]\ndiscs = 'none'", "arena.discs = none is not possible: it must be a list."),
        ("[arena.discs]\nx = 1", "arena.discs = .'x': 1. is not possible: it must be a list."),
        ("[arena]\ndiscs = [[5, 5, 1]]", r"arena.discs = \[\[5, 5, 1\]\] is not .* a list of tables."),
        ("[arena]\ny_mox = 3", "'y_mox' is no known key: remove it, or did you mean 'y_max'"),
        ("arena = 7", "arena = 7 is not possible: it must be a table."),
        ("max_steps = 1.5", "max_steps = 1.5 is not possible: it must be a whole number."),
        ("dt = 'soon'", "dt = soon is not possible: it must be a number."),
        ("[starts]\nspeed = 'mvoing'", "starts.speed = mvoing is not possible: it must be one of rest, moving."),
        ("[[arena.discs]]\nx = 1", "discs.y"),
        ('"two\\nlines" = 1', "'two lines' is no known key"),
        ("[[arena.polygons]]\nvertices = [[1, 2], [3, 4, 5], [6, 7]]", "polygons"),
        ("[[arena.polygons]]\nvertices = 3", "wrong kind|polygons"),
        ("[[arena.polygons]]\nvertices = [[1, 2], [3, '4'], [6, 7]]", "polygons"),
        ("[arena]\nterritory = 3", "wrong kind|territory"),
        ("[arena.territory]\nx = 5\ny = 5\nradius = 0", "territory.radius = 0.0 .* more than 0 m"),
    ],
    ids=range(22),
)
def test_each_error_is_one_clear_line(content, said, written):
    with pytest.raises(InvalidInput, match=said) as refusal:
        written(content)
    assert len(str(refusal.value).splitlines()) == 1


def test_polygons_are_lists_of_corners(written):
    game = written("[[arena.polygons]]\nvertices = [[4, 4], [6, 4], [5, 6.5]]")
    assert game.arena.polygons == (Polygon(((4.0, 4.0), (6.0, 4.0), (5.0, 6.5))),)
    assert written(tomli_w.dumps(to_dict(game))) == game
