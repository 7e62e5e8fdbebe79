"""The folder that is served holds all the page needs, and the server is for this machine and this folder alone."""

import errno
import http.client
import json
import os
import queue
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager, nullcontext

import jax
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, load_header, save_agent
from apollonius.agents.trained import ZOO, zoo_names
from apollonius.arenas.file import find_game, game_names, to_dict
from apollonius.cli.main import main
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.registry import OBSERVATIONS
from apollonius.show import palette
from apollonius.web.server import LOOPBACK, FolderHandler, make_server
from apollonius.web.site import LEARNERS, PAGE, READS, YOU, choose_match, write_site
from tests.arenas.test_file import write as write_map
from tests.documents import REPOSITORY


@contextmanager
def serving(folder, port=None):
    with make_server(folder, port) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("host") / "site"
    (folder / "agents").mkdir(parents=True)
    (folder.parent / "secret.txt").write_text("not for the page")
    (folder / "index.html").write_text("<p>page</p>")
    (folder / "rules.js").write_text("export {}")
    with serving(folder) as server:
        yield server


def get(server, path, method="GET", **headers):
    connection = http.client.HTTPConnection(LOOPBACK, server.server_port, timeout=10)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def publish_site(folder, choice=None):
    """Write the page into a folder, and return its catalogue."""
    write_site(folder, choice)
    return json.loads((folder / "catalogue.json").read_text())


def test_server_serves_nothing_above_its_folder_and_no_listing(server, capsys):
    outside = ["../secret.txt", "%2e%2e/secret.txt", "agents/../../secret.txt", "/../secret.txt", "..%2fsecret.txt"]
    for path in [*outside, "agents/", "%00", "a%00b.js", "a" * 5000]:
        answer, body = get(server, f"/{path}")
        assert answer.status == 404, path
        assert b"not for the page" not in body
    assert not capsys.readouterr().err


def test_incomplete_request_times_out_silently(server, monkeypatch, capsys):
    monkeypatch.setattr(FolderHandler, "timeout", 0.3)
    with socket.create_connection((LOOPBACK, server.server_port), timeout=30) as half:
        half.sendall(b"GET / HTTP/1.0\r\nHost:")
        assert half.recv(1) == b""
    assert not capsys.readouterr().err


def test_server_answers_only_for_its_own_host_name(server):
    port = server.server_port
    assert server.server_address[0] == "127.0.0.1"
    for host in ("evil.example", f"evil.example:{port}", LOOPBACK, f"127.0.0.1.evil.example:{port}", ""):
        for method in ("GET", "HEAD"):
            answer, body = get(server, "/", method, Host=host)
            assert answer.status == 421
            assert b"<p>page</p>" not in body
    for own in ({}, {"Host": f"localhost:{port}"}):
        answer, body = get(server, "/", **own)
        assert (answer.status, body) == (200, b"<p>page</p>")
        assert answer.headers["Content-Security-Policy"].startswith("default-src 'self'")
    assert get(server, "/rules.js")[0].headers["Content-Type"] == "text/javascript"
    assert get(server, "/", method="POST")[0].status == 501


def test_taken_port_is_refused_and_a_free_one_is_found(server, tmp_path):
    with pytest.raises(InvalidInput, match=f"port = {server.server_port} cannot be used .*in use"):
        make_server(tmp_path, server.server_port)
    with make_server(tmp_path) as other:
        assert other.server_port != server.server_port
    for port in (0, -1, 65536):
        with pytest.raises(InvalidInput, match="port = "):
            make_server(tmp_path, port)


def test_play_command_ends_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "apollonius", "play", "--no-open", "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert f"http://{LOOPBACK}:{port}/" in process.stdout.readline()
        (folder,) = tmp_path.iterdir()
        assert folder.stat().st_mode & 0o777 == 0o700
        process.terminate()
        out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err.splitlines()[-1]) == (128 + signal.SIGTERM, "", "stopped")
    assert not list(tmp_path.iterdir())


def test_play_opens_a_browser_unless_disabled(monkeypatch):
    served, opened = threading.Event(), queue.Queue()
    monkeypatch.setattr("webbrowser.open", lambda address: opened.put(served.wait(10)))
    monkeypatch.setattr("socketserver.BaseServer.serve_forever", lambda server: served.set())
    assert main(["play", "--no-open"]) == 0
    served.clear()
    assert opened.empty()
    assert main(["play"]) == 0
    assert opened.get(timeout=10), "it is served while the browser is open"


