"""Kept functions: found without a trace where nothing has changed, and made again where anything has."""

import time
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from apollonius.game.arena import Arena
from apollonius.game.presets import make_game
from apollonius.io import kept
from apollonius.io.cache import Entries, kept_entries
from apollonius.io.kept import Kept

ARENA = make_game("paper").arena
PLACE = jnp.float32(0.25), jnp.float32(0.5)
NEAR = Arena.clearance(ARENA, *PLACE)


class Stranger(eqx.Module):
    """A part of a tree whose class is of no known package."""

    name: str = eqx.field(static=True)


@pytest.fixture
def stored(monkeypatch):
    """The names of entries that are written from now on."""
    names, put = [], Entries.put
    monkeypatch.setattr(Entries, "put", lambda self, key, value: names.append(key) or put(self, key, value))
    return names


@pytest.fixture(autouse=True)
def other_sources(monkeypatch, request):
    """Sources that no test before has had."""
    sources = f"{request.node.name} {time.time_ns()}"
    monkeypatch.setattr(kept, "_sources", lambda: sources)


def kept_now():
    """The function in a new process, which has compiled nothing yet."""
    return Kept(lambda arena, x, y: arena.clearance(x, y))


def later():
    """The function in a new process that cannot trace."""
    made = kept_now()
    made._jitted = None
    return made


def ours(stored):
    return [name for name in stored if name.startswith("kept_")]


def test_a_later_process_finds_it_without_a_trace(stored):
    assert kept_now()(ARENA, *PLACE) == NEAR
    assert len(ours(stored)) == 1
    found = later()
    assert found(ARENA, *PLACE) == NEAR
    assert found(ARENA, *PLACE) == NEAR
    assert later()(replace(ARENA, x_min=-7.0), *PLACE) == 0.5, "numbers are arguments"


@pytest.mark.parametrize("change", ["types", "static", "sources", "settings"])
def test_it_is_traced_where_anything_else_has_changed(change, stored, monkeypatch):
    kept_now()(ARENA, *PLACE)
    arena, place = ARENA, PLACE
    if change == "types":
        place = 0.25, PLACE[1]
    if change == "static":
        arena = replace(ARENA, discs=ARENA.discs[:1])
    if change == "sources":
        monkeypatch.setattr(kept, "_sources", lambda: "others")
    if change == "settings":
        monkeypatch.setenv("XLA_FLAGS", "--others")
    with pytest.raises(AttributeError):
        later()(arena, *place)


@pytest.mark.parametrize("lost", ["ours", "JAX's"])
def test_it_is_made_again_where_an_entry_is_lost(lost, stored):
    kept_now()(ARENA, *PLACE)
    entries, (name,) = kept_entries(), ours(stored)
    (entries._path / (name if lost == "ours" else entries.latest.key)).unlink()
    assert kept_now()(ARENA, *PLACE) == NEAR
    assert ours(stored)[-1] == name
    assert later()(ARENA, *PLACE) == NEAR


def test_what_is_of_other_packages_or_traced_is_not_kept(stored):
    assert Kept(lambda part, x: x + 1)(Stranger("one"), PLACE[0]) == 1.25
    assert jax.jit(kept_now())(ARENA, *PLACE) == NEAR
    assert not ours(stored)
