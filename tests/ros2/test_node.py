"""The ROS 2 package: its decisions without ROS, the node with stand-ins for ROS, and its launch file with some, too."""

import cmath
import importlib
import itertools
import json
import math
import os
import subprocess
import sys
from copy import deepcopy
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar
from unittest.mock import MagicMock
from xml.etree import ElementTree

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import yaml

from apollonius.arenas.file import find_game
from apollonius.export.player import find_exportable
from apollonius.export.writing import write_c
from apollonius.game.models import MODELS
from apollonius.game.types import Role
from apollonius.io.record import write_record
from tests.acting import robot as robot_at
from tests.jaxpr2c.gcc import needs_gcc

PACKAGE = Path(__file__).parents[2] / "ros2" / "apollonius_ros"
OWN, OPPONENT, MATE = (2.0, 3.0, 0.5, 0.1), (7.0, 6.0, 0.0, -1.5), (2.0, 4.0, 0.5, 0.1)
BODY = {"model": "unicycle", "v_min": 0.0, "v_max": 1.2}
FACTS = {
    "player": "pursuer", "mates": 0, "opponents": 1, "dt": 0.1, "max_steps": 100, "body": BODY, "u1_max": 0.3,
    "u2_max": 0.8, "fastest": 1.5, "game": {"arena": {"x_min": 0.0, "x_max": 10.0, "y_min": -1.0, "y_max": 8.0}},
}  # fmt: skip


@pytest.fixture(autouse=True)
def package(monkeypatch):
    monkeypatch.syspath_prepend(PACKAGE)
    yield
    for name in [name for name in sys.modules if name.startswith("apollonius_ros")]:
        del sys.modules[name]


class Player:
    """An export that wants to go faster and left."""

    def __init__(self, *_):
        self.facts, self.text, self.asked, self.begun = deepcopy(FACTS), json.dumps(FACTS), [], 0

    def begin(self):
        self.begun += 1

    def decide(self, states, active, bits):
        self.asked.append((list(states), list(active)))
        return [8], [0.3, 0.8]


@pytest.mark.parametrize("name", ["unicycle", "car", "wheels"])
def test_node_turns_and_speeds_up_as_the_rules_do(name):
    """The node has no Apollonius to ask."""
    module, body = importlib.import_module("apollonius_ros.pilot"), MODELS[name](v_min=-0.5)
    facts = {"model": name} | write_record(body, {})
    for v in (-0.49, -0.02, 0.0, 0.02, 0.6, 1.19):
        for u1 in (-0.3, 0.0, 0.3):
            speed = module.next_speed(facts, v, u1 * 0.1)
            after = body.move(robot_at(0, 0, v), jnp.float32(u1), jnp.float32(0), 0.1)
            assert speed == pytest.approx(float(after.v), abs=1e-6)
            for u2 in (-body.u2_max, 0.0, body.u2_max / 2):
                rate = float(body.turn_rate(jnp.float32(u2), jnp.float32(speed)))
                assert module.turn_rate(facts, u2, speed) == pytest.approx(rate, abs=1e-6)


def test_node_of_a_robot_that_reverses_brakes_in_both_directions(pilot):
    pilot.player.facts["body"] = {"model": "unicycle", "v_min": -0.6, "v_max": 1.2}
    pilot.stopped = True
    for speed, after in ((0.5, 0.47), (0.02, 0.0), (0.0, 0.0), (-0.02, 0.0), (-0.5, -0.47)):
        pilot.speed = speed
        assert pilot.command(10.1).speed == pytest.approx(after)
    pilot.stopped, pilot.speed = False, -0.5
    own = pilot.robots[0]
    own.state = (2.0, 3.0, -0.4, 0.1)
    assert pilot.command(10.1).speed == pytest.approx(-0.47), "within the lead of what is measured"
    assert pilot.doubt == ""


def test_node_refuses_robots_whose_course_it_cannot_know():
    module, player = importlib.import_module("apollonius_ros.pilot"), Player()
    player.facts["body"] = {"model": "omni"}
    with pytest.raises(ValueError, match="model: omni"):
        module.Pilot(player, [])


