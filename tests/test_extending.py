"""Agents by name; and `docs/how-to/extend.md`: a new obstacle is a short file and a line."""

from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius import catalogue
from apollonius.agents.classical import Still
from apollonius.agents.network import make_network
from apollonius.agents.pool import single_player
from apollonius.agents.source import NamedPlayer, PlayerSource
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.agents.trained import Greedy, trained_elsewhere
from apollonius.agents.wrappers.shield import Shielded, with_shield
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game, from_dict, to_dict
from apollonius.arenas.survey import survey
from apollonius.catalogue import find_player, find_pool
from apollonius.export.player import find_exportable
from apollonius.game.arena import Arena, Disc, register_obstacle
from apollonius.game.game import Game, reset_batch
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import BySide, Role
from apollonius.io.errors import InvalidInput
from apollonius.learn.earlier_versions import SCHEMES, draw_version
from apollonius.learn.self_play import SelfPlayConfig
from apollonius.observe import registry
from apollonius.observe.registry import register_observation
from apollonius.observe.view import look
from apollonius.play.playout import play_out
from apollonius.show.canvas import Canvas
from apollonius.show.palette import OBSTACLE
from jaxpr2c import translate
from tests.acting import act, act_in_rows, robot, state
from tests.bearing import BEARING, Bearing
from tests.capsule import Capsule
from tests.documents import REPOSITORY
from tests.learn.test_earlier_versions import versions_of

DOCUMENT = (REPOSITORY / "docs" / "how-to" / "extend.md").read_text()


WALL = Capsule(3.0, 5.0, 7.0, 6.0, 0.3)


def test_document_names_the_example_files():
    assert "tests/capsule.py" in DOCUMENT
    assert "apollonius/game/car.py" in DOCUMENT


def test_new_obstacle_is_as_far_away_as_its_points():
    arena = Arena(-90.0, 90.0, -90.0, 90.0, extra=(WALL,))
    line = np.linspace([WALL.x, WALL.y], [WALL.to_x, WALL.to_y], 2000)
    rng = np.random.default_rng(0)
    along = jax.jit(arena.clearance_along)
    for ends in rng.uniform(2, 8, (40, 4)):
        step = np.linspace(ends[:2], ends[2:], 200)
        apart = np.hypot(*(step[:, None] - line[None]).transpose(2, 0, 1)).min() - WALL.radius
        assert float(along(robot(*ends[:2]), robot(*ends[2:]))) == pytest.approx(apart, abs=0.02)


@pytest.mark.slow
def test_new_obstacle_works_in_games_players_surveys_and_pictures():
    game = Game(arena=Arena(extra=(WALL,)), max_steps=60)
    assert game.arena.hits_obstacle(robot(5.0, 5.0), robot(5.0, 6.0), 0.0)
    assert not game.arena.hits_obstacle(robot(5.0, 4.0), robot(5.0, 4.5), 0.3)
    states = jax.jit(reset_batch, static_argnums=2)(game, jax.random.key(0), 200)
    line = np.linspace([WALL.x, WALL.y], [WALL.to_x, WALL.to_y], 500)
    places = np.stack([states.pursuer.x, states.pursuer.y], axis=1)
    assert np.hypot(*(places[:, None] - line[None]).transpose(2, 0, 1)).min() >= 0.3 + 0.3 - 1e-4
    found = survey(game)
    assert found.blocked.mean() == pytest.approx((np.hypot(4, 1) * 0.6 + np.pi * 0.09) / 100, rel=0.05)
    assert found.wrong == ()
    red, green, blue = (int(OBSTACLE[first : first + 2], 16) for first in (1, 3, 5))
    pixels = np.array(Canvas(game).picture()).reshape(-1, 3)
    assert (pixels == (red, green, blue)).all(axis=1).mean() > 0.015
    player = with_shield(Greedy(make_network("encoded", 4, 1, jax.random.key(0))), game, Role.PURSUER)
    blocked = look(game, state((5.0, 4.3, 1.2, np.pi / 2), (9.0, 9.0)), Role.PURSUER)
    assert int(act(player, blocked, jnp.uint32(0))) in (0, 1, 2)  # it brakes


