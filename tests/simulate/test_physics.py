"""The drive, MuJoCo's robots, which go where their wheels take them, and games of theirs, judged by the rules."""

import re
import sys
import tomllib
from dataclasses import fields, replace
from math import inf, nan
from pathlib import Path
from xml.etree import ElementTree

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still, Uniform
from apollonius.agents.policy import AbstractContinuous, AbstractPolicy
from apollonius.agents.pool import single_player
from apollonius.arenas.file import find_game, from_dict
from apollonius.evaluate.match import Match, play_games
from apollonius.game.arena import Arena, Disc
from apollonius.game.car import Car
from apollonius.game.drive import Drive as Slow
from apollonius.game.drive import Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.types import BySide, Outcome, RobotState, RobotStatus
from apollonius.io.errors import InvalidInput
from apollonius.observe import paper
from apollonius.play.replay import as_state, load_replay, save_replay
from apollonius.simulate import drive as drive_module
from apollonius.simulate.drive import References, RobotHardware, load_drive
from apollonius.simulate.physics import Physics, mjcf
from apollonius.simulate.simulation import compare_physics, record_course, simulate, simulate_match
from tests.acting import a_match
from tests.documents import ALL, REPOSITORY
from tests.test_extending import WALL

LIMITS = np.array([[0.0, 1.2], [0.0, 1.2]])
IDEAL = RobotHardware(latency=0.0, lag=0.0, turn_acceleration=1e6, friction=10.0, resistance=0.0, torque=1000.0)
"""A drive without delay, lag or slip."""


def wheels(v, turn_rate):
    return list(IDEAL.wheel_speeds(np.array(v), np.array(turn_rate)))


def follow(drive, controls, v=(0.5, 0.0), references=None):
    """What is followed after one step of 0.1 s of both sides' controls."""
    references = references or References(np.array([v]))
    asked = references.follow(
        drive, np.array([controls], float), LIMITS, 20, 0.005, np.full(2, drive.turn_acceleration)
    )
    return references, asked


def test_ideal_drive_references_end_where_the_rules_do():
    references, asked = follow(IDEAL, [(0.3, 0.8), (-0.3, -0.8)], v=(1.19, 0.02))
    for side, controls in enumerate([(0.3, 0.8), (-0.3, -0.8)]):
        robot = RobotState(*(jnp.float32(value) for value in (0, 0, (1.19, 0.02)[side], 0)))
        after = Unicycle().move(robot, *(jnp.float32(control) for control in controls), 0.1)
        assert references.v[0, side] == pytest.approx(float(after.v), abs=1e-6)
        assert references.turn_rate[0, side] == controls[1]
    assert asked[0, -1] == pytest.approx(wheels(1.2, 0.8) + wheels(0.0, -0.8))


def test_previous_controls_apply_during_the_latency():
    references, _ = follow(replace(IDEAL, latency=0.05), [(0.3, 0.8), (0, 0)])
    assert references.v[0, 0] == pytest.approx(0.5 + 0.3 * 0.05)
    _, asked = follow(replace(IDEAL, latency=0.05), [(-0.3, -0.8), (0, 0)], references=references)
    assert asked[0, 9, :2] == pytest.approx(wheels(0.53, 0.8))
    assert asked[0, -1, :2] == pytest.approx(wheels(0.515, -0.8))


def test_turn_rate_changes_no_faster_than_the_turn_acceleration():
    references, asked = follow(replace(IDEAL, turn_acceleration=2.0), [(0, 0.8), (0, -0.1)])
    assert references.turn_rate[0] == pytest.approx([0.2, -0.1])
    assert np.abs(np.diff(asked[0, :, 1] - asked[0, :, 0])).max() == pytest.approx(2 * 0.005 * 0.33 / 0.0975)


def test_impossible_hardware_is_refused():
    impossible = {"torque": -1.0, "latency": -0.1, "lag": inf, "wheel_mass": 4.5, "mass": 1e308, "mass_behind": 0.2}
    for name, value in impossible.items() | {(field.name, nan) for field in fields(RobotHardware)}:
        with pytest.raises(InvalidInput, match=name):
            RobotHardware(**{name: value})


