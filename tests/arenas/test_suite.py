"""Random arenas and the suites of them: what was published is drawn, gaps are kept, commands and records say so."""

import json
from collections import Counter
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas import suite
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game, from_dict, game_names, load_game, to_dict
from apollonius.arenas.names import KINDS
from apollonius.arenas.random_arena import random_arena, random_map
from apollonius.arenas.survey import survey
from apollonius.cli.main import main
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.result import ByArena, count_by_arena, count_by_detour, read_result
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch, sample_starts
from apollonius.game.presets import in_arenas, in_teams, make_game
from apollonius.game.starts import Starts
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from tests.acting import clearances, results_of

NAME = "suite-v1"
ENTRIES = {entry.name: entry for entry in suite.suite_entries(NAME)}
GALLERY = ("blocks", "courtyard", "maze", "office", "warehouse")
PARTS = {
    ("suite-v1", "train"): {"discs": 64, "blocks": 64, "rooms": 64, "maze": 64},
    ("suite-v1", "held-out"): {"racks": 60, "caves": 60, "gallery": 5},
    ("suite-v2", "train"): {"discs": 8, "blocks": 16, "rooms": 24, "maze": 32, "labyrinth": 80},
    ("suite-v2", "held-out"): {"racks": 8, "caves": 8, "fences": 48, "floors": 32, "gallery": 5},
    ("suite-v3", "train"): {"buildings": 32},
    ("suite-v3", "held-out"): {"buildings": 20},
}


def test_suite_parts_have_the_published_kinds_and_counts():
    assert {part: Counter(entry.kind for entry in suite.suite_entries(*part)) for part in PARTS} == PARTS
    assert len(ENTRIES) == len(suite.suite_names(NAME)) == 256 + 125
    assert suite.suite_names(NAME, "held-out")[-5:] == GALLERY
    assert set(GALLERY) <= set(game_names())


@pytest.mark.parametrize("name", suite.SUITES)
def test_suite_arenas_match_their_published_digests(name):
    """Every fourth of a kind, but fewer caves, which take their time."""
    for kind in {entry.kind for entry in suite.suite_entries(name)}:
        entries = [entry for entry in suite.suite_entries(name) if entry.kind == kind]
        for entry in entries[:: 30 if kind == "caves" else 4]:
            assert suite.arena_digest(suite.suite_arena(name, entry.name)) == entry.sha256


def test_arena_digest_depends_on_numbers_to_a_micrometre():
    arena = Arena(discs=(Disc(3.0, 0.0, 0.5),))
    assert suite.arena_digest(arena) == suite.arena_digest(Arena(discs=(Disc(3.0, -1e-9, 0.5 + 1e-9),)))
    others = [
        Arena(discs=(Disc(3.0, 0.0, 0.500001),)),
        Arena(x_max=9.0, discs=arena.discs),
        Arena(),
        replace(arena, map=suite.suite_arena(NAME, "caves-00").map),
    ]
    assert len({suite.arena_digest(one) for one in [arena, *others]}) == 5


def test_suite_arena_refuses_an_arena_with_another_digest(monkeypatch):
    entries = (replace(ENTRIES["discs-00"], sha256="0" * 64),)
    monkeypatch.setattr(suite, "_published", lambda suite: entries)
    with pytest.raises(InvalidInput, match=r"SHA-256 of suite-v1/discs-00 = b73cd2122739... .* 000000000000... as pub"):
        suite.suite_arena(NAME, "discs-00")
    assert main(["evaluate", "still", "still", "--game", "suite-v1/discs-00"]) == 2