@pytest.fixture
def pilot():
    """One that has seen both robots at 10 s, and drives at 0.5 m/s."""
    module = importlib.import_module("apollonius_ros.pilot")
    own, opponent = (module.Robot(name, state, 10.0) for name, state in (("own", OWN), ("opponent", OPPONENT)))
    return module.Pilot(Player(), [own, opponent], speed=0.5)


def test_commands_follow_the_player_within_limits_and_near_measured_speed(pilot):
    made = pilot.command(10.1)
    assert (made.speed, made.turn_rate, made.trouble, made.step) == (pytest.approx(0.53), 0.8, "", 0)
    assert pilot.player.asked == [([OWN, OPPONENT], [True, True])]
    assert (made.states, made.action, made.controls) == ([OWN, OPPONENT], [8], [0.3, 0.8])
    assert 0 <= made.bits < 2**32
    assert max(pilot.command(10.0).speed for _ in range(20)) == pytest.approx(0.5 + 0.2 + 0.03)
    pilot.robots[0].state = (2.0, 3.0, 1.2, 0.1)
    assert [pilot.command(10.0).speed for _ in range(40)][-1] == pytest.approx(1.2)


def test_player_with_sensors_gets_an_unseen_opponent_far_away(pilot):
    pilot.player.facts["game"] |= {"sensors": {"pursuer": {"range": 5.0}}}
    assert not pilot.command(10.1).trouble
    for hidden in ({"seen": 9.6}, {"state": None, "seen": -math.inf}):
        other(**hidden)(pilot)
        made = pilot.command(10.1)
        assert (made.trouble, made.controls) == ("", [0.3, 0.8])
        assert pilot.player.asked[-1] == ([OWN, (1e9,) * 4], [True, True])
    own(seen=9.6)(pilot)
    assert "own: seen" in pilot.command(10.1).trouble


def answer(*controls):
    return lambda pilot: setattr(pilot.player, "decide", lambda states, active, bits: ([4], controls))


def robot(place, **changes):
    return lambda pilot: vars(pilot.robots[place]).update(changes)


own, other = partial(robot, 0), partial(robot, 1)
TROUBLES = {
    "own never seen": own(state=None),
    "opponent never seen": other(state=None),
    "own late": own(seen=9.6),
    "opponent late": other(seen=9.6),
    "a clock ahead": other(seen=10.5),
    "a stamp that is none": own(seen=math.nan),
    "own NaN": own(state=(2.0, math.nan, 0.5, 0.1)),
    "opponent infinite": other(state=(math.inf, 6.0, 0.0, 0.0)),
    "a state of no numbers": own(state=(None,) * 4),
    "a state too short": own(state=(2.0, 3.0, 0.5)),
    "a heading of no angle": other(state=(7.0, 6.0, 0.0, 1e300)),
    "own left of the arena": own(state=(-0.51, 3.0, 0.5, 0.1)),
    "own right of the arena": own(state=(10.51, 3.0, 0.5, 0.1)),
    "opponent below the arena": other(state=(7.0, -1.51, 0.0, 0.0)),
    "opponent above the arena": other(state=(7.0, 8.51, 0.0, 0.0)),
    "own faster than any": own(state=(2.0, 3.0, 3.01, 0.1)),
    "opponent faster than any": other(state=(7.0, 6.0, -3.01, 0.1)),
    "one topic for two robots": other(state=OWN),
    "own out of play": own(in_play=False),
    "no opponent left": other(in_play=False),
    "a silent referee": lambda pilot: vars(pilot).update(refereed=True),
    "a referee who fell silent": lambda pilot: (vars(pilot).update(refereed=True), own(judged=9.6)(pilot)),
    "a player that raises": lambda pilot: setattr(pilot.player, "decide", lambda *_: 1 / 0),
    "a player that says NaN": answer(math.nan, 0.0),
    "a player that says too much": answer(0.0, 3.0),
    "a player that speeds too much": answer(-0.4, 0.0),
    "a player that says nothing": lambda pilot: setattr(pilot.player, "decide", lambda *_: None),
    "the end": lambda pilot: vars(pilot).update(stopped=True),
    "no time left": lambda pilot: vars(pilot).update(step=100),
}


