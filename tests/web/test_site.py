"""The folder that is served holds all the page needs, as the package says now, and the choice it begins with."""

import errno
import json
import os
import re
import shutil
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import jax
import numpy as np
import pytest
from PIL import Image

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, load_header, save_agent
from apollonius.agents.trained import ZOO, zoo_names
from apollonius.arenas.file import find_game, game_names
from apollonius.arenas.record import to_dict
from apollonius.cli.main import main
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.registry import OBSERVATIONS
from apollonius.show import palette
from apollonius.web.site import LEARNERS, PAGE, READS, YOU, choose, write_site


def test_the_site_is_whole(tmp_path):
    write_site(tmp_path)
    catalogue = json.loads((tmp_path / "catalogue.json").read_text())
    assert catalogue["games"] == {
        name: to_dict(find_game(name)) for name in game_names() if name not in ("lidar", "blind")
    }
    read = [name for name in zoo_names() if load_header(ZOO / f"{name}.safetensors").observation in READS]
    learners = {path.stem: path for path in LEARNERS.iterdir()}
    assert len(learners) == 5
    assert sorted(catalogue["agents"]["pursuer"] + catalogue["agents"]["evader"]) == sorted([*read, *learners])
    assert read == sorted(zoo_names())
    assert set(catalogue["anywhere"]) == {"pursuer", "E_any"}
    for name, file in catalogue["files"].items():
        assert (tmp_path / file).read_bytes() == learners.get(name, ZOO / f"{name}.safetensors").read_bytes()
    page = (tmp_path / "index.html").read_text()
    for file in re.findall(r'(?:src|href)="([^"]+)"', page):
        assert (tmp_path / file).is_file()


def test_the_page_asks_nobody_else():
    for path in [path for path in PAGE.rglob("*") if path.is_file()]:
        addresses = re.findall(r"https?://[^\s\"')]+", path.read_text())
        assert set(addresses) <= {"http://www.w3.org/2000/svg"}, path.name


def test_colours_are_those_of_all_pictures():
    light, dark = (PAGE / "style.css").read_text().split("@media (prefers-color-scheme: dark)")
    for name in ("pursuer", "evader", "obstacle"):
        assert f"--{name}: {palette.LIGHT[name]};" in light
        assert f"--{name}: {palette.DARK[name]};" in dark


def test_a_person_meets_the_best_unless_told_otherwise():
    choice = choose(Role.EVADER, None, "paper", 3)
    assert (choice.pursuer, choice.evader, choice.seed, choice.agents) == ("shielded:P_optimal", YOU, 3, {})
    assert choose(Role.EVADER, None, "team-3v1", 3).pursuer == "shielded:pursuer"
    assert choose(Role.PURSUER, None, "maze", 3).evader == "shielded:E_any"
    assert choose(Role.PURSUER, "random", "robot", 0).evader == "random"
    assert choose(Role.EVADER, None, "paper", 0).level == 1
    asked = choose(Role.EVADER, "P_pool", "paper", 0)
    assert (asked.level, asked.difficulty) == (None, "sharp")


def test_a_game_of_teams_is_a_game_of_two_by_another_name(tmp_path):
    (tmp_path / "hall.toml").write_text("capture_distance = 0.4\n")
    assert (choose(Role.PURSUER, None, "team-3v1/office", 0).game) == "team-3v1/office"
    choice = choose(Role.EVADER, "pursuer", f"team-3v1/{tmp_path / 'hall.toml'}", 0)
    assert (choice.game, choice.games["hall"].size) == ("team-3v1/hall", "1 v 1")
    (tmp_path / "bodies.toml").write_text("pursuers = 2\nmates_collide = true\n")
    with pytest.raises(InvalidInput, match=r"mates_collide = True .* false in the page"):
        choose(Role.EVADER, None, str(tmp_path / "bodies.toml"), 0)
    (tmp_path / "pack.toml").write_text("pursuers = 4\n")
    choice = choose(Role.PURSUER, None, str(tmp_path / "pack.toml"), 0)
    write_site(tmp_path / "site", choice)
    catalogue = json.loads((tmp_path / "site" / "catalogue.json").read_text())
    assert catalogue["chosen"]["game"] == "pack"
    assert len(catalogue["games"]["pack"]["teams"]["pursuers"]) == 3