def draw_arena(kind="discs", seed=0, **numbers):
    return random_arena(kind, seed, **numbers)


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: suite.suite_arena("suite-v0", "discs-00"), "suite = suite-v0 .* one of suite-v1"),
        (lambda: suite.suite_names(NAME, "test"), "part = test .* one of train, held-out"),
        (lambda: suite.suite_arena(NAME, "racks-99"), "arena of suite-v1 = racks-99 .* one of discs-00"),
        (lambda: find_game("suite-v1/"), "unknown game 'suite-v1/'; choose .* as 'suite-v1/racks-07'"),
        (lambda: find_game("suite-v1/none"), "arena of suite-v1 = none"),
        (lambda: find_game("suite-v1/maze-00,maze-00"), "scenario = .* a list of different arenas"),
        (lambda: draw_arena(gap=4.0), "5 discs find no room: after .* ask for a smaller gap"),
        (lambda: draw_arena(gap=-1.0), "gap = -1"),
        (lambda: draw_arena(width=3.0), "width, height = .* at least 3.6 m"),
        (lambda: draw_arena(seed=-1), "seed = -1"),
        (lambda: draw_arena(kind="swamps"), "kind = swamps .* one of discs, blocks"),
        (lambda: draw_arena(kind="maze", width=2.0), "width, height = .* two corridors"),
        (lambda: draw_arena(kind="racks", height=2.0), "width, height = .* an aisle on either side"),
        (lambda: draw_arena(kind="blocks", gap=4.7), "width, height = .* a block with a gap"),
        (lambda: draw_arena(kind="rooms", gap=9.0), "width, height = .* two rooms"),
        (lambda: draw_arena(kind="rooms", gap=1e-3, width=90.0), "gap = 0.001 .* at most 500 polygons"),
        (lambda: draw_arena(kind="maze", width=60.0, height=60.0), "gap = 1.0 .* wider, or the arena smaller"),
        (lambda: draw_arena(kind="caves", width=3.9), "width, height = .* at least 4 m each, 4 gaps"),
        (lambda: draw_arena(kind="caves", gap=0.07), "gap = 0.07 .* at least 0.08 m, as a cave has 1,000 cells"),
        (lambda: draw_arena(gap=0.0), "gap = 0.0 .* more than 0"),
        (lambda: draw_arena(kind="rooms", width=1e6), "width, height = .* at most 100 m"),
        (lambda: random_map("caves"), "must be as in 'caves seed=0"),
        (lambda: random_map("discs seed=0 gap=1.0 width=10.0 height=10.0"), "of a kind that draws cells"),
        (lambda: random_map("swamps seed=0 gap=1.0 width=10.0 height=10.0"), "must be as in 'caves seed=0"),
        (lambda: random_map("caves seed=0 gap=1e999 width=10.0 height=10.0"), "gap = inf"),
        (lambda: random_map("caves seed=0 gap=1..0 width=10.0 height=10.0"), "must be as in 'caves seed=0"),
        (lambda: random_map("caves seed=9999999999 gap=1.0 width=10.0 height=10.0"), "seed = 9999999999"),
        (lambda: random_map("caves seed=0 gap=1.0 width=1e9 height=10.0"), "width, height = "),
    ],
    ids=range(28),
)
def test_unknown_names_and_impossible_random_arenas_are_refused(act, said):
    with pytest.raises(InvalidInput, match=said):
        act()


THREE = "suite-v1/discs-01,racks-07,caves-07"


@pytest.fixture(scope="module")
def three():
    return find_game(THREE)


def test_list_of_arenas_makes_a_game_in_each_of_them(three):
    assert three.scenario.count == three.scenario.size == 3
    names = THREE.removeprefix("suite-v1/").split(",")
    for number, (name, alone) in enumerate(zip(names, suite.single_arena_games(three), strict=True)):
        arena, padded = suite.suite_arena(NAME, name), three.scenario.arena(jnp.asarray(number))
        assert to_dict(alone.arena) == to_dict(arena)
        x, y = np.random.default_rng(0).uniform(0, [[arena.x_max], [arena.y_max]], (2, 300)).astype(np.float32)
        np.testing.assert_allclose(clearances(padded, x, y), clearances(arena, x, y), atol=1e-5)
        assert padded.map.field is three.scenario.arenas.map.field, "no game has a copy"


def test_record_names_the_list_of_arenas(three):
    record = to_dict(three)
    assert record["scenario"] == THREE
    again = from_dict(Game, json.loads(json.dumps(record)), "a record")
    assert again.scenario is suite.find_scenario(THREE)
    with pytest.raises(InvalidInput, match=r"scenario = suite-v1/nothing .* one of suite-v1/train, suite-v1/held-out"):
        from_dict(Game, record | {"scenario": "suite-v1/nothing"}, "a record")
    with pytest.raises(InvalidInput, match="arena of suite-v1 = no-such"):
        find_game("suite-v1/discs-01,no-such")