@pytest.mark.parametrize("trouble", TROUBLES)
def test_pilot_brakes_to_rest_in_trouble_and_resumes_afterwards(pilot, trouble):
    decide = pilot.player.decide
    TROUBLES[trouble](pilot)
    commands = [pilot.command(10.05) for _ in range(20)]
    assert commands[0].speed == pytest.approx(0.47)
    assert all(after.speed <= max(before.speed - 0.0299, 0) for before, after in itertools.pairwise(commands))
    assert commands[-1].speed == 0
    assert {command.turn_rate for command in commands} == {0}
    assert all(command.trouble for command in commands)

    pilot.player.decide = decide
    vars(pilot).update(refereed=False, stopped=False, step=0)
    own(state=OWN, seen=12.0, in_play=True)(pilot)
    other(state=OPPONENT, seen=12.0, in_play=True)(pilot)
    again = pilot.command(12.1)
    assert (again.speed, again.turn_rate, again.trouble) == (pytest.approx(0.03), 0.8, "")


@pytest.mark.parametrize("state", [(-0.49, -1.49, 2.99, 6.0), (10.49, 8.49, -2.99, -6.0)], ids=str)
@pytest.mark.parametrize("place", [0, 1], ids=["own", "opponent"])
def test_pilot_tolerates_small_errors_of_position_and_speed(pilot, place, state):
    pilot.robots[place].state = state
    assert pilot.command(10.0).trouble == ""


def test_pilot_gives_the_reason_for_braking(pilot):
    other(state=OWN)(pilot)
    assert pilot.command(10.0).trouble.startswith("own, opponent: one place")
    other(state=(7.0, 6.0, 0.0, math.nan))(pilot)
    assert pilot.command(10.0).trouble.startswith("opponent: orientation not a quaternion")
    other(state=(7.0, 9.0, 0.0, 0.0))(pilot)
    assert pilot.command(10.0).trouble.startswith("opponent: at 7, 9 m, outside the arena")
    own(state=(2.0, 3.0, 7.0, 0.0))(pilot)
    assert pilot.command(10.0).trouble.startswith("own: at 7 m/s, and none is faster than 1.5 m/s")


def test_overtaken_state_is_ignored_unless_the_clock_went_back(pilot):
    robot, newer = pilot.robots[1], (7.1, 6.0, 0.0, 0.0)
    robot.see(newer, 10.1, now=10.15)
    robot.see(OPPONENT, 10.05, now=10.2)
    assert (robot.state, robot.seen) == (newer, 10.1)
    robot.see(OPPONENT, 10.2, now=10.25)
    assert (robot.state, robot.seen) == (OPPONENT, 10.2)
    robot.see(newer, 0.1, now=0.2)
    assert (robot.state, robot.seen) == (newer, 0.1)


DOUBTS = [
    (0, 0.23, 0.0, 0.0, "own: poses differ from its own frame's twist by 0.1"),
    (1, 0.23j, 0.23, 0.0, "opponent: poses differ"),
    (0, -0.4, 0.4, 0.0, "own: poses differ"),
    (0, -0.11, -0.11, 0.0, "own: at -0.11 m/s, though it cannot reverse"),
    (1, -0.11, -0.11, 0.0, ""),
    (1, 0.3j, 0.3, math.pi / 2, ""),
    (0, 0.0, -0.09, 0.0, ""),
    (0, 0.5, 0.45, 0.0, ""),
    (0, 1.2, 1.4, 0.0, ""),
]