def test_documents_list_every_key_of_a_drive_file():
    """With its unit, default, bounds and docstring, in the order of the fields."""
    source = Path(drive_module.__file__).read_text(encoding="utf-8")
    abouts = re.findall(r'^    (\w+): float = .*\n    """([^"]*)\.\s*"""$', source, re.MULTILINE)
    rows = []
    for field, (name, about) in zip(fields(RobotHardware), abouts, strict=True):
        assert field.name == name
        unit, (low, high) = re.search(r" \[(.*?)\]|$", about), drive_module._BOUNDS[name]
        meaning = " ".join(about.replace(unit[0], "").split())
        rows.append(f"| `{name}` | {unit[1] or ''} | {field.default:g} | {low:g} | {high:.7g} | {meaning} |")
    document = (REPOSITORY / "docs" / "reference" / "game_files.md").read_text(encoding="utf-8")
    assert [line for line in document.splitlines() if line in rows] == rows, "\n".join(rows)


pytest.importorskip("mujoco", reason="needs mujoco: pip install mujoco")
PAPER = make_game("paper")


def said_of_turtlebots():
    """The game of the guide to TurtleBots, in a hall instead of on its reader's map."""
    (code,) = (block.code for block in ALL if block.document.name == "turtlebot.md" and block.language == "toml")
    return tomllib.loads(code) | {"arena": {"x_max": 5, "y_max": 4}, "max_steps": 60}


@pytest.mark.parametrize("name", ["pioneer", "turtlebot4"])
def test_example_robots_can_be_simulated(name):
    game = from_dict(Game, said_of_turtlebots(), "the guide") if name == "turtlebot4" else replace(PAPER, max_steps=60)
    drive = load_drive(REPOSITORY / "examples" / "robots" / f"{name}.toml")
    found = simulate_match(Match.of_names(game, "intercept", "still", 4), drive)
    states, actions = found.course(0)
    v_max, gained = float(game.pursuer.v_max), len(actions) * float(game.dt * game.pursuer.u1_max)
    assert 0.8 * min(v_max, gained) < states[:, 2].max() < 1.02 * v_max
    assert np.isfinite(states).all()


HERE = np.array([[2.0, 5.0, 0.0, 0.5, 8.0, 8.0, 0.6, -2.5], [1.0, 1.0, 0.3, 3.1, 9.0, 9.0, 0.0, 0.0]])


def drive_on(physics, rows, v, turn_rate, seconds):
    """States after the pursuer was driven at a speed and turn rate, the evader being told to stand."""
    asked = np.concatenate([physics.drive.wheel_speeds(np.array(v), np.array(turn_rate)), np.zeros(2)])
    steps = round(seconds / physics.step)
    return physics.advance(physics.set_poses(rows), np.tile(asked, (len(rows), steps, 1)))


def test_measured_poses_equal_the_set_poses():
    physics = Physics(PAPER, RobotHardware())
    assert physics.measure(physics.set_poses(HERE)) == pytest.approx(HERE, abs=1e-12)


def test_robot_drives_and_turns_as_its_wheels_do():
    physics = Physics(PAPER, RobotHardware())
    driven = drive_on(physics, HERE[:1], 0.5, 0.4, 3.0)
    after = physics.measure(driven)
    x, y, v, heading = after[0, :4]
    assert v == pytest.approx(0.5, rel=0.02)
    assert heading == pytest.approx(0.5 + 1.2, rel=0.06)  # it took a while to get going
    radius = 0.5 / 0.4
    ideal = (2 + radius * (np.sin(1.7) - np.sin(0.5)), 5 - radius * (np.cos(1.7) - np.cos(0.5)))
    assert np.hypot(x - ideal[0], y - ideal[1]) < 0.1
    assert after[0, 6] == pytest.approx(0.0, abs=0.01)  # the evader's wheels were told to stand
    assert physics.turn_rates(driven)[0] == pytest.approx([0.4, 0.0], abs=0.02)


