"""A run that a robot recorded, and the agent asked again in each of its states."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.arenas.file import from_dict
from apollonius.export.parity import TOLERANCE
from apollonius.export.player import find_exportable
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.document import parse_json
from apollonius.io.errors import InvalidInput, require, require_extra


@dataclass(frozen=True)
class Bag:
    """The player of a bag that the ROS 2 node recorded, its side, the record of its game, and what was decided."""

    player: str
    side: Role
    record: dict[str, Any]
    decisions: list[dict[str, Any]]

    @property
    def asked(self) -> list[dict[str, Any]]:
        """The decisions of the player; in the other steps the node braked."""
        return [one for one in self.decisions if not one["trouble"]]

    @property
    def game(self) -> Game:
        """The exported game; raises InvalidInput where a map that it names is not here."""
        return from_dict(Game, self.record, "the bag's game; give --game")


def load_bag(folder: Path) -> Bag:
    """Read a bag; raises InvalidInput where `rosbags` is not installed, and for a folder that is no bag of the node."""
    require_extra("bag", "reading a bag")
    from rosbags.highlevel import AnyReader, AnyReaderError  # pyright: ignore[reportMissingImports]
    from rosbags.rosbag2.errors import ReaderError  # pyright: ignore[reportMissingImports]

    said: dict[str, list[Any]] = {"export": [], "decisions": []}
    try:
        with AnyReader([folder]) as reader:
            for connection, _, raw in reader.messages([one for one in reader.connections if one.topic in said]):
                text = reader.deserialize(raw, connection.msgtype).data
                said[connection.topic].append(parse_json(text.encode(), f"'{folder}' is no bag of the ROS 2 node"))
    except (AnyReaderError, ReaderError, OSError) as error:
        raise InvalidInput(f"'{folder}' is no bag of the ROS 2 node: {error}") from error
    (export,) = said["export"] or [{}]
    known = {"player", "side", "game"} <= set(export) and said["decisions"]
    require(known, f"'{folder}': topics", "others", "export and decisions, as the ROS 2 node writes them")
    return Bag(export["player"], Role[export["side"].upper()], export["game"], said["decisions"])


def ask_again(bag: Bag, name: str, game: Game) -> list[dict[str, Any]]:
    """Return where an agent, with its memory since the game began, acts otherwise than was recorded; errors as of
    `find_exportable`, and for a game of other numbers of robots.

    That is the `time` since the first step [s], the `step`, and the controls `then` and `now`: u1 [m/s^2], u2 [rad/s].
    """
    player = find_exportable(name, bag.side, game)
    decide, memory, differences = jax.jit(player.decide), player.memory, list[dict[str, Any]]()
    for one in bag.asked:
        states = np.array(one["states"], np.float32)
        require(len(states) == player.robots, "robots in the bag", len(states), f"{player.robots}, as in {game.size}")
        memory = player.memory if one["step"] == 0 else memory
        active = jnp.asarray(one["active"]) if player.robots > 2 else None
        made = decide(player.policy, player.game, jnp.asarray(states), active, memory, jnp.uint32(one["bits"]))
        memory, now = made["memory"], np.asarray(made["controls"])
        if (np.abs(now - np.array(one["controls"])) > TOLERANCE * player.largest).any():
            since = one["time"] - bag.decisions[0]["time"]
            differences.append({"time": since, "step": one["step"], "then": one["controls"], "now": now.tolist()})
    return differences
