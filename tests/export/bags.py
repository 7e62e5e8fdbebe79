"""Bags as the ROS 2 node and as a recorder write them."""

import numpy as np


def write_bag(folder, export, decisions):
    """Write a bag of these texts; return its folder."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_KILTED)
    kind = types.types["std_msgs/msg/String"]
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        for topic, texts in (("export", [export]), ("decisions", decisions)):
            connection = bag.add_connection(topic, kind.__msgtype__, typestore=types)
            for stamp, text in enumerate(texts):
                bag.write(connection, stamp, types.serialize_cdr(kind(data=text), kind.__msgtype__))
    return folder


def write_drive(folder, record, names=("/robot1/odom", "/robot1/cmd_vel"), stamped=False):
    """Write a bag of the odometry and commands of a drive, as `ros2 bag record` does; return its folder."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_KILTED)
    kinds = {name.split("/")[-1]: kind for name, kind in types.types.items()}
    covariance = np.zeros(36)

    def header(time):
        seconds, nanoseconds = divmod(round(time * 1e9), 10**9)
        return kinds["Header"](kinds["Time"](seconds, nanoseconds), "odom")

    def twist(v, turn):
        vector = kinds["Vector3"]
        return kinds["Twist"](vector(float(v), 0.0, 0.0), vector(0.0, 0.0, float(turn)))

    def odometry(time, x, y, heading, v, turn):
        turned = kinds["Quaternion"](0.0, 0.0, float(np.sin(heading / 2)), float(np.cos(heading / 2)))
        pose = kinds["Pose"](kinds["Point"](float(x), float(y), 0.0), turned)
        moves = kinds["TwistWithCovariance"](twist(v, turn), covariance)
        return kinds["Odometry"](header(time), "base", kinds["PoseWithCovariance"](pose, covariance), moves)

    def command(time, v, turn):
        return kinds["TwistStamped"](header(time), twist(v, turn)) if stamped else twist(v, turn)

    start = 1_800_000_000
    samples = zip(record.times + start, record.x, record.y, record.heading, record.speed, record.turn_rate, strict=True)
    commands = zip(record.command_times + start, record.command_speed, record.command_turn_rate, strict=True)
    rows = [(row[0], 0, odometry(*row)) for row in samples] + [(row[0], 1, command(*row)) for row in commands]
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        messages = ("nav_msgs/msg/Odometry", f"geometry_msgs/msg/Twist{'Stamped' * stamped}")
        connections = [
            bag.add_connection(name, message, typestore=types) for name, message in zip(names, messages, strict=True)
        ]
        for time, place, message in sorted(rows, key=lambda row: row[:2]):
            raw = types.serialize_cdr(message, message.__msgtype__)
            bag.write(connections[place], round(time * 1e9), raw)
    return folder
