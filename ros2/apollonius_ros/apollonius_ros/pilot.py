"""The command of one robot, from what is known of all. Plain Python: no ROS, no Apollonius.

A `Pilot` never raises and always has a command. While it cannot trust what it knows, it brakes, and says why.
"""

import math
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

NOT_SEEN = (1e9,) * 4
"""The state of an opponent that a player for a game with sensors does not see now."""


@dataclass
class Decision:
    """The command of one step of the game, and all that it came from.

    Speed and turn rate are in m/s and rad/s. `trouble` says why it brakes; it is empty where the player decided, and
    what that was asked and answered, as `Export.decide`, comes after it.
    """

    step: int = 0
    speed: float = 0.0
    turn_rate: float = 0.0
    trouble: str = ""
    states: Sequence[Sequence[float]] = ()
    active: Sequence[bool] = ()
    bits: int = 0
    action: Sequence[float] = ()
    controls: Sequence[float] = ()


@dataclass
class Robot:
    """What is known of a robot: its last state and whether it is in play, with the times [s] when they were so."""

    name: str
    state: Sequence[float] | None = None
    seen: float = -math.inf
    in_play: bool = True
    judged: float = -math.inf


@dataclass
class Pilot:
    """The driver of one robot.

    Attributes:
        player: an `Export`.
        robots: its own, its mates, its opponents, in the order of the export.
        patience: how old a state, and a referee's word, may be [s].
        lead: how far the commanded speed may be ahead of the measured one [m/s], so that a robot that is held does not
            jump when it is let go.
        refereed: whether a referee says who is in play.
        stopped: set at the end; the robot brakes from then on.
    """

    player: Any
    robots: Sequence[Robot]
    patience: float = 0.3
    lead: float = 0.2
    refereed: bool = False
    stopped: bool = False
    speed: float = 0.0
    step: int = 0

    def command(self, now: float) -> Decision:
        """Return the decision from now [s] on; to be called every `dt`."""
        facts = self.player.facts
        try:
            made = self._ask(now)
            u1, made.turn_rate = made.controls
        except Exception as error:  # whatever it is, a robot under way must be stopped
            made, u1 = Decision(self.step, trouble=str(error) or repr(error)), -facts["u1_max"]
        made.speed = self.speed = min(max(self.speed + u1 * facts["dt"], 0.0), facts["v_max"])
        return made

    def _ask(self, now: float) -> Decision:
        """Return what the player decides; raises where it cannot be believed."""
        facts, (own, *_) = self.player.facts, self.robots
        if self.stopped:
            raise ValueError("stopped")
        if not self._is_in_play(own, now):
            self.step = 0
            raise ValueError(f"{own.name}: not in play")
        active = [self._is_in_play(robot, now) for robot in self.robots]
        if not any(active[1 + facts["mates"] :]):
            raise ValueError("no opponent in play")
        if self.step >= facts["max_steps"]:
            raise ValueError("the game's time is up")
        states = [self._state(*robot, now) for robot in zip(self.robots, active, strict=True)]
        if self.step == 0:
            self.player.begin()
        bits = secrets.randbits(32)
        action, controls = self.player.decide(states, active, bits)
        u1, turn_rate = controls
        if not (abs(u1) <= 1.01 * facts["u1_max"] and abs(turn_rate) <= 1.01 * facts["u2_max"]):  # also where NaN
            raise ValueError(f"player: controls {u1}, {turn_rate} beyond {facts['u1_max']}, {facts['u2_max']}")
        self.speed = min(self.speed, states[0][2] + self.lead)
        self.step += 1
        return Decision(self.step - 1, 0.0, 0.0, "", states, active, bits, action, controls)

    def _is_in_play(self, robot: Robot, now: float) -> bool:
        if self.refereed and not abs(now - robot.judged) <= self.patience:
            raise ValueError(f"{robot.name}: no word of a referee for {now - robot.judged:.2f} s")
        return robot.in_play

    def _state(self, robot: Robot, active: bool, now: float) -> Sequence[float]:
        """Return a robot's last state, if it is to be trusted or does not matter; raises otherwise."""
        if not active:
            return robot.state or (0.0,) * 4
        searches = robot in self.robots[1 + self.player.facts["mates"] :] and self.player.facts["game"].get("sensors")
        if searches and not abs(now - robot.seen) <= self.patience:
            return NOT_SEEN
        if robot.state is None:
            raise ValueError(f"{robot.name}: never seen")
        if not abs(now - robot.seen) <= self.patience:  # also where either is NaN, or a clock is ahead
            raise ValueError(f"{robot.name}: seen {now - robot.seen:.2f} s ago")
        if len(robot.state) != 4 or not all(map(math.isfinite, robot.state)):
            raise ValueError(f"{robot.name}: broken state {list(robot.state)}")
        return robot.state
