"""Recorded ROS 2 bags: the messages of their topics."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from apollonius.io.errors import InvalidInput, closest_names, format_value, require, require_extra
from apollonius.io.limits import CountLimit

T = TypeVar("T")
MESSAGES = CountLimit(4096, most=500_000)
"""Messages that are read of a bag."""


@dataclass(frozen=True)
class Message:
    """A message of a bag: its type, when it was recorded [ns], and its content."""

    type: str
    stamp: int
    content: Any


def read_topics(
    folder: Path, readers: Mapping[str, Callable[[Message], T]], about: str
) -> dict[str, list[T]]:
    """Read the messages of some topics of a bag, in the order in which they were recorded.

    A topic is named in whole or by its end: `odom` is `/robot1/odom` where no other topic ends so.

    Args:
        folder: The bag.
        readers: What to make of each message, by the names of the topics.
        about: What the folder should be, for messages.

    Raises:
        InvalidInput: Where `rosbags` is not installed, for a folder that is no bag, a topic that is
            not in it or is not the only one of its name, more messages than fit into memory, and
            whatever a reader raises.
    """
    require_extra("bag", "reading a bag")
    try:
        _require_files(folder)
        return _read(folder, readers)
    except Exception as error:  # rosbags raises what it likes for a damaged file
        raise InvalidInput(f"{about}: {str(error) or repr(error)}") from error


def _require_files(folder: Path) -> None:
    """Refuse a folder that is not what a recorder leaves when it is stopped."""
    entries = sorted(folder.iterdir())
    names = [path.name for path in entries]
    bound = "metadata.yaml and the files that it names; stop the recorder, or reindex the bag"
    require("metadata.yaml" in names, "content", names[:5], bound)
    folders = [path.name for path in entries if not path.is_file()]
    require(not folders, "content", folders, "files alone")


def _read(folder: Path, readers: Mapping[str, Callable[[Message], T]]) -> dict[str, list[T]]:
    from rosbags.highlevel import AnyReader  # pyright: ignore[reportMissingImports]
    from rosbags.typesys import Stores, get_typestore  # pyright: ignore[reportMissingImports]

    results: dict[str, list[T]] = {topic: [] for topic in readers}
    # bags in SQLite, of older ROS, do not say how their messages are laid out
    types = get_typestore(Stores.LATEST)
    with AnyReader([folder], default_typestore=types) as bag:
        names = [connection.topic for connection in bag.connections]
        chosen = {_whole_name(topic, names): topic for topic in readers}
        require(len(chosen) == len(readers), "topics", ", ".join(readers), "different ones")
        connections = [own for own in bag.connections if own.topic in chosen]
        MESSAGES.require("messages", sum(own.msgcount for own in connections))
        for connection, stamp, raw in bag.messages(connections):
            content = bag.deserialize(raw, connection.msgtype)
            topic = chosen[connection.topic]
            message = Message(connection.msgtype, stamp, content)
            results[topic].append(readers[topic](message))
    return results


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
