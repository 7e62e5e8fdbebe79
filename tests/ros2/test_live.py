"""Two nodes on ROS 2 itself, each in a process of its own, drive two robots with bodies in whole games.

`GAMES=20` plays as many, `PREFIX=shielded:` with players that do not learn their drive;
`LOG=file.json` keeps what was measured.
"""

import json
import os
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml

from apollonius.export.player import find_exportable
from apollonius.export.writing import write_c
from apollonius.game.arena import Arena, Disc
from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.types import Outcome, Role
from apollonius.game.uncertainty import Uncertainties, Uncertainty

rclpy = pytest.importorskip("rclpy", reason="needs rclpy: install ROS 2")
rosbag2 = pytest.importorskip("rosbags.highlevel", reason="needs rosbags: pip install rosbags")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
PACKAGE = Path(__file__).parents[2] / "ros2" / "apollonius_ros"
GAMES = int(os.environ.get("GAMES", "3"))
PREFIX = os.environ.get("PREFIX", "identifying:shielded:")
DRIVE = Drive(lag=2, turn_time=0.46)
"""Of the bodies: odometry of 0.04 s, a node that decides up to 0.1 s later, and 0.1 s until the wheels follow."""
ERRORS = Uncertainty(position=0.03, heading=0.015, speed=0.06, delay=0.1, acceleration=0.1, turning=0.1, turn_delay=0.1)
"""Three times the noise of the odometry, and what the drive may do otherwise."""
GAME = Game(
    pursuer=Unicycle(radius=0.2),
    evader=Unicycle(radius=0.2, v_max=0.8),
    arena=Arena(x_max=7.0, y_max=7.0, discs=(Disc(3.5, 3.5, 0.5),)),
    max_steps=300,
    drives=Drives(DRIVE, DRIVE),
    uncertainty=Uncertainties(ERRORS, ERRORS),
)
ALONE = {"ROS_DOMAIN_ID": "77", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two exports, compiled, and the file of parameters."""
    folder = tmp_path_factory.mktemp("robots")
    for role in Role:
        name = role.name.lower()
        write_c(find_exportable(PREFIX + name, role, GAME), folder / f"{name}.c", states=100)
        command = ["gcc", "-std=c99", "-O2", "-shared", "-fPIC", f"{name}.c", "-lm", "-o", f"{name}.so"]
        subprocess.run(command, cwd=folder, check=True)
    params = yaml.safe_load((PACKAGE / "config" / "params.yaml").read_text())
    for section in params.values():
        section["ros__parameters"] |= {"dry_run": False, "in_play": "in_play"}
    (folder / "params.yaml").write_text(yaml.safe_dump(params))
    return folder


def start(folder, name):
    words = ["-m", "apollonius_ros.node", "--ros-args", "--params-file", "params.yaml", "-r", f"__node:={name}"]
    with (folder / f"{name}.log").open("a") as log:
        environment = os.environ | ALONE | {"PYTHONPATH": str(PACKAGE)}
        return subprocess.Popen([sys.executable, *words], cwd=folder, env=environment, stderr=log)


@pytest.fixture(scope="module")
def world(folder):
    os.environ.update(ALONE)
    rclpy.init()
    from tests.ros2.bodies import World

    yield World(GAME)
    rclpy.shutdown()


@pytest.fixture
def nodes(world, folder):
    """Both nodes, once they have been heard."""
    for heard in (*world.heard, *world.decisions):
        heard.clear()
    made = [start(folder, name) for name in ("pursuer", "evader")]
    world.run(60.0, is_over=lambda: all(world.heard))
    yield made
    for one in made:
        one.send_signal(signal.SIGTERM)
    world.run(10.0, is_over=lambda: all(one.poll() is not None for one in made))
    for one in made:
        one.kill()
        one.wait()


def until_fast(world):
    """Play on until the pursuer drives at 0.4 m/s or more."""
    for number in range(40, 50):
        world.playing = False
        world.place(number)
        world.run(1.0)
        world.playing = True
        if world.run(20.0, is_over=lambda: world.heard[0][-1][1] >= 0.4) == Outcome.ONGOING:
            return
    pytest.fail("the pursuer never gets fast")


@pytest.mark.timeout(300 + 60 * GAMES)
def test_nodes_play_whole_games_at_ten_decisions_a_second(nodes, world, folder):
    outcomes, periods, decisions = [], [], []
    for number in range(GAMES):
        outcomes.append(world.play(number).name.lower())
        print(number, outcomes[-1], flush=True)
        for place in range(2):
            made = [json.loads(text) for text in world.decisions[place]]
            periods += [b["time"] - a["time"] for a, b in pairwise(made) if b["step"] == a["step"] + 1]
            decisions += made
        for heard in (*world.heard, *world.decisions):
            heard.clear()
    between, played = np.array(periods), [one for one in decisions if not one["trouble"]]
    latencies = [1000 * one["latency"] for one in played]
    ages = [1000 * age for one in played for age in one["ages"]]
    log = {
        "games": GAMES,
        "outcomes": {one: outcomes.count(one) for one in sorted(set(outcomes))},
        "decisions": len(played),
        "seconds between two decisions": spread(between),
        "milliseconds of a decision": spread(latencies),
        "milliseconds since an odometry": spread(ages),
        "braked in play": sum("seen" in one["trouble"] or "referee" in one["trouble"] for one in decisions),
    }
    print(json.dumps(log))
    if "LOG" in os.environ:
        Path(os.environ["LOG"]).write_text(json.dumps(log, indent=1) + "\n", encoding="utf-8")
    assert np.mean(between) == pytest.approx(0.1, abs=0.002)
    assert np.quantile(np.abs(between - 0.1), 0.95) < 0.03
    assert np.quantile(between, 0.99) < 0.2
    assert np.median(latencies) < 20
    assert 40 <= np.median(ages) < 100
    assert "captured" in outcomes
    assert set(outcomes) <= {one.name.lower() for one in Outcome} - {"ongoing"}
    assert any("playing" in status.message for one in world.diagnosed for status in one.status)


def spread(values):
    """The median, both ends of the middle 98 %, and the extremes."""
    found = np.quantile(values, [0, 0.01, 0.5, 0.99, 1])
    return dict(zip(("least", "1 %", "median", "99 %", "most"), (round(float(one), 4) for one in found), strict=True))


def test_sigterm_brakes_the_robot_and_closes_the_bag(nodes, world, folder):
    until_fast(world)
    nodes[0].send_signal(signal.SIGTERM)
    world.run(0.3)
    world.heard[0].clear()
    world.run(8.0, is_over=lambda: nodes[0].poll() is not None)
    assert nodes[0].returncode == 0
    _, speeds, turns = np.array(world.heard[0]).T
    assert speeds[-1] == 0
    assert not turns.any()
    assert (np.diff(speeds) <= 1e-6).all()
    assert (np.diff(speeds) >= -0.031).all(), "by u1_max"
    bag = max((folder / "bags").glob("pursuer-*"), key=lambda one: one.stat().st_mtime)
    with rosbag2.AnyReader([bag]) as reader:
        counts = {one.topic: one.msgcount for one in reader.connections}
    assert set(counts) == {
        "export", "decisions", "/diagnostics", "robot1/cmd_vel",
        *(f"{robot}/{topic}" for robot in ("robot1", "robot2") for topic in ("odom", "in_play")),
    }  # fmt: skip
    assert counts["export"] == 1
    assert counts["decisions"] == counts["robot1/cmd_vel"] > 20
    assert counts["robot2/odom"] > 2 * counts["decisions"]
