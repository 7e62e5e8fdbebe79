"""The server is for this machine and this folder alone."""

import http.client
import signal
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager

import pytest

from apollonius.cli.main import main
from apollonius.io.errors import InvalidInput
from apollonius.web.server import LOOPBACK, FolderHandler, make_server


@contextmanager
def serving(folder, port=None):
    with make_server(folder, port) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture
def server(tmp_path):
    (tmp_path / "secret.txt").write_text("not for the page")
    folder = tmp_path / "site"
    (folder / "agents").mkdir(parents=True)
    (folder / "index.html").write_text("<p>page</p>")
    (folder / "rules.js").write_text("export {}")
    with serving(folder) as server:
        yield server


def get(server, path, method="GET", **headers):
    connection = http.client.HTTPConnection(LOOPBACK, server.server_port, timeout=10)
    connection.putrequest(method, path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def test_serves_its_files(server):
    answer, body = get(server, "/")
    assert (answer.status, body) == (200, b"<p>page</p>")
    assert answer.headers["Content-Security-Policy"].startswith("default-src 'self'")
    answer, _ = get(server, "/rules.js")
    assert answer.headers["Content-Type"] == "text/javascript"


def test_serves_nothing_above_its_folder_and_no_listing(server, capsys):
    outside = [
        "/../secret.txt",
        "/%2e%2e/secret.txt",
        "/agents/../../secret.txt",
        "//../secret.txt",
        "/..%2fsecret.txt",
    ]
    for path in [*outside, "/agents/", "/%00", "/a%00b.js", "/" + "a" * 5000]:
        answer, body = get(server, path)
        assert answer.status == 404, path
        assert b"not for the page" not in body
    assert not capsys.readouterr().err


def test_half_a_request_ends_in_silence(server, monkeypatch, capsys):
    monkeypatch.setattr(FolderHandler, "timeout", 0.3)
    with socket.create_connection((LOOPBACK, server.server_port), timeout=30) as half:
        half.sendall(b"GET / HTTP/1.0\r\nHost:")
        assert half.recv(1) == b""
    assert not capsys.readouterr().err


def test_answers_to_its_own_name_on_the_loopback_address_alone(server):
    port = server.server_port
    assert server.server_address[0] == "127.0.0.1"
    for host in ("evil.example", f"evil.example:{port}", LOOPBACK, f"127.0.0.1.evil.example:{port}", ""):
        for method in ("GET", "HEAD"):
            answer, body = get(server, "/", method, Host=host)
            assert answer.status == 421
            assert b"<p>page</p>" not in body
    assert get(server, "/", Host=f"localhost:{port}")[0].status == 200
    assert get(server, "/", method="POST")[0].status == 501


def test_a_taken_port_is_refused_and_a_free_one_is_found(server, tmp_path):
    with pytest.raises(InvalidInput, match=f"port = {server.server_port} cannot be used .*in use"):
        make_server(tmp_path, server.server_port)
    with make_server(tmp_path) as other:
        assert other.server_port != server.server_port
    for port in (0, -1, 65536):
        with pytest.raises(InvalidInput, match="port = "):
            make_server(tmp_path, port)


def test_the_command_ends_and_leaves_nothing(tmp_path, monkeypatch):
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


def test_a_browser_is_opened_unless_told_otherwise(monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("socketserver.BaseServer.serve_forever", lambda server: None)
    for words in (["--no-open"], []):
        assert opened == []
        assert main(["play", *words]) == 0
    assert len(opened) == 1
