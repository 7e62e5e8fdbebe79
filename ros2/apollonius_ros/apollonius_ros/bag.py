"""A bag of one run: an MCAP file that ROS 2, Foxglove and `apollonius replay` read."""

import time
from pathlib import Path

from rclpy.serialization import serialize_message


class Bag:
    """A bag that is written, complete once it is closed.

    Raises:
        ImportError: where `rosbags` is not installed.
        OSError: where it cannot be written.
    """

    def __init__(self, folder: Path, node: str, about: str) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
        from std_msgs.msg import String

        self._types, self._topics = get_typestore(Stores.ROS2_KILTED), {}
        name = f"{node}-{time.strftime('%Y%m%d-%H%M%S')}-{time.time_ns() % 10**6:06d}"
        self._bag = Writer(folder / name, version=9, storage_plugin=StoragePlugin.MCAP)
        self._bag.open()
        self.write("export", String(data=about), time.time_ns())

    def write(self, topic: str, message: object, stamp: int) -> None:
        """Write a message with the time [ns] at which it came or went."""
        if topic not in self._topics:
            kind = type(message)
            named = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
            self._topics[topic] = self._bag.add_connection(topic, named, typestore=self._types)
        self._bag.write(self._topics[topic], stamp, serialize_message(message))

    def close(self) -> None:
        """Finish the file."""
        self._bag.close()