@pytest.mark.parametrize(("place", "velocity", "speed", "heading", "doubt"), DOUBTS)
def test_twist_that_contradicts_the_poses_is_reported_and_noise_is_not(pilot, place, velocity, speed, heading, doubt):
    rng, robot, way = np.random.default_rng(0), pilot.robots[place], 5 + 1j
    pilot.robots[1 - place].state = (7.0, 6.0, 0.0, 0.0)
    for now in np.arange(10.0, 13.0, 0.1):
        way += 0.1 * velocity
        seen = way + rng.normal(size=2) @ (0.05, 0.05j)
        robot.see((seen.real, seen.imag, speed, heading), now, now)
        pilot.robots[1 - place].seen = now
        assert pilot.command(now).trouble == ""
        assert doubt or not pilot.doubt
    assert pilot.doubt.startswith(doubt)


def test_game_begins_with_the_referee_and_ends_at_its_time_limit(pilot):
    pilot.refereed, pilot.player.facts["max_steps"] = True, 3
    own(judged=10.0)(pilot)
    other(judged=10.0)(pilot)
    assert [pilot.command(10.0).trouble for _ in range(4)] == ["", "", "", "the game's time is up"]
    assert pilot.player.begun == 1
    own(in_play=False)(pilot)
    assert pilot.command(10.0).trouble == "own: not in play"
    own(in_play=True)(pilot)
    assert pilot.command(10.0).step == 0
    assert pilot.player.begun == 2


def test_inactive_teammates_and_opponents_need_not_be_seen(pilot):
    kind = type(pilot.robots[0])
    pilot.player.facts |= {"mates": 1, "opponents": 2}
    mate, gone = kind("mate", MATE, 10.0), kind("gone", None, in_play=False)
    pilot.robots = [pilot.robots[0], mate, pilot.robots[1], gone]
    assert pilot.command(10.0).trouble == ""
    assert pilot.player.asked == [([OWN, MATE, OPPONENT, (0.0,) * 4], [True, True, True, False])]
    gone.state = (math.nan,) * 4
    assert pilot.command(10.0).states[3] == (0.0,) * 4
    mate.seen = 9.0
    assert pilot.command(10.0).trouble == "mate: seen 1.00 s ago"


def compile_export(name, game, folder):
    player = find_exportable(name, Role.PURSUER, find_game(game))
    write_c(player, folder / "robot.c", states=100)
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", "robot.c", "-lm", "-o", "robot.so"], cwd=folder, check=True)
    return importlib.import_module("apollonius_ros.export").Export(folder / "robot.robot.json"), player


SLOW = [("searching:intercept", "office"), ("shielded:intercept", "team-3v2")]


@needs_gcc
@pytest.mark.parametrize(
    ("name", "game"),
    [("P_smooth", "paper"), ("random", "lidar"), *[pytest.param(*both, marks=pytest.mark.slow) for both in SLOW]],
)
def test_compiled_export_decides_as_the_package_over_successive_calls(name, game, tmp_path):
    export, player = compile_export(name, game, tmp_path)
    facts, body = export.facts, player.game.pursuer
    assert (facts["dt"], facts["max_steps"], facts["body"]["v_max"]) == (
        player.game.dt,
        player.game.max_steps,
        body.v_max,
    )
    assert facts["fastest"] == max(
        abs(v) for side in player.game.bodies for one in side for v in (one.v_min, one.v_max)
    )
    assert (facts["u1_max"], facts["u2_max"]) == (body.u1_max, body.u2_max)
    assert 1 + facts["mates"] + facts["opponents"] == player.robots
    rng = np.random.default_rng(0)
    decide, memory = jax.jit(player.decide), player.memory
    for step in range(20):
        states = rng.uniform(1, 4, (player.robots, 4)).astype(np.float32)
        active = [step % 3 > 0 or place == 0 for place in range(player.robots)]
        export.begin() if step == 10 else None
        memory = player.memory if step == 10 else memory
        action, controls = export.decide(states.tolist(), active, 7 * step)
        given = np.array(active) if player.robots > 2 else None
        made = decide(player.policy, player.game, states, given, None, memory, np.uint32(7 * step))
        memory = made["memory"]
        assert controls == pytest.approx(np.asarray(made["controls"]).tolist(), abs=1e-5)
        assert action == pytest.approx(np.ravel(made["action"]).tolist(), abs=1e-5)
    assert export.decide([[math.nan] * 4] * player.robots, [True] * player.robots, 0)[1] == pytest.approx((-0.3, 0.0))


