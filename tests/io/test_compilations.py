"""Compilations that are kept: entries whole or not there, of bounded size, found by the next process."""

import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import pytest
from jax._src import compilation_cache

from apollonius.io import cache
from apollonius.io.cache import VARIABLE, Entries, environment, keep_compilations

COMPILES = """
import json, jax, jax.numpy as jnp
from apollonius.io.cache import keep_compilations

keep_compilations()
events = []
jax.monitoring.register_event_listener(lambda event, **about: events.append(event.rsplit("/", 1)[-1]))
assert float(jax.jit(lambda x: jnp.sin(x) + 1)(0.0)) == 1
print(json.dumps({kind: events.count(kind) for kind in ("cache_hits", "cache_misses")}))
"""


def compiled(folder):
    """Hits and misses of a process that compiles something."""
    env = {**os.environ, VARIABLE: str(folder), "JAX_PLATFORMS": "cpu"}
    done = subprocess.run([sys.executable, "-c", COMPILES], env=env, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return json.loads(done.stdout)


def entries(folder):
    return sorted(path for path in Path(folder).rglob("*") if path.is_file())


@pytest.mark.slow
def test_what_one_process_compiles_the_next_one_finds_unless_it_is_broken(tmp_path):
    first = compiled(tmp_path)
    assert first["cache_hits"] == 0 < first["cache_misses"]
    assert compiled(tmp_path) == {"cache_hits": first["cache_misses"], "cache_misses": 0}

    kept = entries(tmp_path)
    assert {path.parent.name for path in kept} == {environment()}
    whole = kept[0].read_bytes()
    kept[0].write_bytes(whole[: len(whole) // 2])
    mended = compiled(tmp_path)
    assert mended == {"cache_hits": first["cache_misses"] - 1, "cache_misses": 1}
    assert compiled(tmp_path)["cache_misses"] == 0


def test_a_variable_switches_it_off(monkeypatch):
    monkeypatch.setenv(VARIABLE, "off")
    monkeypatch.setattr(cache, "environment", None)
    keep_compilations()


def test_a_folder_that_jax_was_told_of_stays(monkeypatch, tmp_path):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "other"))
    before, made_by = jax.config.values["jax_compilation_cache_dir"], compilation_cache.get_file_cache
    assert before is not None  # these tests have one of their own
    keep_compilations()
    assert jax.config.values["jax_compilation_cache_dir"] == before
    assert compilation_cache.get_file_cache is made_by
    assert not (tmp_path / "other").exists()


def test_another_processor_and_another_version_have_folders_of_their_own(monkeypatch):
    names = {environment()}
    monkeypatch.setattr(cache, "processor", lambda: "flags: avx512f")
    names.add(environment())
    monkeypatch.setattr("importlib.metadata.version", lambda package: "99")
    names.add(environment())
    assert len(names) == 3


def test_an_entry_is_whole_or_not_there(tmp_path):
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
    assert entries(tmp_path) == [path]


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path):
    (tmp_path / "file").write_text("no folder")
    entries_here = Entries(tmp_path / "file" / "here")
    entries_here.put("one", b"value")
    assert entries_here.get("one") is None


def test_the_least_recently_used_entries_make_room_those_of_other_environments_too(tmp_path):
    other, here = tmp_path / "other" / "old", tmp_path / "here"
    other.parent.mkdir()
    here.mkdir()
    other.write_bytes(bytes(100))
    os.utime(other, (1, 1))
    entries_here = Entries(here, largest=350)
    for number in range(3):
        entries_here.put(f"{number}", bytes(96))
        os.utime(here / f"{number}", (2 + number, 2 + number))
    assert not other.exists()
    assert entries_here.get("0") is not None  # used just now
    entries_here.put("3", bytes(96))
    assert [path.name for path in entries(tmp_path)] == ["0", "2", "3"]
    entries_here.put("huge", bytes(400))
    assert [path.name for path in entries(tmp_path)] == ["0", "2", "3"]