@pytest.mark.parametrize(("radius", "stops"), [(0.2, True), (0.0, False)])
def test_wall_stops_only_a_robot_with_a_radius(radius, stops):
    rows = np.array([[9.0, 5.0, 0.0, 0.0, 2.0, 5.0, 0.0, 0.0]])
    physics = Physics(replace(PAPER, pursuer=Unicycle(radius=radius)), RobotHardware())
    x = physics.measure(drive_on(physics, rows, 0.5, 0.0, 4.0))[0, 0]
    assert (x < 10 - radius + 0.02) == stops


def geoms(game, drive=None):
    root = ElementTree.fromstring(mjcf(game, drive or RobotHardware(), 0.005))
    return {geom.get("name"): geom.attrib for geom in root.iter("geom")}


def numbers(text):
    return [float(number) for number in text.split()]


def test_model_has_walls_and_obstacles_in_place():
    polygon = Polygon(((3.0, 1.0), (5.0, 1.0), (4.0, 3.0)))
    found = geoms(Game(arena=Arena(0.0, 6.0, 0.0, 4.0, discs=(Disc(1.0, 1.0, 0.3),), polygons=(polygon,))))
    obstacles = [geom for name, geom in found.items() if name.startswith("obstacle")]
    assert [geom["type"] for geom in obstacles] == ["box"] * 4 + ["cylinder"] + ["box"] * 3
    assert {numbers(geom["pos"])[2] - numbers(geom["size"])[-1] for geom in obstacles} == {0}, "they stand on the floor"
    bottom, right = obstacles[:2]
    assert numbers(bottom["pos"])[:2] == [3.0, -0.05]
    assert numbers(bottom["size"])[:2] == pytest.approx([3.05, 0.05])
    assert numbers(right["pos"])[:2] == [6.05, 2.0]
    disc = obstacles[4]
    assert numbers(disc["pos"])[:2] == [1.0, 1.0]
    assert numbers(disc["size"])[0] == 0.3
    slope = obstacles[6]  # from (5, 1) to (4, 3)
    assert numbers(slope["pos"])[:2] == [4.5, 2.0]
    assert numbers(slope["size"])[0] == pytest.approx(5**0.5 / 2)
    w, *_, z = numbers(slope["quat"])
    assert 2 * np.arctan2(z, w) == pytest.approx(np.arctan2(2, -1))


def test_robots_have_the_configured_mass_and_a_shell_if_they_have_a_radius():
    body = Unicycle(radius=0.2)
    found = geoms(replace(make_game("paper"), pursuer=body), RobotHardware(mass=12.0))
    mass = sum(float(geom.get("mass", 0)) for name, geom in found.items() if name.startswith("pursuer"))
    assert mass == pytest.approx(12.0)
    assert numbers(found["pursuer shell"]["size"])[0] == pytest.approx(0.19)
    assert "evader shell" not in found


def test_physics_refuses_games_without_physical_bodies(monkeypatch):
    capsule, car = replace(PAPER, arena=Arena(extra=(WALL,))), replace(PAPER, pursuer=Car())
    for game, drive, refusal in (
        (PAPER, RobotHardware(latency=0.2), r"latency = 0\.2"),
        (capsule, RobotHardware(), r"obstacles = Capsule .* discs, polygons and maps"),
        (car, RobotHardware(), r"pursuer.model = car .* 'unicycle': simulate"),
    ):
        with pytest.raises(InvalidInput, match=refusal):
            Physics(game, drive)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InvalidInput, match="pip install mujoco"):
        Physics(PAPER, RobotHardware())


def test_unstable_simulation_is_refused_and_leaves_no_log(monkeypatch, tmp_path):
    """MuJoCo would go on with both robots where they began."""
    monkeypatch.chdir(tmp_path)
    physics = Physics(PAPER, RobotHardware(wheel_radius=0.005, friction=10.0, torque=1e5, stiffness=1e5))
    with pytest.raises(InvalidInput, match=r"MuJoCo cannot simulate these robots \(Nan, .* torque"):
        drive_on(physics, HERE, 1.2, 0.8, 2.0)
    assert not list(tmp_path.iterdir())


GAME = replace(make_game("paper"), max_steps=40)
GAMES = 6
MATCH = a_match(GAME, Uniform(), Uniform(), GAMES)