@needs_gcc
def test_mismatched_export_files_are_refused(tmp_path):
    export, _ = compile_export("random", "paper", tmp_path)
    content = (tmp_path / "robot.game").read_bytes()
    (tmp_path / "robot.game").write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    with pytest.raises(ValueError, match=r"robot\.game: not as it was exported"):
        type(export)(tmp_path / "robot.robot.json")
    (tmp_path / "robot.game").write_bytes(content)
    about, text = tmp_path / "robot.robot.json", (tmp_path / "robot.robot.json").read_text()
    about.write_text(json.dumps(json.loads(text) | {"game": {"movers": {"walkers": [{"count": 3}]}}}))
    with pytest.raises(ValueError, match=r"robot\.robot\.json: of a game with movers"):
        type(export)(about)
    about.write_text(text)
    os.utime(tmp_path / "robot.so", (0, 0))
    with pytest.raises(ValueError, match=r"robot\.so: missing, or older than its source; give gcc .* -o .*robot\.so"):
        type(export)(tmp_path / "robot.robot.json")


ROS = ("clock", "executors", "qos", "serialization", "signals", "time")
"""Modules of `rclpy` that the package imports, besides `node`."""


class Node:
    """What the node uses of `rclpy.node.Node`: calls are recorded."""

    given: ClassVar[dict] = {}

    def __init__(self, name, automatically_declare_parameters_from_overrides):
        self.asked = MagicMock()

    def __getattr__(self, name):
        return getattr(self.asked, name)

    def get_parameters_by_prefix(self, prefix):
        return {name: SimpleNamespace(value=value) for name, value in self.given.items()}


def parameters(name):
    """The parameters that ROS gives to the node of a name: those of all and its own."""
    sections = yaml.safe_load((PACKAGE / "config" / "params.yaml").read_text())
    return sections["/**"]["ros__parameters"] | sections[name]["ros__parameters"]


@pytest.fixture
def stubs(monkeypatch):
    """Put stand-ins for ROS where they are imported from."""
    kinds = {
        one: type(one, (), {"__new__": lambda cls, **values: MagicMock(**values), "WARN": b"\1", "OK": b"\0"})
        for one in ("Twist", "TwistStamped", "String", "Bool", "Odometry", "DiagnosticArray", "DiagnosticStatus")
    }
    packages = ["diagnostic_msgs", "geometry_msgs", "nav_msgs", "std_msgs"]
    modules = dict.fromkeys(["rclpy", *(f"rclpy.{part}" for part in ROS), *packages], MagicMock())
    modules |= {f"{name}.msg": SimpleNamespace(**kinds, KeyValue=MagicMock) for name in packages}
    for name, module in (modules | {"rclpy.node": SimpleNamespace(Node=Node)}).items():
        monkeypatch.setitem(sys.modules, name, module)


@pytest.fixture
def made_node(stubs, monkeypatch):
    """Make the package's node with parameters."""
    module = importlib.import_module("apollonius_ros.node")
    monkeypatch.setattr(module, "Export", Player)

    def make(**given):
        monkeypatch.setattr(Node, "given", parameters("pursuer") | {"dry_run": False, "bags": ""} | given)
        node = module.PursuitNode()
        publishers = [one.args[1] for one in node.asked.create_publisher.mock_calls]
        return node, publishers

    return make


def odometry(x, y, v, heading, stamp, frame="map"):
    """A message whose orientation is a rotation about the vertical."""
    fields = {
        "header.stamp.sec": int(stamp), "header.stamp.nanosec": round(stamp % 1 * 1e9), "header.frame_id": frame,
        "pose.pose.position.x": x, "pose.pose.position.y": y, "twist.twist.linear.x": v,
        "pose.pose.orientation.w": math.cos(heading / 2), "pose.pose.orientation.x": 0.0,
        "pose.pose.orientation.y": 0.0, "pose.pose.orientation.z": math.sin(heading / 2),
    }  # fmt: skip
    return MagicMock(**fields)


