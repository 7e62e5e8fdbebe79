"""Bags as the ROS 2 node writes them, and files with some bytes changed."""

import shutil


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


def damaged(content, rng):
    """Return bytes of which one to four are others, at random or from elsewhere in them."""
    changed = bytearray(content)
    for place in rng.integers(len(content), size=rng.integers(1, 5)):
        others = bytes([rng.integers(256)]), content[rng.integers(len(content)) :][:1]
        changed[place : place + 1] = others[rng.integers(2)]
    return bytes(changed)


def damaged_copy(folder, copy, rng):
    """Copy a folder, and damage one of its files; return the copy."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(folder, copy)
    files = sorted(path for path in copy.rglob("*") if path.is_file())
    file = files[rng.integers(len(files))]
    file.write_bytes(damaged(file.read_bytes(), rng))
    return copy