def test_drawn_robot_kinds_range_around_the_robots_of_the_paper():
    found, stout = suite.draw_robot_kinds(), suite.draw_robot_kinds("suite-v2")
    own = suite.PAPER_PAIRS
    assert len(found) == own + suite.OTHER_PAIRS
    for role in Role:
        numbers = np.array([(body.v_max, body.u1_max, body.u2_max, body.radius) for body in found.every(role)])
        np.testing.assert_allclose(numbers[:own], [(1.2, 0.3, 0.8, 0.0)] * own, rtol=1e-6)
        np.testing.assert_allclose(numbers[own:].min(axis=0), [0.6, 0.15, 0.4, 0], atol=0.1)
        np.testing.assert_allclose(numbers[own:].max(axis=0), [2, 1.2, 2, 0.25], atol=0.4)
        radii = np.array([body.radius for body in stout.every(role)])
        assert 0.27 < radii.max() <= 0.3
        assert np.mean(radii > 0) == 1 - own / 2 / len(stout)
    gaps = np.asarray(found.capture_distance - found.pursuer.radius - found.evader.radius)
    assert 0.2 - 1e-5 <= gaps.min() <= gaps.max() <= 0.4 + 1e-5


def test_buildings_have_robots_with_bodies_and_time_to_cross_them():
    game = find_game("suite-v3/buildings-01,buildings-32")
    assert game.max_steps == 3000
    radii = [body.radius for role in Role for body in game.scenario.kinds.every(role)]
    assert 0.15 <= min(radii) < 0.17
    assert 0.28 < max(radii) <= 0.3
    assert find_game("suite-v2/fences-00,fences-01").scenario.kinds is None


def test_each_game_has_the_robots_of_its_variant():
    """Two arenas, three kinds of robots: who is fast is where the state says."""
    own = suite.PAPER_PAIRS
    some = jax.tree.map(lambda leaf: leaf[own - 1 : own + 2], suite.draw_robot_kinds())
    game = in_arenas(Game(), [suite.suite_arena("suite-v1", name) for name in ("discs-01", "discs-03")])
    game = replace(game, scenario=replace(game.scenario, kinds=some))
    assert game.scenario.size == 6
    states = jax.jit(reset_batch, static_argnames="games")(game, jax.random.key(0), 64)
    assert set(np.asarray(states.variant).tolist()) == set(range(6))
    straight = jnp.full(64, 7, jnp.int32)
    step = jax.jit(jax.vmap(lambda state, action: game.step(state, action, action).state))
    for _ in range(3):
        states = step(states, straight)
    gained = np.asarray(some.pursuer.u1_max)[np.asarray(states.variant) // 2] * 0.3
    np.testing.assert_allclose(states.pursuer.v, gained, rtol=1e-4)
    team = in_teams(game, 3, 2).with_variant(jnp.int32(5))
    for side, kind, size in zip(team.bodies, (some.pursuer, some.evader), (3, 2), strict=True):
        assert [float(body.v_max) for body in side] == [float(kind.v_max[2])] * size


def test_matches_cycle_through_arenas_and_robot_kinds(three):
    starts = sample_starts(three, jax.random.key(0), 7)
    assert np.asarray(starts.variant).tolist() == [0, 1, 2, 0, 1, 2, 0]
    with_kinds = replace(three.scenario, kinds=suite.draw_robot_kinds())
    places = with_kinds.variant_of(np.arange(3 * 64))
    assert sorted(places) == list(range(3 * 64)), "every arena with every make once"


def test_wins_are_counted_by_arena(three):
    outcome = jnp.asarray([Outcome.CAPTURED, Outcome.NO_RESULT, Outcome.EVADER_OUT_OF_RANGE] * 3 + [1])
    found = count_by_arena(three.scenario, results_of(outcome, jnp.ones(10, jnp.int32)))
    assert found == ByArena((4, 0, 3), (4, 3, 3))
    assert (found.rates, found.mean) == ([1.0, 0.0, 1.0], pytest.approx(2 / 3))
    assert found.worst == 0.0
    assert found.interval == (0.0, 1.0)
    found = count_by_arena(three.scenario, results_of(outcome[:2], jnp.ones(2, jnp.int32)))
    assert (found.wins, found.games) == ((1, 0), (1, 1)), "an arena in which nothing was played is not counted"


def test_match_in_charted_arenas_counts_wins_by_detour():
    game = with_chart(replace(find_game("suite-v2/fences-03,labyrinth-03"), max_steps=1))
    result = play_match(Match.of_names(game, "still", "still", 40))
    assert list(result.detours) == ["below 1.5", "1.5 to 2.5", "above 2.5"]
    wins, games = np.sum(list(result.detours.values()), axis=0)
    assert (wins, games) == (0, 40), "all have a way, and nobody is caught in one step"
    assert result.detours["above 2.5"][1] > 0
    captured = results_of(jnp.full(4, Outcome.CAPTURED), jnp.ones(4, jnp.int32))
    found = count_by_detour(np.array([1.4, 1.5, 2.5, np.inf]), captured)
    assert list(found.values()) == [(1, 1), (1, 1), (1, 1)]
    assert read_result(json.loads(json.dumps(result.to_dict())), "a file").detours == result.detours


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, 2, 3))])
@pytest.mark.parametrize("kind", KINDS)
def test_robot_narrower_than_the_gap_reaches_all_of_a_random_arena(kind, seed):
    width, height = ((10.0, 10.0), (14.0, 8.0), (9.0, 16.0), (6.0, 6.0))[seed]
    if kind == "buildings":
        width, height = ((25.0, 14.0), (13.0, 20.0), (12.0, 12.0), (34.0, 16.0))[seed]
    body, arena = Unicycle(radius=0.47), random_arena(kind, seed, gap=1.0, width=width, height=height)
    assert len(arena.obstacles) >= 1
    found = survey(Game(body, body, arena, capture_distance=1.0, starts=Starts(clearance=0.1)))
    assert [parts.max() for parts in found.parts] == [1, 1]
    assert found.wrong == ()


