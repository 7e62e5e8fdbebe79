"""Bags as the ROS 2 node writes them."""


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
