"""Two robots with bodies in MuJoCo, as ROS sees them: odometry out, velocities in, and a referee, in real time."""

import time
from collections import deque
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Bool, String

from apollonius.game.game import Game, sample_starts
from apollonius.game.judge import judge
from apollonius.game.types import Outcome
from apollonius.play.replay import as_rows, as_state
from apollonius.simulate.drive import RobotHardware
from apollonius.simulate.physics import Physics

PERIOD = 0.02
"""Between two odometries of a robot [s]."""
TIMEOUT = 0.3
"""The drives stop where no velocity came for so long [s]."""
NOISE = np.array([0.01, 0.01, 0.02, 0.005])
"""Standard deviations of x, y [m], v [m/s] and heading [rad]."""


@dataclass
class World:
    """Robots, their drives, their sensors, and the referee.

    Attributes:
        delay: of the odometry, in periods.
        drop_out: the share of odometries that are lost.
        heard: of each robot, when each velocity came [s, monotonic], and what it was.
        decisions: of each node, as it publishes them.
    """

    game: Game
    delay: int = 2
    drop_out: float = 0.05
    heard: list[list[tuple[float, float, float]]] = field(default_factory=lambda: [[], []])
    decisions: list[list[str]] = field(default_factory=lambda: [[], []])
    diagnosed: list[DiagnosticArray] = field(default_factory=list)
    playing: bool = False

    def __post_init__(self):
        self.drive, self.rng = RobotHardware(), np.random.default_rng(0)
        self.physics = Physics(self.game, self.drive)
        self.starts = as_rows(sample_starts(self.game, jax.random.key(1), 128))
        self.judge = jax.jit(
            lambda before, after, step: judge(self.game, as_state(before, step), as_state(after, step + 1))[0]
        )
        self.node = node = rclpy.create_node("world")
        names = ("robot1", "robot2")
        self.odometry = [node.create_publisher(Odometry, f"{name}/odom", qos_profile_sensor_data) for name in names]
        self.referee = [node.create_publisher(Bool, f"{name}/in_play", 10) for name in names]
        for place, name in enumerate(names):
            node.create_subscription(Twist, f"{name}/cmd_vel", self.hearing(place), 1)
        for place, name in enumerate(("pursuer", "evader")):
            node.create_subscription(String, f"{name}/decisions", self.noting(place), 1000)
        node.create_subscription(DiagnosticArray, "/diagnostics", self.diagnosed.append, 10)
        self.place(0)
        self.judge(self.rows[0], self.rows[0], jnp.int32(0))

    def hearing(self, place):
        return lambda twist: self.heard[place].append((time.monotonic(), twist.linear.x, twist.angular.z))

    def noting(self, place):
        return lambda text: self.decisions[place].append(text.data)

    def place(self, number):
        """Put the robots where a game begins, at rest."""
        rows = self.starts[number : number + 1]
        self.states, self.turn = self.physics.set_poses(rows), np.zeros(2)
        self.rows, self.late = rows.astype(float), deque()

    def spin(self, until):
        while (left := until - time.monotonic()) > 0:
            rclpy.spin_once(self.node, timeout_sec=left)

    def period(self):
        """Move the robots for one period, as they were asked last, and publish what is seen of them."""
        asked = [heard[-1] if heard else (-np.inf, 0.0, 0.0) for heard in self.heard]
        fresh = np.array([self.next - when <= TIMEOUT for when, _, _ in asked])
        speed, turn = np.where(fresh, np.array([[v, w] for _, v, w in asked]).T, 0.0)
        steps = round(PERIOD / self.physics.step)
        reach = self.drive.turn_acceleration * self.physics.step
        wheels = np.empty((1, steps, 4))
        for step in range(steps):
            self.turn += np.clip(turn - self.turn, -reach, reach)
            wheels[0, step] = self.drive.wheel_speeds(speed, self.turn).ravel()
        self.states = self.physics.advance(self.states, wheels)
        self.rows = self.physics.measure(self.states)
        stamp = self.node.get_clock().now().to_msg()
        self.late.append((stamp, self.rows.reshape(2, 4).copy()))
        if len(self.late) > self.delay:
            stamp, rows = self.late.popleft()
            for place, row in enumerate(rows + NOISE * self.rng.normal(size=(2, 4))):
                if self.rng.random() >= self.drop_out:
                    self.odometry[place].publish(odometry(row, stamp))

    def run(self, seconds, is_over=lambda: False):
        """Let the world go on; return the outcome where a game is played and ends, else `ONGOING`."""
        self.next, before = time.monotonic(), self.rows
        for count in range(round(seconds / PERIOD)):
            if count % 5 == 0:
                for referee in self.referee:
                    referee.publish(Bool(data=self.playing))
            self.next += PERIOD
            self.spin(self.next)
            self.period()
            if self.playing and count % 5 == 4:
                given = (jnp.asarray(rows[0], jnp.float32) for rows in (before, self.rows))
                outcome, before = Outcome(int(self.judge(*given, jnp.int32(count // 5)))), self.rows
                if outcome != Outcome.ONGOING:
                    return outcome
            if is_over():
                break
        return Outcome.ONGOING

    def play(self, number):
        """Play a game from its start to its end; return the outcome."""
        self.playing = False
        self.place(number)
        self.run(1.0)
        self.playing = True
        outcome = self.run(1e6 * PERIOD)
        self.playing = False
        return outcome


def odometry(row, stamp):
    x, y, v, heading = map(float, row)
    message = Odometry()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, "map", "base_link"
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.w, message.pose.pose.orientation.z = np.cos(heading / 2), np.sin(heading / 2)
    message.twist.twist.linear.x = v
    return message