def listeners(node):
    return {topic: listener for _, topic, listener, _ in (one.args for one in node.create_subscription.mock_calls)}


def test_node_drives_at_ten_hertz_and_brakes_without_odometry(made_node):
    node, publishers = made_node()
    (seconds, tick), (second, diagnose) = (one.args for one in node.asked.create_timer.call_args_list)
    assert (seconds, second) == (0.1, 1.0)
    heard = listeners(node)
    assert set(heard) == {"robot1/odom", "robot2/odom"}
    assert publishers == ["robot1/cmd_vel", "~/decisions", "/diagnostics"]
    clock, warning = node.get_clock().now(), node.get_logger().warning
    clock.nanoseconds = 5_500_000_000
    tick()
    assert warning.call_args.args == ("braking; robot1: never seen",)
    heard["robot1/odom"](odometry(*OWN, stamp=5.5))
    heard["robot2/odom"](odometry(*OPPONENT, stamp=5.4))
    assert node.pilot.robots[1].state == pytest.approx(OPPONENT)
    tick()
    diagnose()
    clock.nanoseconds = 6_000_000_000
    tick()
    diagnose()
    assert warning.call_count == 2
    sent = [one.args[0] for one in node.asked.create_publisher().publish.mock_calls]
    driven = [(one.linear.x, one.angular.z) for one in sent if isinstance(one.linear.x, float)]
    assert driven == [(0, 0), (pytest.approx(0.03), 0.8), (0, 0)]
    decisions = [json.loads(one.data) for one in sent if isinstance(one.data, str)]
    assert [one["trouble"] for one in decisions] == ["robot1: never seen", "", "robot1: seen 0.50 s ago"]
    assert decisions[1]["states"] == [pytest.approx(OWN), pytest.approx(OPPONENT)]
    assert decisions[1]["ages"] == [0.0, pytest.approx(0.1)]
    playing, braking = (one.status[0] for one in sent if isinstance(one.status, list))
    assert (playing.level, playing.message) == (b"\0", "playing")
    assert (braking.level, braking.message) == (b"\1", "braking; robot1: seen 0.50 s ago")
    assert {one.key: one.value for one in playing.values}["age of robot2 [s]"] == "0.10"


def test_odometry_in_another_frame_is_ignored(made_node):
    node, _ = made_node(frame="floor")
    listeners(node)["robot1/odom"](odometry(*OWN, stamp=5.5))
    assert node.pilot.robots[0].state is None
    assert "frame 'map' instead of 'floor'" in node.get_logger().warning.call_args.args[0]


SOUND = 0.0, 0.0, math.sin(0.6), math.cos(0.6)
"""A quaternion (x, y, z, w) of a heading of 1.2 rad."""


@pytest.mark.parametrize(
    ("orientation", "heading"),
    [
        (SOUND, 1.2),
        ([-number for number in SOUND], 1.2),
        ([1.004 * number for number in SOUND], 1.2),
        ([0.996 * number for number in SOUND], 1.2),
        ((0.1, 0.0, 0.0, 0.995), 0.0),
        ([1.006 * number for number in SOUND], None),
        ([0.994 * number for number in SOUND], None),
        ([2 * number for number in SOUND], None),
        ([number / 2 for number in SOUND], None),
        ((0.0, 0.0, 0.0, 0.0), None),
        ((0.0, 0.0, math.inf, 1.0), None),
        ((0.0, 0.0, 0.0, math.nan), None),
        ((0.0, 0.0, 1e200, 0.0), None),
        ((1.0, 0.0, 0.0, 0.0), None),
        ((0.0, 0.5, 0.0, 0.866), None),
    ],
    ids=str,
)
def test_node_brakes_on_an_invalid_orientation(made_node, orientation, heading):
    node, _ = made_node()
    node.get_clock().now().nanoseconds = 5_500_000_000
    message = odometry(*OWN, stamp=5.5)
    for name, number in zip("xyzw", orientation, strict=True):
        setattr(message.pose.pose.orientation, name, number)
    listeners(node)["robot1/odom"](message)
    listeners(node)["robot2/odom"](odometry(*OPPONENT, stamp=5.5))
    node.tick()
    if heading is None:
        assert node.last.trouble.startswith("robot1: orientation not a quaternion")
    else:
        assert node.last.states[0][3] == pytest.approx(heading)


