"""Maps and games that cannot be played: one clear line each, before time and memory are spent, by the commands."""

import re
import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from apollonius.cli.main import main
from apollonius.io import limits

YAML = (
    "image: {image}\nresolution: {resolution}\norigin: {origin}\nnegate: 0\noccupied_thresh: 0.65\n"
    "free_thresh: {free_thresh}\n"
)


@pytest.fixture
def evaluated(tmp_path, monkeypatch, capsys):
    """A function that plays on a map of these pixels and numbers, and returns the status and what was said."""
    monkeypatch.chdir(tmp_path)

    def play(
        rules="",
        pixels=None,
        image="map.pgm",
        resolution="0.5",
        origin="[0, 0, 0]",
        arena='map = "map.yaml"',
        free_thresh="0.196",
    ):
        pixels = np.full((20, 20), 254) if pixels is None else pixels
        if isinstance(pixels, bytes):
            (tmp_path / image).write_bytes(pixels)
        else:
            Image.fromarray(np.asarray(pixels, np.uint8)).save(tmp_path / image)
        said = YAML.format(image=image, resolution=resolution, origin=origin, free_thresh=free_thresh)
        (tmp_path / "map.yaml").write_text(said)
        (tmp_path / "game.toml").write_text(f"[arena]\n{arena}\n{rules}\n")
        status = main(["evaluate", "random", "still", "--game", "game.toml", "--games", "2"])
        said = capsys.readouterr()
        return status, said.err + said.out

    return play


def png(width, height):
    """The first bytes of a grey picture of this size: its cells are not there."""
    size = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + size + struct.pack(">II", zlib.crc32(size), 9) + b"IDAT"


def test_a_map_that_is_none_the_worse_is_played_on(evaluated):
    assert evaluated()[0] == 0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"pixels": np.zeros((20, 20))}, "map = all occupied .* a map with free cells; mind negate"),
        ({"rules": "[pursuer]\nradius = 6"}, "no place to start: none of 100,000 has a clearance of 6.3 m .*smaller"),
        ({"rules": "[evader]\nradius = 5e5"}, "no place to start"),
        ({"rules": "[evader]\nradius = nan"}, "evader.radius = nan .* a finite number"),
        ({"rules": "[starts]\nclearance = inf"}, "starts.clearance = inf .* a finite number"),
        ({"arena": 'map = "map.yaml"\nx_max = nan'}, "arena.x_max = nan .* a finite number"),
        ({"arena": "[[arena.discs]]\nx = nan\ny = 1\nradius = 1"}, "arena.discs.0.x = nan .* a finite number"),
        ({"arena": "[[arena.polygons]]\nvertices = [[1, 1], [2, nan], [3, 1]]"}, "nan .* a finite number"),
        ({"resolution": ".nan"}, "resolution = .nan .* a number"),
        ({"resolution": ".inf"}, "resolution = .inf .* a number"),
        ({"origin": "[.nan, 0, 0]"}, "origin = .nan .* a number"),
        ({"origin": "[0, 0, .nan]"}, "origin = .nan .* a number"),
        ({"image": "map.png", "pixels": png(20_000, 20_000)}, r"\(20000, 20000\) .* at most 10,000 cells .* crop it"),
        ({"image": "map.png", "pixels": png(10_001, 5)}, r"\(10001, 5\) .* at most 10,000 cells .* crop it"),
        ({"pixels": b"P5 20000 20000 255\n"}, r"\(20000, 20000\) .* at most 10,000 cells"),
        ({"image": "map.png", "pixels": png(20, 20)}, "no whole PGM or PNG"),
    ],
    ids=range(16),
)
def test_what_cannot_be_played_on_is_refused_in_a_line(evaluated, changes, said):
    status, told = evaluated(**changes)
    assert status == 2
    assert told.count("\n") == 1
    assert re.search(said, told), told


def test_a_map_for_which_memory_has_no_room_is_refused_before_it_is_read(evaluated, monkeypatch):
    monkeypatch.setattr(limits, "available_memory", lambda: 2**32)
    status, told = evaluated(image="map.png", pixels=png(10_000, 10_000))
    assert status == 2
    assert "(10000, 10000) needs 10.2 GiB of memory and this machine has 4.0 GiB: crop it." in told


def test_closed_pockets_are_found_and_a_robot_that_starts_in_one_can_be_played(evaluated, capsys):
    pixels = np.full((40, 40), 254)
    pixels[18:22] = 0
    status, told = evaluated(pixels=pixels)
    assert status == 0
    assert told.count("game.toml: the pursuer's free space falls into 2 parts of 178, 178 m^2") == 1
    assert main(["arena", "check", "game.toml"]) == 1
    assert "free space falls into 2 parts of 178, 178 m^2" in capsys.readouterr().out


@pytest.mark.parametrize(("free_thresh", "said"), [("0.196", 0), ("0.25", 1)])
def test_unknown_cells_that_are_read_as_free_are_told_of(evaluated, free_thresh, said):
    pixels = np.full((20, 20), 254)
    pixels[:4] = 205
    status, told = evaluated(pixels=pixels, free_thresh=free_thresh)
    assert status == 0
    assert told.count("unknown cells of the map, grey 205, are read as free, on 20.0% of it: set free_thresh") == said
