"""A run that a robot recorded, and the agent asked again in each of its states."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.names import SIDES
from apollonius.arenas.file import from_dict
from apollonius.export.parity import TOLERANCE
from apollonius.export.player import find_exportable
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.document import parse_json
from apollonius.io.errors import require, require_within
from apollonius.io.limits import MOST_COUNTED
from apollonius.io.record import read_record
from apollonius.io.recording import Message, read_topics

_LARGEST = 1e12
"""No number of a time [s], a state or a control is beyond this."""


@dataclass(frozen=True)
class Decision:
    """A decision of the ROS 2 node at a time [s]; `ros2/` describes the other fields."""

    time: float
    step: int
    trouble: str
    states: tuple[tuple[float, ...], ...] = ()
    active: tuple[bool, ...] = ()
    bits: int = 0
    controls: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        require_within(self, 0, MOST_COUNTED, "step")
        require_within(self, 0, 2**32 - 1, "bits")
        numbers = self.time, *self.controls, *itertools.chain(*self.states)
        bound = f"within {_LARGEST:,.0f} of 0"
        require(max(map(abs, numbers)) <= _LARGEST, "time, controls, states", numbers, bound)
        if not self.trouble:
            require(len(self.controls) == 2, "controls", self.controls, "two numbers")
            sizes = [len(state) for state in self.states]
            bound = f"four numbers for each of {len(self.active)} robots"
            require(sizes == [4] * len(self.active), "states", self.states, bound)


@dataclass(frozen=True)
class Bag:
    """The player of a bag that the ROS 2 node recorded, its side, the record of its game, and what
    was decided.
    """

    player: str
    side: Role
    record: dict[str, Any]
    decisions: tuple[Decision, ...]

    @property
    def player_decisions(self) -> list[Decision]:
        """The decisions of the player; in the other steps the node braked."""
        return [decision for decision in self.decisions if not decision.trouble]

    @property
    def game(self) -> Game:
        """The exported game; raises InvalidInput where a map that it names is not here."""
        return from_dict(Game, self.record, "the bag's game; give --game")


def load_bag(folder: Path) -> Bag:
    """Read a bag; raises InvalidInput where `rosbags` is not installed, and for a folder that is no
    bag of the node.
    """
    about = f"'{folder}' is no bag of the ROS 2 node"
    readers = {"export": _text, "decisions": _text}
    return bag_of(read_topics(folder, readers, about), about)


def _text(message: Message) -> bytes:
    return message.content.data.encode()


def bag_of(texts: Mapping[str, Sequence[bytes]], about: str) -> Bag:
    """Return the bag of the texts of its topics; what they are `about` is for messages.

    Raises InvalidInput for texts that the node does not write.
    """
    exports = [parse_json(text, about) for text in texts["export"]]
    decisions = [parse_json(text, about) for text in texts["decisions"]]
    is_whole = len(exports) == 1 and {"player", "side", "game"} <= exports[0].keys() and decisions
    require(is_whole, f"{about}: topics", "others", "one export, and decisions")
    export = exports[0]
    names = Decision.__dataclass_fields__.keys()
    data = {
        "player": export["player"],
        "side": export["side"],
        "record": export["game"],
        "decisions": [
            {name: decision[name] for name in names & decision.keys()} for decision in decisions
        ],
    }
    return read_record(Bag, data, about, {Role: _side})


def _side(name: object) -> Role:
    require(name in SIDES, "side", name, f"one of {', '.join(SIDES)}")
    return Role[str(name).upper()]


def recompute_decisions(bag: Bag, name: str, game: Game) -> list[dict[str, Any]]:
    """Compare an agent's decisions, with its memory since the game began, with the recorded ones.

    Returns:
        Each difference: the `time` since the first step [s], the `step`, and the `recorded` and the
        `recomputed` controls, u1 [m/s^2] and u2 [rad/s].

    Raises:
        InvalidInput: As `find_exportable`, and for a game of other numbers of robots.
    """
    game.require_no_movers("a bag")
    player = find_exportable(name, bag.side, game)
    decide = jax.jit(player.decide)
    memory = player.memory
    differences = list[dict[str, Any]]()
    for decision in bag.player_decisions:
        robots = len(decision.states)
        require(
            robots == player.robots,
            "robots in the bag",
            robots,
            f"{player.robots}, as in {game.size}",
        )
        states = jnp.asarray(decision.states, jnp.float32)
        memory = player.memory if decision.step == 0 else memory
        active = jnp.asarray(decision.active) if player.robots > 2 else None
        answer = decide(
            player.policy, player.game, states, active, None, memory, jnp.uint32(decision.bits)
        )
        memory = answer["memory"]
        controls = np.asarray(answer["controls"])
        if (np.abs(controls - np.array(decision.controls)) > TOLERANCE * player.largest).any():
            since = decision.time - bag.decisions[0].time
            differences.append(
                {
                    "time": since,
                    "step": decision.step,
                    "recorded": list(decision.controls),
                    "recomputed": controls.tolist(),
                }
            )
    return differences
