"""Recorded ROS 2 bags: the messages of their topics."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from apollonius.io.errors import InvalidInput, closest_names, format_value, require, require_extra
from apollonius.io.limits import CountLimit

MESSAGES = CountLimit(4096, most=2_000_000)
"""Messages that are read of a bag."""


@dataclass(frozen=True)
class Message:
    """A message of a bag: its type, when it was recorded [ns], and its content."""

    type: str
    stamp: int
    content: Any


def read_topics(folder: Path, topics: Sequence[str], about: str) -> dict[str, list[Message]]:
    """Read the messages of some topics of a bag, in the order in which they were recorded.

    A topic is named in whole or by its end: `odom` is `/robot1/odom` where no other topic ends so.

    Args:
        folder: The bag.
        topics: Names of the topics.
        about: What the folder should be, for messages.

    Raises:
        InvalidInput: Where `rosbags` is not installed, for a folder that is no bag, a topic that is
            not in it or is not the only one of its name, and more messages than fit into memory.
    """
    require_extra("bag", "reading a bag")
    from rosbags.highlevel import AnyReader  # pyright: ignore[reportMissingImports]
    from rosbags.typesys import Stores, get_typestore  # pyright: ignore[reportMissingImports]

    messages: dict[str, list[Message]] = {topic: [] for topic in topics}
    try:
        bound = (
            "metadata.yaml and the files that it names, as ros2 bag record writes them when it is "
            "stopped"
        )
        names = sorted(path.name for path in folder.iterdir())
        require("metadata.yaml" in names, "content", names[:5], bound)
        other_entries = [path.name for path in folder.iterdir() if not path.is_file()]
        require(not other_entries, "content", other_entries, "files alone")
        # bags in SQLite, of older ROS, do not say how their messages are laid out
        types = get_typestore(Stores.LATEST)
        with AnyReader([folder], default_typestore=types) as reader:
            names = [connection.topic for connection in reader.connections]
            chosen = {_whole_name(topic, names): topic for topic in topics}
            connections = [own for own in reader.connections if own.topic in chosen]
            MESSAGES.require("messages", sum(own.msgcount for own in connections))
            for connection, stamp, raw in reader.messages(connections):
                content = reader.deserialize(raw, connection.msgtype)
                message = Message(connection.msgtype, stamp, content)
                messages[chosen[connection.topic]].append(message)
    except Exception as error:  # rosbags raises what it likes for a damaged file
        raise InvalidInput(f"{about}: {str(error) or repr(error)}") from error
    return messages


def _whole_name(topic: str, names: Sequence[str]) -> str:
    """Return the name of a topic in a bag that has these names."""
    ends = f"/{topic.strip('/')}"
    same = {name for name in names if f"/{name.strip('/')}" == ends}
    matches = sorted(same or {name for name in names if name.endswith(ends)})
    if len(matches) != 1:
        wanted = matches or sorted(set(names))
        listed = ", ".join(map(format_value, wanted)) or "none"
        state = "several topics end so" if matches else "not in this bag; its topics are"
        nearest = None if matches else closest_names(topic, wanted)
        hint = f"; did you mean '{format_value(nearest)}'?" if nearest else ""
        raise InvalidInput(f"topic '{format_value(topic)}': {state}: {listed}{hint}")
    return matches[0]