@pytest.fixture(scope="module")
def simulation():
    return simulate_match(MATCH, RobotHardware())


def test_simulation_records_every_step_of_every_game(simulation):
    lengths = np.asarray(simulation.results.steps)
    assert np.array_equal(np.bincount(simulation.index), lengths)
    for game in range(GAMES):
        states, actions = simulation.course(game)
        assert len(states) == len(actions) + 1 == lengths[game] + 1
        assert np.array_equal(states[1:], simulation.after[simulation.index == game])
    assert np.all(np.asarray(simulation.results.outcome) != Outcome.ONGOING)


@jax.jit
@jax.vmap
def by_the_rules(row, actions):
    after = GAME.step(as_state(row, jnp.asarray(0)), actions[0], actions[1]).state
    return jnp.stack(jax.tree.leaves(after.robots), axis=-1)


def test_ideal_hardware_moves_as_the_rules_say(simulation):
    def beside_the_rules(run):
        apart = (run.after - by_the_rules(run.states, run.actions) + np.pi) % (2 * np.pi) - np.pi
        return np.sqrt(np.mean(apart**2, axis=0))

    near, far = map(beside_the_rules, (simulate_match(MATCH, IDEAL), simulation))
    assert (near[[0, 1, 2]] < [0.001, 0.001, 0.004]).all()
    assert near[3] < 0.02
    assert far[3] > 2 * near[3]


def start_of_game(*row):
    """The start of one game, and its key."""
    start = jax.tree.map(lambda leaf: leaf[None], as_state(jnp.asarray(row, jnp.float32), jnp.asarray(0)))
    return start, jax.random.key(0)


def test_driving_into_a_wall_is_a_failure_in_result_and_replay(tmp_path):
    start = start_of_game(5.0, 1.0, 0.0, 0.0, 9.8, 5.0, 1.0, 0.0)
    game = simulate(GAME, BySide(single_player(Still()), single_player(Still())), *start, RobotHardware())
    assert int(game.results.outcome[0]) == Outcome.EVADER_OUT_OF_RANGE
    assert int(game.results.steps[0]) == 3
    save_replay(record_course(game, a_match(GAME, Still(), Still(), 1), 0), tmp_path / "game.json")
    replay = load_replay(tmp_path / "game.json")
    assert replay.outcome == Outcome.EVADER_OUT_OF_RANGE
    assert replay.states[-1, 4] > 10
    assert replay.first_difference() == 1


class FullSpeedInACurve(AbstractContinuous):
    """Speeds up and turns left at half the largest rate."""

    observation = paper.PAPER

    def __call__(self, observation, memory, bits):
        return jnp.asarray([1.0, 0.5]), memory


@pytest.fixture(scope="module")
def curve():
    """The players and the start of one game, and the game without imperfections."""
    given = (
        BySide(single_player(FullSpeedInACurve()), single_player(Still())),
        *start_of_game(1.5, 5.0, 0.0, 0.0, 9.0, 9.0, 0.0, 0.0),
    )
    return given, simulate(GAME, *given, IDEAL)


def test_players_with_continuous_actions_drive_bodies(curve, tmp_path):
    states, actions = curve[1].course(0)
    assert actions.shape == (40, 2, 2)
    assert np.all(actions[:, 0] == [1.0, 0.5])
    turned = np.unwrap(states[:, 3])
    assert turned[-1] - turned[0] == pytest.approx(0.4 * 4.0, rel=0.02)
    assert states[-1, 2] == pytest.approx(1.2, rel=0.01)
    save_replay(record_course(curve[1], a_match(GAME, FullSpeedInACurve(), Still(), 1), 0), tmp_path / "game.json")
    assert load_replay(tmp_path / "game.json").actions.dtype == np.float32


def test_compare_physics_gives_rates_and_their_difference(simulation):
    found = compare_physics(MATCH, play_games(MATCH), simulation)
    assert found.rules.games == found.bodies.games == GAMES
    timeouts = np.asarray(simulation.results.outcome) == Outcome.NO_RESULT
    rate = found.differences["no result"]
    assert rate.bodies == timeouts.mean()
    assert rate.difference == pytest.approx(rate.bodies - rate.rules)
    assert rate.interval[0] <= rate.difference <= rate.interval[1]