def test_site_has_all_games_agents_and_files(tmp_path):
    catalogue = publish_site(tmp_path)
    assert catalogue["games"] == {name: to_dict(find_game(name)) for name in set(game_names()) - {"lidar", "blind"}}
    read = [name for name in zoo_names() if load_header(ZOO / f"{name}.safetensors").observation in READS]
    learners = {path.stem: path for path in LEARNERS.glob("*.safetensors")}
    assert len(learners) == 5
    in_order = [f"learner-{share}" for share in (0, 2, 12, 20, 100)]
    assert [name for name in catalogue["agents"]["pursuer"] if name in learners] == in_order
    assert [pupil["name"] for pupil in catalogue["learning"]["pupils"]] == [*in_order, "pursuer"]
    assert sorted(catalogue["agents"]["pursuer"] + catalogue["agents"]["evader"]) == sorted([*read, *learners])
    assert read == sorted(zoo_names())
    assert set(catalogue["anywhere"]) == {"pursuer", "evader"}
    for name, file in catalogue["files"].items():
        assert (tmp_path / file).read_bytes() == learners.get(name, ZOO / f"{name}.safetensors").read_bytes()
    page = (tmp_path / "index.html").read_text()
    for file in re.findall(r'(?:src|href)="([^"]+)"', page):
        assert (tmp_path / file).is_file()


def test_page_contacts_no_other_host():
    for path in [path for path in PAGE.rglob("*") if path.is_file()]:
        addresses = re.findall(r"https?://[^\s\"')]+", path.read_text())
        assert set(addresses) <= {"http://www.w3.org/2000/svg"}, path.name


def test_page_colours_match_the_palette():
    light, dark = (PAGE / "style.css").read_text().split("@media (prefers-color-scheme: dark)")
    for name in ("pursuer", "evader", "obstacle"):
        assert f"--{name}: {palette.LIGHT[name]};" in light
        assert f"--{name}: {palette.DARK[name]};" in dark


def test_default_opponent_is_the_best_agent():
    choice = choose_match(Role.EVADER, None, "paper", 3)
    assert (choice.pursuer, choice.evader, choice.seed, choice.agents) == ("shielded:pursuer", YOU, 3, {})
    assert choose_match(Role.EVADER, None, "team-3v1", 3).pursuer == "shielded:pursuer"
    assert choose_match(Role.PURSUER, None, "maze", 3).evader == "shielded:evader"
    assert choose_match(Role.PURSUER, "random", "robot", 0).evader == "random"
    assert choose_match(Role.EVADER, None, "paper", 0).level == 1
    asked = choose_match(Role.EVADER, "P_curriculum", "paper", 0)
    assert (asked.level, asked.difficulty) == (None, "sharp")


def test_choose_match_accepts_team_games_by_name_and_file(tmp_path):
    (tmp_path / "hall.toml").write_text("capture_distance = 0.4\n")
    assert (choose_match(Role.PURSUER, None, "team-3v1/office", 0).game) == "team-3v1/office"
    choice = choose_match(Role.EVADER, "pursuer", f"team-3v1/{tmp_path / 'hall.toml'}", 0)
    assert (choice.game, choice.games["hall"].size) == ("team-3v1/hall", "1 v 1")
    (tmp_path / "bodies.toml").write_text("pursuers = 2\nmates_collide = true\n")
    with pytest.raises(InvalidInput, match=r"mates_collide = true .* false in the page"):
        choose_match(Role.EVADER, None, str(tmp_path / "bodies.toml"), 0)
    (tmp_path / "pack.toml").write_text("pursuers = 4\n")
    catalogue = publish_site(tmp_path / "site", choose_match(Role.PURSUER, None, str(tmp_path / "pack.toml"), 0))
    assert catalogue["chosen"]["game"] == "pack"
    assert len(catalogue["games"]["pack"]["teams"]["pursuers"]) == 3


