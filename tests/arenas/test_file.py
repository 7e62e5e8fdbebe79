"""Games and ROS maps as files: what is written is played, maps are as map_server shows them, errors are one line."""

import json

import numpy as np
import pytest
import tomli_w
from PIL import Image

from apollonius.arenas.file import find_game, from_dict, load_game, save_game, to_dict
from apollonius.arenas.map_file import load_map
from apollonius.cli.main import main
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import PRESETS
from apollonius.game.starts import Starts
from apollonius.io import limits
from apollonius.io.errors import InvalidInput
from apollonius.io.limits import GAME_FILES


@pytest.fixture
def load_text(tmp_path):
    """A function that writes a file and loads the game in it."""

    def load(content):
        path = tmp_path / "game.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return load_game(path)

    return load


def test_game_file_overrides_the_defaults(load_text):
    """The ring of a polygon may be closed."""
    game = load_text("""
capture_distance = 0.6
max_steps = 300
pursuer = {v_max = 0.8, radius = 0.25}
evader = {v_max = 1, u2_max = 1.5, radius = 0.2}
starts = {clearance = 0.4, separation = 2}
[arena]
x_max = 12
y_max = 6.5
discs = [{x = 6, y = 3, radius = 0.5}]
[[arena.polygons]]
vertices = [[4, 4], [6, 4], [5, 6.5], [4, 4]]
""")
    disc, polygon = Disc(6.0, 3.0, 0.5), Polygon(((4.0, 4.0), (6.0, 4.0), (5.0, 6.5)))
    pursuer, evader = Unicycle(v_max=0.8, radius=0.25), Unicycle(v_max=1.0, u2_max=1.5, radius=0.2)
    arena = Arena(x_max=12.0, y_max=6.5, discs=(disc,), polygons=(polygon,))
    assert game == Game(pursuer, evader, arena, 0.6, max_steps=300, starts=Starts(clearance=0.4, separation=2.0))
    assert load_text(tomli_w.dumps(to_dict(game))) == game
    assert load_text("") == Game()


@pytest.mark.parametrize("name", [*PRESETS, "team-3v1"])
@pytest.mark.parametrize("suffix", GAME_FILES)
def test_every_preset_loads_unchanged_from_its_file(name, suffix, tmp_path):
    game = find_game(name)
    save_game(to_dict(game), tmp_path / f"game{suffix}")
    assert find_game(str(tmp_path / f"game{suffix}")) == game


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("dt = ", "no TOML file"),
        (b"\xff\xfe", "no TOML file"),
        ("a = " + "[" * 5000, "no TOML file"),
        ("dt = true", "dt = true is not possible: it must be a number"),
        ("dt = 1" + "0" * 400, "dt = .* within 1e"),
        ("dt = 1e-320", "more than 0 s"),
        ("max_steps = 99999999999999", "max_steps = 99999999999999 .* at most 2147483647"),
        ("[arena]\ndiscs = 'none'", 'arena.discs = "none" is not possible: it must be a list.'),
        ("[arena.discs]\nx = 1", "arena.discs = .'x': 1. is not possible: it must be a list."),
        ("[arena]\ndiscs = [[5, 5, 1]]", r"arena.discs = \[\[5, 5, 1\]\] is not .* a list of tables."),
        ("[arena]\ny_mox = 3", "unknown key 'y_mox'; did you mean 'y_max'"),
        ("arena = 7", "arena = 7 is not possible: it must be a table."),
        ("max_steps = 1.5", "max_steps = 1.5 is not possible: it must be a whole number."),
        ("dt = 'soon'", 'dt = "soon" is not possible: it must be a number.'),
        ("[starts]\nspeed = 'mvoing'", 'starts.speed = "mvoing" is not possible: it must be one of rest, moving.'),
        ("[[arena.discs]]\nx = 1", "discs.y is missing: add it"),
        ('pursuer = {v_max = "1.2"}', 'pursuer.v_max = "1.2" is not possible: it must be a number'),
        ("pursuer = {v_max = true}", "pursuer.v_max = true .* number"),
        ("max_steps = true", "max_steps = true is not possible: it must be a whole number"),
        ('[[movers.shuttles]]\nwaypoints = ["ab", "cd"]', 'movers.shuttles.waypoints = "ab" .* a list'),
        ("[[movers.shuttles]]\nwaypoints = [[1, 1, 2], [1, 4, 3]]", "waypoints = .* a list of lists of 2 numbers"),
        ('"two\\nlines" = 1', "unknown key 'two lines'"),
        ("[[arena.polygons]]\nvertices = [[1, 2], [3, 4, 5], [6, 7]]", "polygons"),
        ("[[arena.polygons]]\nvertices = 3", "wrong kind|polygons"),
        ("[[arena.polygons]]\nvertices = [[1, 2], [3, '4'], [6, 7]]", "polygons"),
        ("[arena]\nterritory = 3", "wrong kind|territory"),
        ("[arena.territory]\nx = 5\ny = 5\nradius = 0", "territory.radius = 0.0 .* more than 0 m"),
        ("[arena]\nmap = 3", "map = 3 .* YAML file"),
        ('[arena]\nmap = {file = "floor.yaml"}', "YAML file"),
        ('[arena]\nmap = "other.yaml"', "other.yaml' .* check the path"),
        ('[arena]\nmap = "floor.yaml"\nx_max = 20', r"walls = .* within the map's ends \[-1.0, 14.0\]"),
    ],
    ids=range(31),
)
def test_each_game_file_error_is_one_line(content, said, load_text, tmp_path):
    write(tmp_path, room())
    with pytest.raises(InvalidInput, match=said) as refusal:
        load_text(content)
    assert len(str(refusal.value).splitlines()) == 1


FLOOR = {
    "image": "floor.pgm", "resolution": "0.5", "origin": "[-1.0, 2, 0.0]", "negate": "0", "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}  # fmt: skip


def write(folder, pixels, name="floor", **changes):
    """A map's two files, of pixels or the bytes of a picture; a change of None leaves a key out."""
    said = {key: value for key, value in (FLOOR | changes).items() if value is not None}
    (folder / f"{name}.yaml").write_text("".join(f"{key}: {value}\n" for key, value in said.items()))
    if isinstance(pixels, bytes):
        (folder / "floor.pgm").write_bytes(pixels)
    elif pixels is not None:
        Image.fromarray(np.asarray(pixels, np.uint8)).save(folder / "floor.pgm")
    return folder / f"{name}.yaml"


def room():
    """Free, with a block at the lower left of the picture and an unknown one at the upper right."""
    pixels = np.full((20, 30), 254)
    pixels[16:, :6] = 0
    pixels[:4, 24:] = 205
    return pixels


def test_map_rows_run_upwards_and_unknown_cells_are_occupied(tmp_path):
    found = load_map(write(tmp_path, room()))
    assert (found.x, found.y, found.x_max, found.y_max, found.cell) == (-1, 2, 14, 12, 0.5)
    np.testing.assert_array_equal(found.occupied(), room()[::-1] != 254)


@pytest.mark.parametrize(
    ("changes", "free"),
    [
        ({}, [0, 0, 0, 1]),
        ({"free_thresh": "0.3"}, [0, 0, 1, 1]),
        ({"negate": "1"}, [1, 0, 0, 0]),
        ({"free_thresh": "0.999", "occupied_thresh": "1"}, [0, 1, 1, 1]),
        ({"mode": "trinary", "cost": "3"}, [0, 0, 0, 1]),
        *[({"negate": word}, [0, 0, 0, 1]) for word in ("false", "No", "OFF")],
        *[({"negate": word}, [1, 0, 0, 0]) for word in ("true", "Yes", "ON", "'y'")],
    ],
)
def test_map_thresholds_match_map_server(tmp_path, changes, free):
    shades = np.repeat([0, 128, 205, 254], 5)[None].repeat(5, axis=0)
    found = load_map(write(tmp_path, shades, **changes))
    np.testing.assert_array_equal(~found.occupied()[2, 2::5], np.array(free, bool))


def test_plain_pgm_raw_pgm_and_png_load_the_same_map(tmp_path):
    raw = load_map(write(tmp_path, room()))
    plain = "P2\n# made by hand\n30 20\n255\n" + "\n".join(" ".join(map(str, row)) for row in room())
    (tmp_path / "plain.pgm").write_text(plain)
    Image.fromarray(room().astype(np.uint8)).save(tmp_path / "map.png")
    for name in ("plain.pgm", "map.png"):
        other = load_map(write(tmp_path, None, "other", image=name))
        np.testing.assert_array_equal(other.field, raw.field)
        assert other.digest != raw.digest


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA", "tRNS"])
def test_colours_and_opacity_are_averaged_as_in_nav2(tmp_path, mode):
    """What it calls free, cell by cell, of all greys, some of them transparent, and a few colours."""
    cells = np.stack([np.tile(np.arange(0, 256, 5), (4, 1))] * 3 + [np.full((4, 52), 255)], axis=-1).astype(np.uint8)
    cells[1, :, 3], cells[2, :, 3], cells[3, :, 0] = 0, 128, 255
    cells = cells.repeat(3, axis=0).repeat(3, axis=1)
    picture = Image.fromarray(cells)
    picture = picture.convert("RGB") if mode in ("P", "tRNS") else picture
    saved = picture.convert("RGB" if mode == "tRNS" else mode, dither=Image.Dither.NONE)
    saved.save(tmp_path / "map.png", **({"transparency": (250, 250, 250)} if mode == "tRNS" else {}))
    shown = np.asarray(saved.convert("RGB"), float)
    if mode in ("LA", "RGBA"):
        shown = np.concatenate([shown, cells[..., 3:]], axis=-1)
    if mode == "tRNS":
        opaque = 255.0 * (shown != 250).any(axis=-1, keepdims=True)
        shown = np.concatenate([shown, opaque], axis=-1)
    found = load_map(write(tmp_path, None, image="map.png", free_thresh="0.22"))
    free = 1 - shown.mean(axis=-1) / 255 < 0.22
    assert 0 < free.sum() < free.size
    np.testing.assert_array_equal(~found.occupied()[::-1][1::3, 1::3], free[1::3, 1::3])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"image": None}, "image = missing"),
        ({"image": "[3]"}, r"image = \['3'\] .* name of a file"),
        ({"image": "none.pgm"}, "none.pgm' .* check the path"),
        ({"image": "floor.yaml"}, "no whole PGM or PNG .* convert it to one of these"),
        ({"resolution": "0"}, "resolution = 0 .* more than 0"),
        ({"resolution": "fine"}, "resolution = fine"),
        ({"origin": "[0, 0]"}, r"origin = \[0, 0\] .* \[x, y, yaw\]"),
        ({"origin": "[0, 0, 0.1]"}, "yaw = 0.1 .* turn the image"),
        ({"origin": "[0, up, 0]"}, "origin = up"),
        ({"negate": "2"}, "negate = 2 .* 0 or false .*, 1 or true"),
        ({"negate": "perhaps"}, "negate = perhaps"),
        ({"occupied_thresh": "1.5"}, "free_thresh"),
        ({"free_thresh": "0.7"}, "free_thresh = 0.7 .* up to occupied_thresh = 0.65"),
        ({"mode": "scale"}, "mode = scale .* trinary"),
        ({"least_obstacle": "-1"}, "least_obstacle = -1.0 .* 0 or more"),
        ({"image": "[", "mode": "]"}, "no YAML"),
        ({"free_thresh": "0.0001"}, "free cells"),
        ({"resolution": '!!int ""'}, "tags .* are not read"),
        ({"resolution": "1" + "0" * 4000}, "resolution = 1000"),
        ({"negate": "&a [*a]"}, "no YAML"),
        ({"pixels": b"P5 10001 5 255\n"}, r"\(10001, 5\) .* at most 10,000 cells .* crop it"),
        ({"pixels": b"P5 20000 20000 255\n"}, r"\(20000, 20000\) .* at most 10,000 cells .* crop it"),
        ({"pixels": b"\x89PNG\r\n\x1a\n"}, "no whole PGM or PNG"),
        ({"pixels": b"P5 20 20 255\n" + bytes(100)}, "no whole PGM or PNG"),
        ({"pixels": b"Pf 20 20 1.0\n" + bytes(1600)}, "kind F .* convert it to PGM"),
        ({"pixels": b"P5 10000 10000 255\n"}, "needs 10.2 GiB of memory and this machine has 4.0 GiB: crop it"),
    ],
    ids=range(26),
)
def test_each_map_error_is_one_line(tmp_path, monkeypatch, changes, said):
    monkeypatch.setattr(limits, "available_memory", lambda: 2**32)
    path = write(tmp_path, **{"pixels": room()} | changes)
    with pytest.raises(InvalidInput, match=said) as refusal:
        load_map(path)
    assert len(str(refusal.value).splitlines()) == 1


