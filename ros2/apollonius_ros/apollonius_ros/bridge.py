"""The bridge: a robot's odometry, in the frame of the map on which Nav2's AMCL, or another
localiser, places it.

    python3 -m apollonius_ros.bridge --ros-args -r __ns:=/robot1 -r /tf:=tf -r /tf_static:=tf_static

Each message of `odom` is published again as `map_odom`: its pose moved by the latest transform from
the map to the odometry's frame, its twist and its stamp unchanged. While that transform is missing,
or its stamp older than the odometry's by more than `patience`, nothing is published, so that the
node of `node.py` brakes.

Parameters: `map`, the map's frame ("map"), and `patience` (1.0 s).
"""

import math
import sys
from contextlib import suppress

from apollonius_ros import end_without_ros

try:
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
    from rclpy.qos import qos_profile_sensor_data
    from rclpy.time import Time
    from tf2_ros import Buffer, TransformException, TransformListener
except ImportError as error:
    end_without_ros(error)

DEFAULTS = {"map": "map", "patience": 1.0}


class Bridge(Node):
    """The bridge of one robot, whose namespace it is in."""

    def __init__(self):
        super().__init__("bridge", automatically_declare_parameters_from_overrides=True)
        self.given = DEFAULTS | {
            name: one.value for name, one in self.get_parameters_by_prefix("").items()
        }
        self.transforms = Buffer()
        self.listener = TransformListener(self.transforms, self)
        self.odometry = self.create_publisher(Odometry, "map_odom", qos_profile_sensor_data)
        self.create_subscription(Odometry, "odom", self.on_odometry, qos_profile_sensor_data)

    def on_odometry(self, message):
        header, frame = message.header, self.given["map"]
        try:
            found = self.transforms.lookup_transform(frame, header.frame_id, Time())
        except TransformException as error:
            self.warn(
                f"no transform from '{frame}' to '{header.frame_id}': {error}; does the "
                "localiser run?"
            )
            return
        since = seconds(found.header.stamp)
        age = seconds(header.stamp) - since
        if since > 0 and age > self.given["patience"]:  # a static transform's stamp is 0
            self.warn(
                f"the transform from '{frame}' is {age:.1f} s older than the odometry; does "
                "the localiser run?"
            )
            return
        move(message.pose.pose, found.transform)
        header.frame_id = frame
        self.odometry.publish(message)

    def warn(self, words):
        self.get_logger().warning(words, throttle_duration_sec=1.0)


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


def move(pose, transform):
    """Move a pose by a transform that turns about the vertical only, as those of localisers on flat
    floors do.
    """
    shift, turn = transform.translation, transform.rotation
    place, facing = pose.position, pose.orientation
    yaw, x, y = 2 * math.atan2(turn.z, turn.w), place.x, place.y
    place.x = shift.x + math.cos(yaw) * x - math.sin(yaw) * y
    place.y = shift.y + math.sin(yaw) * x + math.cos(yaw) * y
    along, upwards = complex(facing.x, facing.y), complex(facing.w, facing.z)
    half = complex(math.cos(yaw / 2), math.sin(yaw / 2))
    facing.x, facing.y = (half * along).real, (half * along).imag
    facing.w, facing.z = (half * upwards).real, (half * upwards).imag


def main():
    """Publish until SIGINT or SIGTERM."""
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Bridge())
    return 0


if __name__ == "__main__":
    sys.exit(main())