def test_simulated_teams_play_on_without_inactive_robots():
    match = Match.of_names(replace(find_game("team-2v1"), max_steps=150), "pure-pursuit", "flee", games=2)
    found = simulate_match(match, RobotHardware())
    assert found.states.shape[1] == 12
    assert found.actions.shape[1] == 3
    for index in range(2):
        replay = record_course(found, match, index)
        in_play, out = replay.in_play(), ~replay.in_play()[:, 0]
        status = [np.asarray(one)[index] for side in found.results.status for one in side]
        assert in_play[-1].tolist() == [one == RobotStatus.ACTIVE for one in status]
        braked = replay.states[out, 2][1:]
        assert len(braked) > 4
        assert braked[-1] - braked[0] == pytest.approx(-0.3 * 0.1 * (len(braked) - 1), abs=0.01)


def test_map_blocks_cover_exactly_the_occupied_cells():
    cells = np.zeros((6, 9), bool)
    cells[1:4, 2:5], cells[3, 7] = True, True
    floor = OccupancyMap(jnp.asarray(distance_field(cells, 2.0)), -1.0, 2.0, 2.0, "", "")
    found = geoms(Game(arena=Arena(-1.0, 17.0, 2.0, 14.0, map=floor))).items()
    blocks = [(numbers(geom["pos"]), numbers(geom["size"])) for name, geom in found if name.startswith("obstacle")][4:]
    covered = np.zeros(cells.shape, int)
    for (x, y, _), (half_x, half_y, _) in blocks:
        ends = (y - half_y - 2) / 2, (y + half_y - 2) / 2, (x - half_x + 1) / 2, (x + half_x + 1) / 2
        bottom, top, left, right = map(round, ends)
        assert (bottom, top, left, right) == pytest.approx(ends)
        covered[bottom:top, left:right] += 1
    assert np.array_equal(covered, cells)
    assert len(blocks) == 2


def test_sensors_and_drives_of_the_game_apply_to_bodies(curve):
    (players, *start), quick = curve[0], curve[1].course(0)[0]
    slow = replace(GAME, drives=Drives(Slow(lag=5.0, turn_time=2.0), None))
    late = simulate(slow, players, *start, IDEAL).course(0)[0]
    assert late[5, 2] == pytest.approx(0, abs=0.005)
    assert quick[5, 2] == pytest.approx(0.15, abs=0.01)
    assert late[-1, 2] == pytest.approx(quick[-6, 2], abs=0.01)
    turned = np.diff(late[:, 3])
    assert turned[6] == pytest.approx(0.4 * 0.1 * 0.1 * 1.5, rel=0.2)  # 0.4 rad/s^2 in its second step
    blind = replace(GAME, sensors=Sensing(Sensors(range=0.0), None))
    seen = simulate(blind, players, *start, IDEAL).results.sightings
    assert int(seen.pursuer.first[0]) == -1
    assert seen.evader is None


class Careful(AbstractPolicy):
    """Turns left until it will do so at half its rate, if it knows its turn time; else stays."""

    def __call__(self, seen, memory, bits):
        own = seen.own
        told = jnp.isclose(own.turn_time, 0.4)
        return jnp.where(told & (own.turn_rate < 0.4), 5, 4).astype(jnp.int32), memory


def test_players_know_their_drive_and_turn_rate(curve):
    _, *start = curve[0]
    drive = replace(IDEAL, latency=0.04, lag=0.06, turn_acceleration=2.0)
    actions = simulate(GAME, BySide(single_player(Careful()), single_player(Still())), *start, drive).course(0)[1][:, 0]
    assert actions[:3].tolist() == [5, 5, 4], "0.12 rad/s after one step, 0.2 more by the command on its way"
    assert set(actions[3:]) == {4, 5}, "it turns on whenever it would not turn"
    ice = replace(drive, friction=1e-3)
    assert set(
        simulate(GAME, BySide(single_player(Careful()), single_player(Still())), *start, ice).course(0)[1][:, 0]
    ) == {5}
