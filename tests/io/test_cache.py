"""One cache of files: found by all that was asked for, whole whoever is killed, and never at the price of its bound.

Kept functions: found without a trace where nothing has changed, and made again where anything has.
"""

import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest
from jax._src import compilation_cache

from apollonius.game.arena import Arena
from apollonius.game.presets import make_game
from apollonius.io import cache, persistent_jit
from apollonius.io.cache import Entries, Memory, cache_folder, cached, content, entry_path, keep_compilations, make_room
from apollonius.io.document import write_atomically
from apollonius.io.errors import InvalidInput
from apollonius.io.persistent_jit import PersistentJit

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
from apollonius.io.cache import Entries, cached
from apollonius.io.document import write_atomically

os.replace = lambda *paths: os.kill(os.getpid(), signal.SIGKILL)
path = Path(sys.argv[1])
Entries(path.parent).put(path.name, b"new") if len(sys.argv) > 2 else cached(
    path, lambda: b"new", lambda value, path: write_atomically(path, value), lambda path: None
)
"""


@pytest.mark.parametrize("words", [(), ("compilation",)], ids=["file", "compilation"])
def test_process_killed_while_writing_leaves_no_broken_entry(words, tmp_path):
    path = tmp_path / "compilations" / "here" / "one"
    path.parent.mkdir(parents=True)
    done = subprocess.run([sys.executable, "-c", KILLED, str(path), *words], check=False)
    assert done.returncode < 0
    assert len([*path.parent.iterdir()]) == 1, "what it had begun, which counts as any other file for the bound"
    if words:
        entries = Entries(path.parent)
        assert entries.get(path.name) is None
        entries.put(path.name, b"whole")
        assert entries.get(path.name) == b"whole"
    else:
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


def test_compilations_and_tables_have_separate_size_bounds(home):
    table(home, "minutes of work", 300)
    os.utime(home / "tables" / "minutes of work", (1, 1))
    entries_here = Entries(home / "compilations" / "here", 350)
    for number in range(9):
        entries_here.put(f"{number}", bytes(96))
        os.utime(home / "compilations" / "here" / f"{number}", (1, 1 + number))
        assert entries_here.get("0") is not None
    assert names(home / "tables") == ["minutes of work"]
    assert names(home / "compilations" / "here") == ["0", "7", "8"]
    table(home, "more", 300)
    assert names(home / "tables") == ["more"]
    assert len(names(home / "compilations" / "here")) == 3


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
    monkeypatch.setattr(cache, "environment", None)
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
    before, made_by = jax.config.values["jax_compilation_cache_dir"], compilation_cache.get_file_cache
    assert before is not None  # these tests have one of their own
    keep_compilations()
    assert jax.config.values["jax_compilation_cache_dir"] == before
    assert compilation_cache.get_file_cache is made_by
    assert not (tmp_path / "other").exists()


def test_cache_entry_is_whole_or_absent(tmp_path):
    entries_here = Entries(tmp_path)
    assert entries_here.get("one") is None
    entries_here.put("one", b"value")
    assert entries_here.get("one") == b"value"
    path = tmp_path / "one"
    for broken in (b"", path.read_bytes()[:-1], path.read_bytes()[:-1] + b"x"):
        path.write_bytes(broken)
        assert entries_here.get("one") is None
    entries_here.put("one", b"mended")
    assert entries_here.get("one") == b"mended"
    assert names(tmp_path) == ["one"]
    nowhere = Entries(path / "a file is no folder")
    nowhere.put("one", b"value")
    assert nowhere.get("one") is None


ARENA = make_game("paper").arena
PLACE = jnp.float32(0.25), jnp.float32(0.5)
NEAR = Arena.clearance(ARENA, *PLACE)


class Stranger(eqx.Module):
    """A part of a tree whose class is of no known package."""

    name: str = eqx.field(static=True)


@pytest.fixture
def stored_names(monkeypatch):
    """The names of our entries, not JAX's, that are written from now on."""
    names, put = [], Entries.put
    monkeypatch.setattr(Entries, "put", lambda *given: names.extend(re.findall("^kept_.*", given[1])) or put(*given))
    return names


@pytest.fixture(autouse=True)
def other_sources(monkeypatch, request):
    """Sources that no test before has had."""
    sources = f"{request.node.name} {time.time_ns()}"
    monkeypatch.setattr(persistent_jit, "_sources", lambda: sources)


def kept_now():
    """The function in a new process, which has compiled nothing yet."""
    return PersistentJit(lambda arena, x, y: arena.clearance(x, y))


def later():
    """The function in a new process that cannot trace."""
    made = kept_now()
    made._jitted = None
    return made


def test_later_process_loads_a_compilation_without_tracing(stored_names):
    assert kept_now()(ARENA, *PLACE) == NEAR
    assert len(stored_names) == 1
    found = later()
    assert found(ARENA, *PLACE) == NEAR
    assert found(ARENA, *PLACE) == NEAR
    assert later()(replace(ARENA, x_min=-7.0), *PLACE) == 0.5, "numbers are arguments"


@pytest.mark.parametrize("change", ["types", "static", "sources", "settings"])
def test_function_is_traced_again_after_any_other_change(change, stored_names, monkeypatch):
    kept_now()(ARENA, *PLACE)
    arena, place = ARENA, PLACE
    if change == "types":
        place = 0.25, PLACE[1]
    if change == "static":
        arena = replace(ARENA, discs=ARENA.discs[:1])
    if change == "sources":
        monkeypatch.setattr(persistent_jit, "_sources", lambda: "others")
    if change == "settings":
        monkeypatch.setenv("XLA_FLAGS", "--others")
    with pytest.raises(AttributeError):
        later()(arena, *place)


@pytest.mark.parametrize("lost", ["ours", "JAX's"])
def test_lost_compilation_entry_is_written_again(lost, stored_names):
    kept_now()(ARENA, *PLACE)
    entries, (name,) = cache.compiled_entries(), stored_names
    (entries._path / (name if lost == "ours" else entries.latest.key)).unlink()
    assert kept_now()(ARENA, *PLACE) == NEAR
    assert stored_names[-1] == name
    assert later()(ARENA, *PLACE) == NEAR


def test_foreign_types_and_traced_calls_are_not_stored(stored_names):
    assert PersistentJit(lambda part, x: x + 1)(Stranger("one"), PLACE[0]) == 1.25
    assert jax.jit(kept_now())(ARENA, *PLACE) == NEAR
    assert not stored_names