def test_overtaken_message_is_ignored_and_a_doubt_is_diagnosed(made_node):
    node, _ = made_node()
    clock, heard = node.get_clock().now(), listeners(node)
    for number in range(20):
        clock.nanoseconds = 5_500_000_000 + 100_000_000 * number
        heard["robot2/odom"](odometry(*OPPONENT, stamp=5.5 + 0.1 * number))
        heard["robot1/odom"](odometry(2.0 + 0.1 * number, 3.0, 0.0, 0.0, stamp=5.5 + 0.1 * number))
        heard["robot1/odom"](odometry(*OPPONENT, stamp=5.4))
        node.tick()
        assert node.last.trouble == ""
    node.diagnose()
    (status,) = node.asked.create_publisher().publish.mock_calls[-1].args[0].status
    assert (status.level, status.message[:20]) == (b"\1", "robot1: poses differ")


@pytest.fixture
def bridge(stubs, monkeypatch):
    """A bridge, and the transform that its localiser sends: 2 m to the right, 1 m down, turned by 0.7 rad, at 5.0 s."""
    turn = {"rotation.z": math.sin(0.35), "rotation.w": math.cos(0.35)}
    shift = {"translation.x": 2.0, "translation.y": -1.0}
    transform = MagicMock(**{f"transform.{name}": value for name, value in (turn | shift).items()})
    transform.header.stamp.sec, transform.header.stamp.nanosec = 5, 0
    gone = type("TransformException", (Exception,), {})
    buffer = MagicMock(**{"return_value.lookup_transform": MagicMock(return_value=transform)})
    tf2 = SimpleNamespace(Buffer=buffer, TransformException=gone, TransformListener=MagicMock())
    monkeypatch.setitem(sys.modules, "tf2_ros", tf2)
    monkeypatch.setattr(Node, "given", {})
    return importlib.import_module("apollonius_ros.bridge").Bridge(), buffer().lookup_transform, gone


def cross_bridge(bridge, message):
    """The messages that come out of the bridge after one that goes in."""
    published = bridge.asked.create_publisher().publish
    before = published.call_count
    listeners(bridge)["odom"](message)
    return [one.args[0] for one in published.mock_calls[before:]]


@pytest.mark.parametrize("heading", [0.0, 1.2, -3.0])
def test_bridge_transforms_odometry_to_the_map(bridge, made_node, heading):
    node, lookup, _ = bridge
    assert [one.args[1] for one in node.asked.create_publisher.mock_calls] == ["map_odom"]
    message = odometry(3.0, 1.0, 0.25, heading, stamp=5.4, frame="odom")
    place, facing = message.pose.pose.position, message.pose.pose.orientation
    z, w = facing.z, facing.w
    tilt = 0.1  # about the robot's own axis ahead, after its heading
    facing.x, facing.y = w * math.sin(tilt), z * math.sin(tilt)
    facing.z, facing.w = z * math.cos(tilt), w * math.cos(tilt)
    (out,) = cross_bridge(node, message)
    assert lookup.call_args.args[:2] == ("map", "odom")
    assert out.header.frame_id == "map"
    assert complex(place.x, place.y) == pytest.approx(2 - 1j + (3 + 1j) * cmath.exp(0.7j))
    assert (out.header.stamp.sec, out.twist.twist.linear.x) == (5, 0.25)
    state = sys.modules["apollonius_ros.node"].state_of(out)
    assert cmath.exp(1j * state[3]) == pytest.approx(cmath.exp(1j * (heading + 0.7)))
    assert facing.x**2 + facing.y**2 == pytest.approx(math.sin(tilt) ** 2), "still as tilted"