@pytest.fixture
def hall(tmp_path):
    write(tmp_path, room())
    (tmp_path / "hall.toml").write_text('[arena]\nmap = "floor.yaml"\n[starts]\nclearance = 0.2\n')
    return tmp_path / "hall.toml"


def test_game_on_a_map_has_its_walls_and_records_its_digest(hall):
    game = find_game(str(hall))
    assert (game.arena.x_min, game.arena.x_max, game.arena.y_min, game.arena.y_max) == (-1, 14, 2, 12)
    record = json.loads(json.dumps(to_dict(game)))
    assert record["arena"]["map"] == {"file": str(hall.with_name("floor.yaml")), "sha256": game.arena.map.digest}
    again = from_dict(Game, record, "the record")
    np.testing.assert_array_equal(again.arena.map.field, game.arena.map.field)
    for spoil, said in (
        (lambda: write(hall.parent, 255 - room(), free_thresh="0.3"), "which has changed since; restore it"),
        (lambda: hall.with_name("floor.yaml").unlink(), "check the path"),
    ):
        spoil()
        with pytest.raises(InvalidInput, match=said):
            from_dict(Game, record, "the record")


def test_specks_are_reported_and_removed_below_least_obstacle(hall, capsys):
    """Four cells that touch at corners, 1 m^2, are one obstacle; what touches a wall is a part of it."""
    pixels = room()
    pixels[[8, 9, 10, 11], [10, 11, 12, 13]] = pixels[15, 3] = 0
    write(hall.parent, pixels)
    assert main(["arena", "check", str(hall)]) == 0
    said = capsys.readouterr().out
    assert "specks on the map, of at most 4 cells: 1, at (5.75, 6.25); " in said
    area = float(said.partition("least_obstacle to ")[2].split()[0])
    for least, there in ((1, 4), (area, 0)):
        found = load_map(write(hall.parent, pixels, least_obstacle=least))
        assert found.occupied()[:, 8:20].sum() == there
        assert found.occupied()[4, 3]
    assert main(["arena", "check", str(hall)]) == 0
    assert "least_obstacle" not in capsys.readouterr().out


