"""A ROS 2 node that drives one robot by an exported policy: a template to copy, with `pilot.py` beside it.

    python3 pursuit_node.py --ros-args -p policy:=P_smooth.onnx -r own/odom:=/robot1/odom \
        -r opponent/odom:=/robot2/odom -r cmd_vel:=/robot1/cmd_vel

docs/how-to/ros2.md of Apollonius explains its topics and settings.
"""

import contextlib
import math
from pathlib import Path

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from pilot import Limits, Pilot, load_policy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data


class PursuitNode(Node):
    """Two odometries in, a velocity out, every `dt`."""

    def __init__(self):
        super().__init__("pursuit")
        self.declare_parameter("policy", "policy.onnx")
        limits = Limits()
        self.pilot = Pilot(load_policy(Path(self.get_parameter("policy").value)), limits)
        self.drive = self.create_publisher(Twist, "cmd_vel", 1)
        for robot in ("own", "opponent"):
            self.create_subscription(Odometry, f"{robot}/odom", self.listener(robot), qos_profile_sensor_data)
        self.create_timer(limits.dt, self.tick)

    def listener(self, robot):
        def on_odometry(message):
            stamp = message.header.stamp
            self.pilot.saw(robot, state_of(message), stamp.sec + 1e-9 * stamp.nanosec)

        return on_odometry

    def tick(self):
        command = self.pilot.command(1e-9 * self.get_clock().now().nanoseconds)
        if command.trouble:
            self.get_logger().warning(f"braking; {command.trouble}", throttle_duration_sec=1.0)
        twist = Twist()
        twist.linear.x, twist.angular.z = command.speed, command.turn_rate
        self.drive.publish(twist)


def state_of(message):
    """x, y [m], v [m/s], heading [rad] of an odometry in the arena's frame."""
    pose, turn = message.pose.pose.position, message.pose.pose.orientation
    heading = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
    return pose.x, pose.y, message.twist.twist.linear.x, heading


def main():
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(PursuitNode())


if __name__ == "__main__":
    main()