def test_bridge_is_silent_without_a_recent_transform(bridge):
    node, lookup, gone = bridge
    warning = node.get_logger().warning
    stamp = lookup.return_value.header.stamp
    for since, now, passes in ((5, 6.0, True), (5, 6.1, False), (5, 4.5, True), (0, 100.0, True)):
        stamp.sec = since
        assert len(cross_bridge(node, odometry(3.0, 1.0, 0.25, 0.0, stamp=now, frame="odom"))) == passes
    assert warning.call_args.args[0].startswith("the transform from 'map' is 1.1 s older than the odometry")
    lookup.side_effect = gone("no such frame")
    assert cross_bridge(node, odometry(3.0, 1.0, 0.25, 0.0, stamp=5.1, frame="odom")) == []
    assert warning.call_args.args[0].startswith("no transform from 'map' to 'odom': no such frame")


@pytest.mark.parametrize("name", ["node", "bridge"])
def test_missing_ros_is_reported_in_one_line(name):
    program = f"import runpy, sys; sys.modules['rclpy'] = None; runpy.run_module('apollonius_ros.{name}')"
    environment = os.environ | {"PYTHONPATH": str(PACKAGE)}
    command = [sys.executable, "-c", program]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert ended.returncode == 2
    assert ended.stderr.startswith("apollonius_ros: ")
    assert "install ROS 2, and give first: source /opt/ros/" in ended.stderr
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize("simulated", [True, False])
def test_timers_use_a_steady_clock_except_in_simulation(made_node, monkeypatch, simulated):
    clock, kinds = SimpleNamespace(ros_time_is_active=simulated), sys.modules["rclpy.clock"]
    monkeypatch.setattr(Node, "get_clock", lambda node: clock, raising=False)
    node, _ = made_node()
    steady = kinds.Clock(clock_type=kinds.ClockType.STEADY_TIME)
    clocks = [one.kwargs["clock"] for one in node.asked.create_timer.call_args_list]
    assert clocks == [clock if simulated else steady] * 2


def test_dry_run_publishes_no_commands_and_logs_them(made_node):
    node, publishers = made_node(dry_run=True)
    assert publishers == ["~/decisions", "/diagnostics"]
    node.get_clock().now().nanoseconds = 5_500_000_000
    for name, state in (("robot1", OWN), ("robot2", OPPONENT)):
        listeners(node)[f"{name}/odom"](odometry(*state, stamp=5.5))
    node.tick()
    assert node.get_logger().info.call_args.args == ("would drive 0.03 m/s, 0.80 rad/s",)


def test_referee_has_a_topic_for_each_robot(made_node):
    node, _ = made_node(in_play="in_play")
    node.get_clock().now().nanoseconds = 5_500_000_000
    listeners(node)["robot2/in_play"](SimpleNamespace(data=False))
    assert not node.pilot.robots[1].in_play
    assert node.pilot.robots[1].judged == 5.5
    assert node.pilot.command(5.5).trouble.startswith("robot1: no word of a referee")


def test_robots_other_than_those_of_the_export_are_refused(made_node):
    with pytest.raises(ValueError, match=r"opponents: \['robot2', 'robot3'\], but the export is for 1"):
        made_node(opponents=["robot2", "robot3"])
    with pytest.raises(ValueError, match=r"robot1, robot1; name each robot once"):
        made_node(opponents=["robot1"])


def test_launch_file_passes_the_parameters_of_both_nodes(made_node):
    assert set(parameters("pursuer")) == set(parameters("evader"))
    node, _ = made_node(**parameters("evader") | {"bags": ""})
    assert node.given["own"] == "robot2"
    launch = ElementTree.parse(PACKAGE / "launch" / "pursuit.launch.xml").getroot()
    started, defaults = launch.find("node"), {one.get("name"): one.get("default") for one in launch.findall("arg")}
    assert (started.get("pkg"), started.get("exec"), started.get("name")) == ("apollonius_ros", "play", "$(var name)")
    assert started.find("param").get("from") == "$(var params)"
    assert (PACKAGE / defaults["params"].removeprefix("$(find-pkg-share apollonius_ros)/")).is_file()
    assert parameters(defaults["name"])