def test_arena_check_writes_json_with_a_relative_map_path(hall, tmp_path, capsys):
    out = tmp_path / "json" / "hall.json"
    assert main(["arena", "check", str(hall), "--out", str(out)]) == 0
    assert f"next: apollonius play --game {out}" in capsys.readouterr().err
    game, again = find_game(str(hall)), find_game(str(out))
    assert (again.starts, again.arena.map.digest) == (game.starts, game.arena.map.digest)
    assert json.loads(out.read_text())["arena"]["map"]["file"] == "../floor.yaml"
    said = out.read_bytes()
    assert main(["arena", "check", "paper", "--out", str(out)]) == 2
    assert "a new file" in capsys.readouterr().err
    assert out.read_bytes() == said


def test_commands_refuse_or_warn_of_a_map_in_one_line(hall, capsys):
    def said(*words):
        return main([*words, str(hall)]), capsys.readouterr()

    pixels = np.full((20, 30), 254)
    pixels[9:11], pixels[:4] = 0, 205
    write(hall.parent, pixels, free_thresh="0.25")
    status, printed = said("evaluate", "random", "still", "--games", "2", "--game")
    assert status == 0
    assert printed.err.count("hall.toml: the pursuer's free space falls into 2 parts of ") == 1
    assert "unknown cells of the map, grey 205, are read as free, on 20.0% of it: set free_thresh" in printed.err
    status, printed = said("arena", "check")
    assert (status, "free space falls into 2 parts" in printed.out) == (1, True)
    write(hall.parent, 0 * pixels)
    status, printed = said("evaluate", "random", "still", "--game")
    assert (status, printed.err.count("\n"), "a map with free cells; mind negate" in printed.err) == (2, 1, True)