def test_new_obstacle_is_read_from_files_once_registered(monkeypatch):
    table = {"capsules": [{"x": 3.0, "y": 5.0, "to_x": 7.0, "to_y": 6.0, "radius": 0.3}]}
    monkeypatch.setattr("apollonius.game.arena._KINDS", {})
    with pytest.raises(InvalidInput, match="unknown key 'capsules'"):
        from_dict(Game, {"arena": table}, "a file")
    with pytest.raises(InvalidInput, match=r"obstacle = Capsule .* register_obstacle"):
        to_dict(Arena(extra=(WALL,)))
    register_obstacle("capsules", Capsule)
    register_obstacle("capsules", Capsule)
    arena = from_dict(Game, {"arena": table}, "a file").arena
    assert arena.extra == (WALL,)
    assert to_dict(arena).items() >= table.items()
    assert "extra" not in to_dict(arena)
    for name, kind in (("capsules", Disc), ("discs", Capsule), ("map", Capsule)):
        with pytest.raises(InvalidInput, match=f"table = {name} .* no other part"):
            register_obstacle(name, kind)
    for wrong in ({"extra": []}, {"capsules": {}}, {"capsules": [3]}, {"capsules": [{"x": 3}]}):
        with pytest.raises(InvalidInput, match=r"a file: .*(arena\.extra|arena\.capsules)"):
            from_dict(Game, {"arena": wrong}, "a file")
    with pytest.raises(InvalidInput, match="obstacles = Capsule is not possible: it must be discs"):
        arena.require_only((Disc, Polygon), "discs and polygons")
    with pytest.raises(InvalidInput, match=r"arena.capsules\[1\] end = \(30.0, 5.0\)"):
        Game(arena=Arena(extra=(WALL, replace(WALL, x=30.0))))


@pytest.mark.slow
def test_new_observation_works_in_networks_games_and_files(tmp_path, monkeypatch):
    monkeypatch.setitem(registry.OBSERVATIONS, BEARING.name, BEARING)  # so that it is gone after the test
    del registry.OBSERVATIONS[BEARING.name]
    register_observation(BEARING)
    register_observation(BEARING)
    monkeypatch.setattr(Bearing, "name", "paper")
    with pytest.raises(InvalidInput, match=r"observation = paper .* no other"):
        register_observation(BEARING)
    monkeypatch.setattr(Bearing, "name", "bearing")
    game = Game(arena=Arena(discs=(Disc(7.0, 5.0, 0.5),)), max_steps=20)
    start = state((5.0, 5.0, 0.6, np.pi / 2), (5.0, 7.0))
    np.testing.assert_allclose(BEARING(look(game, start, Role.PURSUER)), [0.0, 1.0, 0.0, 0.2, 1.0, 1.0], atol=1e-5)
    network = make_network("bearing", 8, 2, jax.random.key(0))
    save_agent(describe(network, Role.PURSUER, {}, {}), tmp_path / "agent.safetensors")
    read = load_agent(tmp_path / "agent.safetensors").network
    assert read.observation == BEARING
    assert read.layers[0].in_features == 6
    exported = find_exportable(str(tmp_path / "agent.safetensors"), Role.PURSUER, game)
    assert "void bearing(" in translate(exported.decide, *exported.arguments, name="bearing").header()
    starts = jax.jit(reset_batch, static_argnums=2)(game, jax.random.key(0), 4)
    player = Greedy(make_network("encoded", 8, 2, jax.random.key(1)))
    results = play_out(game, BySide(single_player(Greedy(read)), single_player(player)), starts, jax.random.key(1))
    assert int(results.outcome.min()) > 0


def test_new_scheme_is_read_from_configs_and_draws_opponents(monkeypatch):
    line = '"recent": lambda lost: 2.0 ** jnp.arange(len(lost), dtype=jnp.float32),'
    assert line in DOCUMENT
    recent = eval(f"{{{line}}}", {"jnp": jnp})["recent"]
    monkeypatch.setitem(SCHEMES, "recent", recent)
    config = from_dict(SelfPlayConfig, {"opponents": "recent", "versions": 4}, "a config")
    assert config.has_earlier_versions
    keys = jax.random.split(jax.random.key(0), 7000)
    drawn = jax.jit(jax.vmap(lambda key: draw_version(versions_of(3), "recent", key).drawn[1]))(keys)
    np.testing.assert_allclose(np.bincount(drawn) / 7000, [1 / 7, 2 / 7, 4 / 7], atol=0.03)


PAPER = make_game("paper")


@pytest.fixture(scope="module")
def pursuer():
    return describe(make_network("encoded", 4, 2, jax.random.key(0)), Role.PURSUER, {}, {"seed": 5})