def test_a_game_on_a_map_is_served_with_its_field(tmp_path):
    Image.fromarray(np.full((20, 30), 254, np.uint8)).save(tmp_path / "floor.pgm")
    floor = (
        "image: floor.pgm\nresolution: 0.5\norigin: [-1, 2, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    (tmp_path / "floor.yaml").write_text(floor)
    (tmp_path / "hall.toml").write_text('[arena]\nmap = "floor.yaml"\n')
    choice = choose(Role.EVADER, None, str(tmp_path / "hall.toml"), 0)
    write_site(tmp_path / "site", choice)
    catalogue = json.loads((tmp_path / "site" / "catalogue.json").read_text())
    occupancy, served = choice.games["hall"].arena.map, catalogue["maps"].pop("hall")
    field = np.frombuffer((tmp_path / "site" / served.pop("field")).read_bytes(), "<f4")
    np.testing.assert_array_equal(field.reshape(served["rows"], served["columns"]), occupancy.field)
    assert served == {"x": -1, "y": 2, "cell": 0.5, "rows": 21, "columns": 31}
    assert catalogue["games"]["hall"]["arena"]["map"] == to_dict(occupancy)


@pytest.mark.parametrize("name", OBSERVATIONS)
def test_agents_are_served_whose_observation_the_page_makes(name, tmp_path):
    path = tmp_path / "small.safetensors"
    save_agent(describe(make_network(name, 8, 1, jax.random.key(0)), Role.PURSUER, {}, {}), path)
    made = "paper, encoded, egocentric, team; choose another"
    refused = pytest.raises(InvalidInput, match=f"observation = {name} .* {made}")
    with nullcontext() if name in READS else refused:
        choice = choose(Role.EVADER, str(path), "paper", 0)
        assert list(choice.agents.values()) == [path]


def test_an_agent_from_a_run_is_served_too(tmp_path):
    path = tmp_path / "first" / "agents" / "P_pool.safetensors"
    path.parent.mkdir(parents=True)
    shutil.copyfile(ZOO / "P_random.safetensors", path)
    choice = choose(Role.EVADER, f"shielded:{path}", "paper", 0)
    assert choice.pursuer == "shielded:P_pool of first"
    write_site(tmp_path / "site", choice)
    catalogue = json.loads((tmp_path / "site" / "catalogue.json").read_text())
    assert "P_pool of first" in catalogue["agents"]["pursuer"]
    assert (tmp_path / "site" / catalogue["files"]["P_pool of first"]).read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((Role.EVADER, "E_scratch", "paper", 0), "plays the evader"),
        ((Role.EVADER, "nobody", "paper", 0), "no agent is called 'nobody'"),
        ((Role.EVADER, None, "chess", 0), "no game is called 'chess'"),
        ((Role.EVADER, None, "paper", -1), "seed = -1"),
        ((Role.EVADER, None, "team-7v1", 0), "pursuers = 7 .* at most 6 in the page"),
        ((Role.EVADER, None, "suite-v1/maze-00,maze-01", 0), "in one arena, which the page needs"),
        ((Role.EVADER, "shielded:none.wasm", "paper", 0), "none.wasm .*write_player"),
    ],
)
def test_what_there_is_not_is_refused(arguments, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        choose(*arguments)


def test_a_full_disk_leaves_no_half_site(tmp_path, monkeypatch, capsys):
    def fail(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (tmp_path / "site").mkdir()
    monkeypatch.setattr("apollonius.web.site.load_header", fail)  # when the page itself is written
    assert main(["play", "--site", str(tmp_path / "site")]) == 2
    assert "No space left" in capsys.readouterr().err
    assert list(tmp_path.rglob("*")) == [tmp_path / "site"]


def test_the_command_writes_a_site_once(tmp_path, capsys):
    site = tmp_path / "site"
    assert main(["play", "--as", "pursuer", "--against", "still", "--seed", "5", "--site", str(site)]) == 0
    chosen = json.loads((site / "catalogue.json").read_text())["chosen"]
    assert (chosen["pursuer"], chosen["evader"], chosen["seed"], chosen["level"]) == (YOU, "still", 5, None)
    assert main(["play", "--site", str(site)]) == 2
    assert "--site" in capsys.readouterr().err


def test_the_page_is_up_to_date():
    """In a process of its own, where types are not checked while programs run: that takes a hundred times as long."""
    command = [sys.executable, "-m", "website.compiled", "--check"]
    checked = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr
