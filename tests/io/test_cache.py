"""One cache of files: found by all that was asked for, whole whoever is killed, and never at the price of its bound."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest

from apollonius.game.presets import make_game
from apollonius.io import cache
from apollonius.io.cache import Memory, cache_folder, cached, content, entry_path, keep_compilations, make_room
from apollonius.io.document import write_atomically
from apollonius.io.errors import InvalidInput

GAME = make_game("paper")
KEY = {"game": {"dt": 0.1}, "seed": 1}


def load(path):
    if path.read_bytes() != b"sound":
        raise InvalidInput("damaged")
    return path.read_bytes()


def write(value, path):
    write_atomically(path, value)


def read_cached(path):
    """What `cached` returns, and whether it was made."""
    made = []
    found = cached(path, lambda: made.append(1) or b"sound", write, load)
    return found, bool(made)


def test_cached_value_is_computed_once_and_again_after_damage(tmp_path):
    path = entry_path(tmp_path / "new", "a/b:c.json", KEY)
    assert path.name.startswith("a-b-c-")
    assert path.suffix == ".json"
    assert [read_cached(path), read_cached(path)] == [(b"sound", True), (b"sound", False)]
    for damage in (b"", b"soun", b"other"):
        path.write_bytes(damage)
        assert [read_cached(path), read_cached(path)] == [(b"sound", True), (b"sound", False)]
    assert [read_cached(None), read_cached(None)] == [(b"sound", True)] * 2, "without a folder nothing is kept"


def test_cache_key_depends_on_all_parameters_and_the_version(tmp_path, monkeypatch):
    keys = [KEY, KEY | {"seed": 2}, {"game": {"dt": 0.2}, "seed": 1}, {"game": {"dt": 0.1}, "seed": None}]
    names = {entry_path(tmp_path, "a.json", key) for key in keys}
    assert entry_path(tmp_path, "a.json", dict(reversed(KEY.items()))) in names
    monkeypatch.setattr(cache, "__version__", "99")
    assert len(names | {entry_path(tmp_path, "a.json", KEY)}) == 5


def test_content_digest_covers_the_whole_pytree():
    others = [
        replace(GAME, dt=0.2), replace(GAME, starts=replace(GAME.starts, speed="moving")), replace(GAME, max_steps=7),
        replace(GAME, arena=replace(GAME.arena, discs=GAME.arena.discs[:2])), GAME.pursuer,
        jnp.zeros(4), jnp.zeros((2, 2)), jnp.zeros(4, jnp.int32), jnp.zeros(8, jnp.float16),
    ]  # fmt: skip
    assert content(make_game("paper")) == content(GAME)
    assert len({content(one) for one in [GAME, *others]}) == 10


KILLED = """
import os, signal, sys
from pathlib import Path
from apollonius.io.cache import cached
from apollonius.io.document import write_atomically

os.replace = lambda *paths: os.kill(os.getpid(), signal.SIGKILL)
cached(Path(sys.argv[1]), lambda: b"new", lambda value, path: write_atomically(path, value), lambda path: None)
"""


def test_process_killed_while_writing_leaves_no_broken_entry(tmp_path):
    path = tmp_path / "tables" / "one"
    path.parent.mkdir()
    process = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert process.returncode < 0
    assert len([*path.parent.iterdir()]) == 1, "what it had begun, which counts as any other file for the bound"
    assert read_cached(path) == (b"sound", True)
    assert make_room(tmp_path, 0) == 0
    assert not path.exists()


@pytest.fixture
def home(tmp_path, monkeypatch):
    """The person's cache, of 350 bytes for compilations and as much for tables."""
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    monkeypatch.setattr(cache, "LARGEST", dict.fromkeys(cache.LARGEST, 350))
    return tmp_path


def table(home, name, size=100):
    folder = cache_folder("tables")
    assert folder == home / "tables"
    return cached(folder / name, lambda: bytes(size), write, Path.read_bytes)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def run_compiling(cache_folder, **environment):
    """The programs that a process compiles where its commands would, and those that it finds compiled."""
    compiling = """
from apollonius.io.cache import keep_compilations
keep_compilations()
import jax
events = []
jax.monitoring.register_event_listener(lambda name, **_: events.append(name.rpartition("/")[2]))
jax.jit(lambda x: x + 1)(1.0)
print(events.count("cache_misses"), events.count("cache_hits"))
"""
    outer = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    environment = outer | {cache.VARIABLE: str(cache_folder)} | environment
    command = [sys.executable, "-c", compiling]
    process = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert process.stderr == ""
    return process.stdout.strip()


def test_later_process_finds_compilations(tmp_path):
    assert run_compiling(tmp_path) == "1 0"
    assert run_compiling(tmp_path) == "0 1"
    assert run_compiling(tmp_path, XLA_FLAGS="--xla_cpu_enable_fast_math=true") == "1 0"
    assert {path.name for path in tmp_path.iterdir()} == {"compilations"}


def test_compilations_and_tables_have_separate_size_bounds(home, monkeypatch):
    table(home, "minutes of work", 300)
    os.utime(home / "tables" / "minutes of work", (1, 1))
    folder = home / "compilations" / "another processor"
    folder.mkdir(parents=True)
    for number in range(9):
        (folder / f"{number}").write_bytes(bytes(100))
        os.utime(folder / f"{number}", (1 + number, 1))
    os.utime(folder / "0", (20, 1))
    settings = {}
    monkeypatch.setattr(cache, "_JAX_FOLDER", "no_setting_of_jax")
    monkeypatch.setattr(jax.config, "no_setting_of_jax", None, raising=False)
    monkeypatch.setattr(jax.config, "update", settings.__setitem__)
    keep_compilations()
    assert Path(settings["no_setting_of_jax"]).parent == home / "compilations"
    assert names(home / "tables") == ["minutes of work"]
    assert names(folder) == ["0", "7", "8"], "read last, whoever wrote them first"
    table(home, "more", 300)
    assert names(home / "tables") == ["more"]
    assert names(folder) == ["0", "7", "8"]


def test_least_recently_used_entries_are_evicted_first(home):
    for number in range(3):
        table(home, f"{number}")
        os.utime(home / "tables" / f"{number}", (1, 1 + number))
    table(home, "0")  # is read
    table(home, "3")
    assert names(home / "tables") == ["0", "2", "3"]
    table(home, "huge", 400)
    assert names(home / "tables") == ["0", "2", "3"], "what is larger than all may be goes first"
    for number in range(9):
        read_cached(entry_path(home / "run", f"{number}.json", KEY))
    assert len(names(home / "run")) == 9, "only the person's own cache is bounded"


@pytest.mark.parametrize("word", ["off", "OFF", "0"])
def test_environment_variable_switches_the_cache_off(word, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, word)
    assert [cache_folder(kind) for kind in cache.LARGEST] == [None, None]
    monkeypatch.setattr(cache, "processor", None)
    keep_compilations()


def test_unwritable_cache_is_ignored_and_another_folder_is_an_error(home):
    (home / "tables").write_text("no folder")
    assert table(home, "one") == bytes(100)
    (home / "run").write_text("no folder")
    with pytest.raises(OSError, match="exists"):
        read_cached(home / "run" / "one")


def test_memory_finds_values_by_content_and_keeps_the_latest():
    made, memory = [], Memory(2)
    for number in (1.0, 2.0, 1.0, 3.0, 1.0, 2.0):
        found = memory.get({"a": jnp.asarray(number)}, lambda number=number: made.append(number) or jnp.full(2, number))
        assert found[0] == number
    assert made == [1.0, 2.0, 3.0, 2.0]


def test_keep_compilations_respects_the_cache_folder_of_jax(monkeypatch, tmp_path):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "other"))
    before = jax.config.jax_compilation_cache_dir
    assert before is not None  # these tests have one of their own
    keep_compilations()
    assert jax.config.jax_compilation_cache_dir == before
    assert not (tmp_path / "other").exists()


def test_compilations_are_not_stored_where_nothing_can_be_written(tmp_path, monkeypatch):
    (tmp_path / "a file").touch()
    assert run_compiling(tmp_path / "a file") == "0 0"
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    monkeypatch.setattr(cache, "_JAX_FOLDER", "no_setting_of_jax")
    monkeypatch.setattr(jax.config, "no_setting_of_jax", None, raising=False)
    monkeypatch.setattr(jax.config, "update", None)
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # the superuser may write anywhere
    keep_compilations()
