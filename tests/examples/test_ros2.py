"""The ROS 2 template: its decisions without ROS, and the node with stand-ins for ROS."""

import importlib.util
import itertools
import math
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from apollonius.export.player import find_exportable
from apollonius.export.writing import write_onnx
from apollonius.game.presets import make_game
from apollonius.game.types import Role

FOLDER = Path(__file__).parents[2] / "examples" / "ros2"
OWN, OPPONENT = (2.0, 3.0, 0.5, 0.1), (7.0, 6.0, 0.0, -1.5)


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def pilot_module(monkeypatch):
    monkeypatch.delitem(sys.modules, "pilot", raising=False)
    yield load("pilot")
    sys.modules.pop("pilot", None)


@pytest.fixture
def pilot(pilot_module):
    """One that has seen both robots at 10 s, drives at 0.5 m/s, and wants to go faster and left."""
    asked = []

    def decide(state):
        asked.append(list(state))
        return 8, 0.3, 0.8

    pilot = pilot_module.Pilot(decide, pilot_module.Limits())
    pilot.asked = asked
    pilot.saw("own", OWN, 10.0)
    pilot.saw("opponent", OPPONENT, 10.0)
    pilot.speed = 0.5
    return pilot


def test_it_does_as_the_policy_says(pilot):
    command = pilot.command(10.1)
    assert (command.speed, command.turn_rate, command.trouble) == (pytest.approx(0.53), 0.8, "")
    assert pilot.asked == [[*OWN, *OPPONENT]]


def test_the_speed_stays_within_its_limits_and_near_the_measured_one(pilot):
    speeds = [pilot.command(10.0).speed for _ in range(20)]
    assert max(speeds) == pytest.approx(0.5 + 0.2 + 0.03)
    pilot.saw("own", (2.0, 3.0, 1.2, 0.1), 10.0)
    assert [pilot.command(10.0).speed for _ in range(40)][-1] == pytest.approx(1.2)


def test_it_does_as_a_continuous_policy_says(pilot):
    pilot.decide = lambda state: (-0.15, 0.25)
    command = pilot.command(10.1)
    assert (command.speed, command.turn_rate, command.trouble) == (pytest.approx(0.485), 0.25, "")


TROUBLES = {
    "own never seen": lambda pilot: pilot.seen.pop("own"),
    "opponent never seen": lambda pilot: pilot.seen.pop("opponent"),
    "own late": lambda pilot: pilot.saw("own", OWN, 9.6),
    "opponent late": lambda pilot: pilot.saw("opponent", OPPONENT, 9.6),
    "a clock ahead": lambda pilot: pilot.saw("opponent", OPPONENT, 10.5),
    "a stamp that is none": lambda pilot: pilot.saw("own", OWN, math.nan),
    "own NaN": lambda pilot: pilot.saw("own", (2.0, math.nan, 0.5, 0.1), 10.0),
    "opponent infinite": lambda pilot: pilot.saw("opponent", (math.inf, 6.0, 0.0, 0.0), 10.0),
    "a state of no numbers": lambda pilot: pilot.saw("own", (None, None, None, None), 10.0),
    "a state too short": lambda pilot: pilot.saw("own", (2.0, 3.0, 0.5), 10.0),
    "a policy that raises": lambda pilot: setattr(pilot, "decide", lambda state: 1 / 0),
    "a policy that says NaN": lambda pilot: setattr(pilot, "decide", lambda state: (4, math.nan, 0.0)),
    "a policy that says too much": lambda pilot: setattr(pilot, "decide", lambda state: (4, 0.0, 3.0)),
    "a policy that says nothing": lambda pilot: setattr(pilot, "decide", lambda state: None),
}


@pytest.mark.parametrize("trouble", TROUBLES)
def test_in_trouble_it_brakes_to_rest_and_says_why_and_goes_on_when_it_is_over(pilot, trouble):
    decide = pilot.decide
    TROUBLES[trouble](pilot)
    commands = [pilot.command(10.05) for _ in range(20)]
    assert commands[0].speed == pytest.approx(0.47)
    assert all(after.speed <= max(before.speed - 0.0299, 0) for before, after in itertools.pairwise(commands))
    assert commands[-1].speed == 0
    assert {command.turn_rate for command in commands} == {0}
    assert all(command.trouble for command in commands)

    pilot.decide = decide
    pilot.saw("own", OWN, 12.0)
    pilot.saw("opponent", OPPONENT, 12.0)
    again = pilot.command(12.1)
    assert (again.speed, again.turn_rate, again.trouble) == (pytest.approx(0.03), 0.8, "")


@pytest.mark.slow
def test_it_loads_what_is_exported(pilot_module, tmp_path):
    pytest.importorskip("jax2onnx")
    player = find_exportable("P_smooth", Role.PURSUER, make_game("paper"))
    write_onnx(player, tmp_path / "robot.onnx", states=100)
    decide = pilot_module.load_policy(tmp_path / "robot.onnx")
    states = np.array([OWN, OPPONENT], np.float32)
    made = player.decide(player.policy, player.game, states, None, (), np.uint32(0))
    assert decide([*OWN, *OPPONENT])[-2:] == pytest.approx(np.asarray(made["controls"]).tolist(), abs=1e-5)
    assert decide([math.nan] * 8)[-2:] == pytest.approx((-0.3, 0.0))


class Node:
    """What the template uses of `rclpy.node.Node`: calls are recorded."""

    def __init__(self, name):
        self.asked = MagicMock()

    def __getattr__(self, name):
        return getattr(self.asked, name)

    def get_parameter(self, name):
        return SimpleNamespace(value=self.asked.declare_parameter.call_args.args[1])


@pytest.fixture
def node(pilot_module, monkeypatch):
    """The template's node, with a policy that wants to go faster and left."""
    for name in ("rclpy", "rclpy.executors", "rclpy.qos", "geometry_msgs", "nav_msgs", "nav_msgs.msg"):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    monkeypatch.setitem(sys.modules, "rclpy.node", SimpleNamespace(Node=Node))
    monkeypatch.setitem(sys.modules, "geometry_msgs.msg", SimpleNamespace(Twist=MagicMock))
    template = load("pursuit_node")
    sys.modules.pop("pursuit_node")
    monkeypatch.setattr(template, "load_policy", lambda file: lambda state: (8, 0.3, 0.8))
    return template.PursuitNode()


def odometry(x, y, v, heading, stamp):
    """A message whose orientation is a rotation about the vertical."""
    pose = SimpleNamespace(
        position=SimpleNamespace(x=x, y=y),
        orientation=SimpleNamespace(w=math.cos(heading / 2), x=0.0, y=0.0, z=math.sin(heading / 2)),
    )
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=int(stamp), nanosec=round(stamp % 1 * 1e9))),
        pose=SimpleNamespace(pose=pose),
        twist=SimpleNamespace(twist=SimpleNamespace(linear=SimpleNamespace(x=v))),
    )


def test_the_node_drives_ten_times_a_second_and_brakes_when_it_sees_nothing(node):
    seconds, tick = node.asked.create_timer.call_args.args
    assert seconds == 0.1
    listeners = {topic: listener for _, topic, listener, _ in (one.args for one in node.create_subscription.mock_calls)}
    assert set(listeners) == {"own/odom", "opponent/odom"}
    clock, warning = node.get_clock().now(), node.get_logger().warning
    clock.nanoseconds = 5_500_000_000
    tick()
    assert warning.call_args.args == ("braking; own: never seen",)
    listeners["own/odom"](odometry(*OWN, stamp=5.5))
    listeners["opponent/odom"](odometry(*OPPONENT, stamp=5.4))
    assert node.pilot.seen["opponent"] == (pytest.approx(OPPONENT), 5.4)
    tick()
    clock.nanoseconds = 6_000_000_000
    tick()
    assert warning.call_count == 2
    assert node.create_publisher.call_args.args[1] == "cmd_vel"
    driven = [(twist.linear.x, twist.angular.z) for (twist,) in (one.args for one in node.drive.publish.mock_calls)]
    assert driven == [(0, 0), (pytest.approx(0.03), 0.8), (0, 0)]