def test_game_on_a_map_is_served_with_its_field(tmp_path):
    write_map(tmp_path, np.full((20, 30), 254, np.uint8))
    (tmp_path / "hall.toml").write_text('[arena]\nmap = "floor.yaml"\n')
    choice = choose_match(Role.EVADER, None, str(tmp_path / "hall.toml"), 0)
    catalogue = publish_site(tmp_path / "site", choice)
    occupancy, served = choice.games["hall"].arena.map, catalogue["maps"].pop("hall")
    field = np.frombuffer((tmp_path / "site" / served.pop("field")).read_bytes(), "<f4")
    np.testing.assert_array_equal(field.reshape(served["rows"], served["columns"]), occupancy.field)
    assert served == {"x": -1, "y": 2, "cell": 0.5, "rows": 21, "columns": 31}
    assert catalogue["games"]["hall"]["arena"]["map"] == to_dict(occupancy)


@pytest.mark.parametrize("name", OBSERVATIONS)
def test_only_agents_with_an_observation_of_the_page_are_served(name, tmp_path):
    path = tmp_path / "small.safetensors"
    save_agent(describe(make_network(name, 8, 1, jax.random.key(0)), Role.PURSUER, {}, {}), path)
    made = "paper, encoded, egocentric, team; choose another"
    refused = pytest.raises(InvalidInput, match=f"observation = {name} .* {made}")
    with nullcontext() if name in READS else refused:
        choice = choose_match(Role.EVADER, str(path), "paper", 0)
        assert list(choice.agents.values()) == [path]


def test_agent_of_a_run_is_served(tmp_path):
    path = tmp_path / "first" / "agents" / "P_pool.safetensors"
    path.parent.mkdir(parents=True)
    shutil.copyfile(ZOO / "P_random.safetensors", path)
    choice = choose_match(Role.EVADER, f"shielded:{path}", "paper", 0)
    assert choice.pursuer == "shielded:P_pool of first"
    catalogue = publish_site(tmp_path / "site", choice)
    assert "P_pool of first" in catalogue["agents"]["pursuer"]
    assert (tmp_path / "site" / catalogue["files"]["P_pool of first"]).read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((Role.EVADER, "E_scratch", "paper", 0), "plays the evader"),
        ((Role.EVADER, "nobody", "paper", 0), "unknown agent 'nobody'"),
        ((Role.EVADER, None, "chess", 0), "unknown game 'chess'"),
        ((Role.EVADER, None, "paper", -1), "seed = -1"),
        ((Role.EVADER, None, "team-7v1", 0), "pursuers = 7 .* at most 6 in the page"),
        ((Role.EVADER, None, "suite-v1/maze-00,maze-01", 0), "in one arena, which the page needs"),
        ((Role.EVADER, "shielded:none.wasm", "paper", 0), "none.wasm .*write_player"),
    ],
)
def test_unknown_players_games_and_seeds_are_refused(arguments, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        choose_match(*arguments)


def test_game_with_more_movers_than_the_page_has_room_for_is_refused(tmp_path):
    for count, expected in (
        (12, nullcontext()),
        (13, pytest.raises(InvalidInput, match=r"movers\.walkers = 13 .*at most 12")),
    ):
        (tmp_path / "crowd.toml").write_text(f"[[movers.walkers]]\ncount = {count - 1}\n[[movers.walkers]]\n")
        with expected:
            choose_match(Role.EVADER, None, str(tmp_path / "crowd.toml"), 0)


def test_full_disk_leaves_no_partial_site(tmp_path, monkeypatch, capsys):
    def fail(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (tmp_path / "site").mkdir()
    monkeypatch.setattr("apollonius.web.site.load_header", fail)  # when the page itself is written
    assert main(["play", "--site", str(tmp_path / "site")]) == 2
    assert "No space left" in capsys.readouterr().err
    assert list(tmp_path.rglob("*")) == [tmp_path / "site"]


def test_play_command_does_not_overwrite_a_site(tmp_path, capsys):
    site = tmp_path / "site"
    assert main(["play", "--as", "pursuer", "--against", "still", "--seed", "5", "--site", str(site)]) == 0
    chosen = json.loads((site / "catalogue.json").read_text())["chosen"]
    assert (chosen["pursuer"], chosen["evader"], chosen["seed"], chosen["level"]) == (YOU, "still", 5, None)
    assert main(["play", "--site", str(site)]) == 2
    assert "--site" in capsys.readouterr().err


def test_compiled_page_is_up_to_date():
    """In a process of its own, where types are not checked while programs run: that takes a hundred times as long."""
    command = [sys.executable, "-m", "website.compiled", "--check"]
    checked = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr
