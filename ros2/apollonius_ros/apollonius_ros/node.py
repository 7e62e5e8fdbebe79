"""The node: odometries in, a velocity out, every `dt`; diagnostics, and a bag of every run.

    python3 -m apollonius_ros.node --ros-args --params-file params.yaml -r __node:=pursuer

`config/params.yaml` explains the parameters, docs/reference/ros_node.md of Apollonius the rest.
"""

import json
import math
import signal
import sys
import time
from pathlib import Path

from apollonius_ros import end_without_ros
from apollonius_ros.export import Export
from apollonius_ros.pilot import Pilot, Robot

try:
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from geometry_msgs.msg import Twist, TwistStamped
    from nav_msgs.msg import Odometry
    from rclpy.clock import Clock, ClockType
    from rclpy.node import Node
    from rclpy.qos import qos_profile_sensor_data
    from rclpy.serialization import serialize_message
    from rclpy.signals import SignalHandlerOptions
    from std_msgs.msg import Bool, String
except ImportError as error:
    end_without_ros(error)


class Bag:
    """A bag that is written, complete once it is closed.

    Raises:
        ImportError: where `rosbags` is not installed.
        OSError: where it cannot be written.
    """

    def __init__(self, folder: Path, node: str, about: str) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        self._types, self._topics = get_typestore(Stores.ROS2_KILTED), {}
        name = f"{node}-{time.strftime('%Y%m%d-%H%M%S')}-{time.time_ns() % 10**6:06d}"
        self._bag = Writer(folder / name, version=9, storage_plugin=StoragePlugin.MCAP)
        self._bag.open()
        self.close = self._bag.close
        self.write("export", String(data=about), time.time_ns())

    def write(self, topic: str, message: object, stamp: int) -> None:
        """Write a message with the time [ns] at which it came or went."""
        if topic not in self._topics:
            kind = type(message)
            named = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
            self._topics[topic] = self._bag.add_connection(topic, named, typestore=self._types)
        self._bag.write(self._topics[topic], stamp, serialize_message(message))


class PursuitNode(Node):
    """One robot's node.

    Raises:
        KeyError: for a missing parameter.
        ValueError: for other numbers of robots than the export's, and as `Export`.
    """

    def __init__(self):
        super().__init__("player", automatically_declare_parameters_from_overrides=True)
        self.given = given = {
            name: one.value for name, one in self.get_parameters_by_prefix("").items()
        }
        player = Export(Path(given["player"]).expanduser())
        sides = [[name for name in given[side] if name] for side in ("mates", "opponents")]
        for side, names in zip(("mates", "opponents"), sides, strict=True):
            if len(names) != player.facts[side]:
                raise ValueError(f"{side}: {names}, but the export is for {player.facts[side]}")
        names = (given["own"], *sides[0], *sides[1])
        if len(set(names)) < len(names):
            raise ValueError(f"own, mates, opponents: {', '.join(names)}; name each robot once")
        robots = [Robot(name) for name in names]
        self.pilot = Pilot(
            player, robots, given["patience"], given["lead"], refereed=bool(given["in_play"])
        )
        self.velocity, kind = (
            f"{given['own']}/{given['velocity']}",
            TwistStamped if given["stamped"] else Twist,
        )
        self.drive = None if given["dry_run"] else self.create_publisher(kind, self.velocity, 1)
        self.decisions = self.create_publisher(String, "~/decisions", 10)
        self.diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.bag, self.latencies, self.last = None, [0.0], None
        if given["bags"]:
            try:
                self.bag = Bag(Path(given["bags"]).expanduser(), self.get_name(), player.text)
            except (ImportError, OSError) as error:
                self.get_logger().error(f"this run is not recorded: {error}")
        for robot in robots:
            self.listen(robot)
        clock = self.get_clock()
        if (
            not clock.ros_time_is_active
        ):  # the system's clock can be set back, and timers would wait
            clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(player.facts["dt"], self.tick, clock=clock)
        self.create_timer(1.0, self.diagnose, clock=clock)

    def listen(self, robot):
        def on_odometry(message):
            frame = message.header.frame_id
            if frame != self.given["frame"]:
                warning = (
                    f"{robot.name}: left out, in frame '{frame}' instead of '{self.given['frame']}'"
                )
                self.get_logger().warning(warning, throttle_duration_sec=1.0)
                return
            stamp = message.header.stamp
            robot.see(state_of(message), stamp.sec + 1e-9 * stamp.nanosec, self.now())
            self.record(odometry, message)

        def on_referee(message):
            robot.in_play, robot.judged = message.data, self.now()
            self.record(in_play, message)

        odometry, in_play = (
            f"{robot.name}/{self.given[topic]}" for topic in ("odometry", "in_play")
        )
        self.create_subscription(Odometry, odometry, on_odometry, qos_profile_sensor_data)
        if self.given["in_play"]:
            self.create_subscription(Bool, in_play, on_referee, 10)

    def tick(self):
        began, now = time.perf_counter(), self.now()
        self.last = made = self.pilot.command(now)
        if made.trouble:
            self.get_logger().warning(f"braking; {made.trouble}", throttle_duration_sec=1.0)
        self.steer(made)
        self.latencies.append(time.perf_counter() - began)
        ages = [round(now - robot.seen, 4) if robot.state else None for robot in self.pilot.robots]
        facts = vars(made) | {"time": now, "latency": self.latencies[-1], "ages": ages}
        self.publish(self.decisions, "decisions", String(data=json.dumps(facts)))

    def steer(self, made):
        """Publish a decision; in a dry run log it."""
        if self.drive is None:
            would = f"would drive {made.speed:.2f} m/s, {made.turn_rate:.2f} rad/s"
            self.get_logger().info(would, throttle_duration_sec=1.0)
            return
        message = twist = Twist()
        if self.given["stamped"]:
            message = TwistStamped()
            message.header.stamp, message.header.frame_id = (
                self.get_clock().now().to_msg(),
                "base_link",
            )
            twist = message.twist
        twist.linear.x, twist.angular.z = made.speed, made.turn_rate
        self.publish(self.drive, self.velocity, message)

    def diagnose(self):
        """Publish the state, the slowest decision of the last second, and the age of each robot's
        odometry.
        """
        slowest, self.latencies = max(self.latencies), [0.0]
        trouble = self.last.trouble if self.last else "not begun"
        late = slowest > self.pilot.player.facts["dt"] / 2
        warning = f"braking; {trouble}" if trouble else self.pilot.doubt or "slow" * late
        values = {
            "step": self.pilot.step,
            "speed [m/s]": f"{self.pilot.speed:.2f}",
            "dry run": self.drive is None,
        }
        values["slowest decision [ms]"] = f"{1000 * slowest:.2f}"
        values |= {
            f"age of {robot.name} [s]": f"{self.now() - robot.seen:.2f}"
            for robot in self.pilot.robots
        }
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if warning else DiagnosticStatus.OK,
            name=f"{self.get_name()}: {self.pilot.player.facts['player']}",
            message=warning or "playing",
            hardware_id=self.given["own"],
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self.publish(self.diagnostics, "/diagnostics", message)

    def publish(self, publisher, topic, message):
        publisher.publish(message)
        self.record(topic, message)

    def record(self, topic, message):
        """Write a message to the bag; a bag that cannot be written ends, the game does not."""
        if self.bag:
            try:
                self.bag.write(topic, message, self.get_clock().now().nanoseconds)
            except OSError as error:
                self.bag = None
                self.get_logger().error(f"the bag ends here: {error}")

    def now(self):
        return 1e-9 * self.get_clock().now().nanoseconds


def state_of(message):
    """Return x, y [m], v [m/s], heading [rad] of an odometry in the arena's frame; its twist is the
    robot's own.

    The heading is NaN unless the quaternion's squared length is within 1 % of 1, and its robot
    upright within 30 degrees.
    """
    pose, turn = message.pose.pose.position, message.pose.pose.orientation
    x, y, z, w = (part * part for part in (turn.x, turn.y, turn.z, turn.w))
    heading = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), w + x - y - z)
    is_sound = abs(x + y + z + w - 1) <= 0.01 and w + z - x - y >= math.cos(math.pi / 6)
    return pose.x, pose.y, message.twist.twist.linear.x, heading if is_sound else math.nan


def main():
    """Play until SIGINT or SIGTERM, then brake to rest."""
    stop = []
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, lambda *_: stop.append(True))
    try:
        node = PursuitNode()
    except (KeyError, ValueError, OSError) as error:
        missing = f"no parameter {error}: config/params.yaml has all of them"
        print(
            f"apollonius_ros: {missing if isinstance(error, KeyError) else error}", file=sys.stderr
        )
        return 2
    while not stop:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.pilot.stopped = True
    node.tick()
    while node.pilot.speed > 0:
        rclpy.spin_once(node, timeout_sec=0.1)
    if node.bag:
        node.bag.close()
    rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