def test_arena_random_writes_a_sound_game(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write = ["arena", "random", "--seed", "2", "--size", "12", "7", "--game", "robot", "--out", "mine.toml"]
    assert main(write) == 0
    game = load_game(tmp_path / "mine.toml")
    assert game.arena == random_arena("discs", 2, width=12.0, height=7.0)
    assert game.pursuer == make_game("robot").pursuer
    assert main(["arena", "check", "mine.toml"]) == 0
    assert "nothing is wrong" in capsys.readouterr().out
    assert main([*write, "--seed", "3"]) == 2
    assert "--force" in capsys.readouterr().err
    assert load_game(tmp_path / "mine.toml") == game
    assert main([*write, "--force", "--gap", "0.3"]) == 2
    assert "does not fit through" in capsys.readouterr().err
    assert main(["arena", "random", "--kind", "rooms", "--seed", "3", "--out", "rooms.json"]) == 0
    assert load_game(tmp_path / "rooms.json").arena == random_arena("rooms", 3)


def test_record_names_the_parameters_of_a_cave():
    game = Game(arena=random_arena("caves", 3, gap=0.9, width=9.0, height=7.5))
    record = json.loads(json.dumps(to_dict(game)))
    drawn = {"file": "caves seed=3 gap=0.9 width=9.0 height=7.5", "sha256": game.arena.map.digest}
    assert record["arena"]["map"] == drawn
    again = from_dict(Game, record, "the record")
    np.testing.assert_array_equal(again.arena.map.field, game.arena.map.field)
    assert to_dict(again) == to_dict(game)
    record["arena"]["map"]["sha256"] = "0" * 64
    with pytest.raises(InvalidInput, match="which this version draws otherwise"):
        from_dict(Game, record, "the record")


def test_arena_random_writes_the_game_and_its_map(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = "it's: a #1"
    write = ["arena", "random", "--kind", "caves", "--seed", "4", "--size", "9", "8", "--out", f"{name}.toml"]
    assert main(write) == 0
    assert "caves, a map of 72 x 64 cells" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.toml", f"{name}.yaml", f"{name}.pgm"}
    game, drawn = load_game(tmp_path / f"{name}.toml"), random_arena("caves", 4, width=9.0, height=8.0)
    np.testing.assert_array_equal(game.arena.map.field, drawn.map.field)
    assert (game.arena.x_max, game.arena.y_max) == (drawn.x_max, drawn.y_max) == (9.0, 8.0)
    assert main(["arena", "check", f"{name}.toml"]) == 0
    (tmp_path / f"{name}.toml").unlink()
    capsys.readouterr()
    assert main(write) == 2
    assert f"{name}.yaml" in capsys.readouterr().err
    assert main([*write, "--force"]) == 0