def test_agent_file_plays_its_side_greedily_under_the_name_of_its_run(pursuer, tmp_path, monkeypatch):
    """Two runs give their agents the same names, and those of the zoo."""
    monkeypatch.chdir(tmp_path)
    file, alone = Path("runs/demo/agents/P_stage1.safetensors"), "chaser.safetensors"
    file.parent.mkdir(parents=True)
    for path in (file, Path(alone)):
        save_agent(pursuer, path)
    for name in ("demo/P_stage1", "runs/demo/P_stage1", str(file), str(file.resolve()), alone):
        found, called = find_player(name, Role.PURSUER, PAPER), "chaser" if name == alone else "demo/P_stage1"
        assert (found.name, type(found.policy), found.header) == (called, Greedy, pursuer.header)
        assert eqx.tree_equal(found.policy.network, pursuer.network)
    with pytest.raises(InvalidInput, match="plays the pursuer, not the evader"):
        find_player(alone, Role.EVADER, PAPER)
    names = ["shielded:demo/P_stage1", "P_stage1", "zoo/P_stage1"]
    _, bare, of_zoo = others = [find_player(name, Role.PURSUER, PAPER) for name in names]
    assert [one.name for one in others] == names
    assert eqx.tree_equal(of_zoo.policy, bare.policy)
    with pytest.raises(InvalidInput, match="unknown agent 'demo/P_stage2'; apollonius players lists"):
        find_player("demo/P_stage2", Role.PURSUER, PAPER)


class Echo(PlayerSource):
    """A kind of one's own: players that are called after what they do."""

    syntax = "always:ACTION"

    def find(self, name, role, game):
        return NamedPlayer(name, Still()) if name == "always:1" else None


def test_new_player_source_is_known_everywhere_once_registered(monkeypatch):
    with pytest.raises(InvalidInput, match="unknown agent 'always:1'"):
        find_player("always:1", Role.EVADER, PAPER)
    monkeypatch.setattr(catalogue, "SOURCES", (*catalogue.SOURCES, Echo()))
    assert isinstance(find_player("always:1", Role.EVADER, PAPER).policy, Still)
    guarded = find_player("shielded:always:1", Role.EVADER, PAPER)
    assert (guarded.name, type(guarded.policy)) == ("shielded:always:1", Shielded)
    assert isinstance(find_pool(["always:1"], Role.EVADER, PAPER).members, Still)
    with pytest.raises(InvalidInput, match=r"'always:2'; .*a file of a solved game, .*always:ACTION"):
        find_player("always:2", Role.EVADER, PAPER)


def test_pool_combines_trained_agents_random_and_still(pursuer, tmp_path):
    other = describe(make_network("encoded", 4, 2, jax.random.key(1)), Role.PURSUER, {}, {})
    files = [str(tmp_path / f"{index}.safetensors") for index in range(2)]
    for file, agent in zip(files, (pursuer, other), strict=True):
        save_agent(agent, Path(file))
    pool = find_pool([files[0], "random", files[1], "still"], Role.PURSUER, PAPER)
    assert pool.size == 4
    observation = jnp.tile(jnp.linspace(-1, 1, 17), (2000, 1))
    words = jax.random.bits(jax.random.key(2), (2000,))
    acts = jax.jit(act_in_rows)
    actions = [np.asarray(acts(pool, jnp.full(2000, member), observation, words)) for member in range(4)]
    for member, name in ((0, files[0]), (2, files[1]), (3, "still")):
        alone = act(find_player(name, Role.PURSUER, PAPER).policy, observation[0], words[0])
        assert (actions[member] == int(alone)).all()
    assert np.bincount(actions[1], minlength=9).min() > 150


@pytest.mark.parametrize("names", [[], ["random", "still"], ["random", "random"]], ids=str)
def test_incompatible_players_make_no_pool(names):
    with pytest.raises(InvalidInput, match="pursuers = "):
        find_pool(names, Role.PURSUER, PAPER)


def test_symmetric_agents_and_others_make_no_pool(tmp_path):
    files = [str(tmp_path / f"{index}.safetensors") for index in range(3)]
    for file, symmetric in zip(files, (True, False, True), strict=True):
        network = make_network("egocentric", 4, 2, jax.random.key(0), symmetric)
        save_agent(describe(network, Role.PURSUER, {}, {}), Path(file))
    assert find_pool(files[::2], Role.PURSUER, PAPER).size == 2
    with pytest.raises(InvalidInput, match="pursuers = "):
        find_pool(files, Role.PURSUER, PAPER)


def test_trained_elsewhere_marks_agents_of_another_arena():
    maze, charts = find_game("maze"), with_chart(PAPER)
    asked = [("P_curriculum", one) for one in (PAPER, charts, maze)] + [("pursuer", maze), ("still", maze)]
    found = [trained_elsewhere(find_player(name, Role.PURSUER, game), game) for name, game in asked]
    assert found == [False, False, True, False, False]
