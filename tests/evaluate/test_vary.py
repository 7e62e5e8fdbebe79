"""Varied numbers of a game: the matches of `evaluate`, in one compilation, as a table, JSON and a picture."""

import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.figure import Figure

from apollonius.agents.shield import BRAKING, Shielded
from apollonius.catalogue import find_player
from apollonius.cli.terminal import varied_table
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.vary import Variation, alike, numbers_of, play_varied, varied_matches, with_numbers
from apollonius.game import game as starts
from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import RobotState, Role
from apollonius.io.errors import InvalidInput
from apollonius.play import playout
from apollonius.show import matches as pictures

PAPER = replace(make_game("paper"), max_steps=150)
NAMES = BySide("pure-pursuit", "still")
SPEEDS = Variation("pursuer.v_max", (0.2, 1.2, 2.4))
RADII = Variation("arena.discs.0.radius", (0.5, 0.7))


@pytest.fixture(scope="module")
def told():
    return []


@pytest.fixture(scope="module")
def found(told):
    matches = varied_matches(PAPER, NAMES, (SPEEDS, RADII), 60, 3)
    return play_varied(matches, (SPEEDS, RADII), lambda *numbers: told.append(numbers))


def test_each_is_the_match_of_evaluate_and_a_faster_pursuer_wins_more(found, told):
    assert found.results[2] == play_match(Match.of_names(PAPER, *NAMES, 60, 3))
    slower = replace(PAPER, pursuer=replace(PAPER.pursuer, v_max=0.2))
    assert found.results[0] == play_match(Match.of_names(slower, *NAMES, 60, 3))
    assert found.win_rates.shape == (3, 2)
    assert found.win_rates[0, 0] < found.win_rates[2, 0]
    assert told == sorted(told)
    assert told[-1] == (360, 360)


def test_as_text_and_as_data_each_result_is_beside_its_values(found):
    heading, _, header, *rows = varied_table(found).splitlines()
    assert "60 games, starts: rest" in heading
    assert header.split() == ["pursuer.v_max", "\\", "arena.discs.0.radius", "0.5", "0.7"]
    low, high = found.results[2].pursuer_win_interval
    shown = f"{100 * found.results[2].pursuer_win_rate:.1f} [{100 * low:.0f}, {100 * high:.0f}]"
    assert rows[1].split(maxsplit=1)[0] == "1.2"
    assert rows[1].split(maxsplit=1)[1].startswith(shown)
    data = json.loads(json.dumps(found.to_dict()))["matches"]
    assert [one["pursuer.v_max"] for one in data] == [speed for speed in SPEEDS.values for _ in RADII.values]
    assert [one["outcomes"] for one in data] == [one.outcomes for one in found.results]


def test_a_map_has_every_rate_and_a_curve_too(found, tmp_path, monkeypatch):
    drawn: list[Figure] = []
    save = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda self, *given, **kw: (drawn.append(self), save(self, *given, **kw)))
    pictures.draw_varied(found, tmp_path / "map.png")
    one = replace(found, variations=(SPEEDS,), results=found.results[::2])
    pictures.draw_varied(one, tmp_path / "curve.png")
    heat, curve = (figure.axes[0] for figure in drawn)
    assert heat.collections[0].get_array().tolist() == (100 * found.win_rates.T).tolist()
    assert (heat.collections[0].get_clim(), heat.collections[1].levels.tolist()) == ((0, 100), [50])
    assert curve.lines[0].get_ydata().tolist() == pytest.approx(100 * found.win_rates[:, 0])
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_one_compilation_serves_all_values():
    game = replace(PAPER, max_steps=20)

    def play(*variations):
        play_varied(varied_matches(game, NAMES, variations, 5), variations)

    play(Variation("pursuer.v_max", (1.8,)))
    compiled = playout._advance._cache_size(), starts._draw_block._cache_size()
    play(SPEEDS, RADII)
    play(Variation("max_steps", (10.0, 20.0)))
    assert (playout._advance._cache_size(), starts._draw_block._cache_size()) == compiled


def test_only_the_named_numbers_change():
    other = with_numbers(PAPER, {"evader.u2_max": 0.4, "max_steps": 70.0})
    assert other == replace(PAPER, evader=replace(PAPER.evader, u2_max=0.4), max_steps=70)
    assert numbers_of(other) == numbers_of(PAPER) | {"evader.u2_max": 0.4, "max_steps": 70}


@pytest.mark.parametrize(
    ("numbers", "named"),
    [
        ({"pursuer.vmax": 1.0}, r"no number 'pursuer\.vmax': did you mean 'pursuer\.v_max'\?"),
        ({"pursuer.v_max": float("nan")}, r"pursuer\.v_max = nan"),
        ({"pursuer.u2_max": 24.0}, r"with pursuer\.u2_max = 24: pursuer\.u2_max = 24"),
        ({"max_steps": 10.5}, r"max_steps = 10\.5"),
        ({"capture_distance": 2.0}, r"with capture_distance = 2: starts\.separation"),
    ],
)
def test_numbers_that_cannot_be_are_refused(numbers, named):
    with pytest.raises(InvalidInput, match=named):
        with_numbers(PAPER, numbers)


SQUARES = tuple(
    Polygon(((x, y), (x + 0.5, y), (x + 0.5, y + 0.5), (x, y + 0.5))) for x, y in ((3.0, 3.0), (6.0, 3.0), (3.0, 6.0))
)
GAME = Game(arena=Arena(polygons=SQUARES))


def shielded(v_max):
    """A random pursuer of this top speed [m/s] behind a shield."""
    policy = find_player("shielded:random", Role.PURSUER, replace(GAME, pursuer=Unicycle(v_max=v_max))).policy
    assert isinstance(policy, Shielded)
    return policy


def test_shields_get_one_structure_and_leave_as_much_room_as_before():
    before = [shielded(v_max) for v_max in (0.6, 1.8)]
    after = alike(before)
    shapes = [jax.tree.map(jnp.shape, policy) for policy in after]
    assert jax.tree.structure(after[0]) == jax.tree.structure(after[1])
    assert shapes[0] == shapes[1] != jax.tree.map(jnp.shape, before[0])
    places = np.random.default_rng(0).uniform((1, 1, -3), (9, 9, 3), (200, 3)).astype(np.float32)

    @jax.jit
    def clearances(backup, places):
        return jax.vmap(lambda at: backup.clearances(RobotState(at[0], at[1], jnp.float32(0.6), at[2])))(places)

    for old, new in zip(before, after, strict=True):
        found = np.asarray(clearances(old.backup, places))
        assert found.shape == (200, len(BRAKING))
        np.testing.assert_allclose(clearances(new.backup, places), found, atol=1e-5)
