"""The command of one robot, from what is known of all. Plain Python: no ROS, no Apollonius.

A `Pilot` never raises and always has a command. While it cannot trust what it knows, it brakes, and
says why.
"""

import cmath
import itertools
import math
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

NOT_SEEN = (1e9,) * 4
"""The state of an opponent that a player for a game with sensors does not see now."""
MARGIN = 0.5
"""Largest distance outside the arena at which a robot may be seen [m], as localisation errs."""
EXCESS = 2.0
"""Largest speed at which a robot may be seen, in multiples of the fastest, as speeds are noisy."""
DRIFT_TIME = 2.0
"""Over which a robot's drift is averaged [s]."""


@dataclass
class Decision:
    """The command of one step of the game, and all that it came from.

    Speed and turn rate are in m/s and rad/s. `trouble` says why it brakes; it is empty where the
    player decided, and what that was asked and answered, as `Export.decide`, comes after it.
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
    """Knowledge of a robot: its last state and whether it is in play, with the times [s] when they
    were so.

    Attributes:
        trusted: the time [s] and the state that the pilot believed last.
        drift: velocity of the poses less that of the twists [m/s], averaged over `DRIFT_TIME`.
    """

    name: str
    state: Sequence[float] | None = None
    seen: float = -math.inf
    in_play: bool = True
    judged: float = -math.inf
    trusted: Sequence[float] = (-math.inf, 0.0, 0.0, 0.0, 0.0)
    drift: complex = 0j

    def see(self, state: Sequence[float], stamp: float, now: float) -> None:
        """Take a state of a time [s], unless a newer one has come that is not ahead of the
        clock.
        """
        if not stamp < self.seen < now + 1.0:
            self.state, self.seen = state, stamp

    def trust(self, state: Sequence[float]) -> Sequence[float]:
        """Return a state, and compare its way from the one before with the twist of that."""
        before, x, y, v, heading = self.trusted
        elapsed = self.seen - before
        if 0 < elapsed < 1.0:
            way = complex(state[0] - x, state[1] - y) - cmath.rect(v * elapsed, heading)
            self.drift += (way - self.drift * elapsed) / DRIFT_TIME
        self.trusted = (self.seen, *state)
        return state

    @property
    def doubt(self) -> str:
        """The contradiction in what is known of the robot, or nothing."""
        drift = abs(self.drift)
        differs = drift > 0.1 + abs(self.trusted[3]) / 4
        return f"{self.name}: poses differ from its own frame's twist by {drift:.2f} m/s" * differs


def next_speed(body: dict[str, Any], speed: float, change: float) -> float:
    """Return a speed after a change [m/s], of a robot that is at rest before it reverses."""
    low = max(body["v_min"], 0.0) if speed > 0 else body["v_min"]
    high = min(body["v_max"], 0.0) if speed < 0 and body["v_min"] < 0 else body["v_max"]
    return min(max(speed + change, low), high)


def turn_rate(body: dict[str, Any], u2: float, speed: float) -> float:
    """Return the turn rate [rad/s] of a robot of some kind, as the game has it."""
    if body["model"] == "car":
        return speed * math.tan(u2) / body["wheelbase"]
    if body["model"] == "wheels":
        limit = 2 * max(body["wheel_speed"] - abs(speed), 0.0) / body["track"]
        return min(max(u2, -limit), limit)
    return u2


@dataclass
class Pilot:
    """The driver of one robot.

    Attributes:
        player: an `Export`.
        robots: its own, its mates, its opponents, in the order of the export.
        patience: how old a state, and a referee's word, may be [s].
        lead: how far the commanded speed may be ahead of the measured one [m/s], so that a robot
            that is held does not jump when it is let go.
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

    def __post_init__(self) -> None:
        if self.player.facts["body"]["model"] == "omni":
            raise ValueError(
                "model: omni, whose heading is its course, which an odometry does not say"
            )

    def command(self, now: float) -> Decision:
        """Return the decision from now [s] on; to be called every `dt`."""
        facts = self.player.facts
        try:
            made = self._ask(now)
            u1, u2 = made.controls
        except Exception as error:  # whatever it is, a robot under way must be stopped
            made = Decision(self.step, trouble=str(error) or repr(error))
            u1, u2 = -math.copysign(facts["u1_max"], self.speed) * (self.speed != 0), 0.0
        self.speed = next_speed(facts["body"], self.speed, u1 * facts["dt"])
        made.speed, made.turn_rate = self.speed, turn_rate(facts["body"], u2, self.speed)
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
        pairs = zip(self.robots, states, strict=True)
        visible = [robot for robot, state in pairs if state is robot.state]
        for one, other in itertools.combinations(visible, 2):
            if one.state[:2] == other.state[:2]:
                raise ValueError(f"{one.name}, {other.name}: one place; give each its own topic")
        if self.step == 0:
            self.player.begin()
        bits = secrets.randbits(32)
        action, controls = self.player.decide(states, active, bits)
        u1, u2 = controls
        if not (
            abs(u1) <= 1.01 * facts["u1_max"] and abs(u2) <= 1.01 * facts["u2_max"]
        ):  # also where NaN
            raise ValueError(
                f"player: controls {u1}, {u2} beyond {facts['u1_max']}, {facts['u2_max']}"
            )
        measured = states[0][2]
        if self.speed > 0:
            self.speed = min(self.speed, max(measured + self.lead, 0.0))
        else:
            self.speed = max(self.speed, min(measured - self.lead, 0.0))
        self.step += 1
        return Decision(self.step - 1, 0.0, 0.0, "", states, active, bits, action, controls)

    @property
    def doubt(self) -> str:
        """Contradictions in what is known of the robots, which do not make it brake, or nothing."""
        own, v = self.robots[0].name, self.robots[0].trusted[3]
        slowest = self.player.facts["body"]["v_min"]
        backwards = f"{own}: at {v:.2f} m/s, though it cannot reverse" * (v < slowest - 0.1)
        return "; ".join(filter(None, [backwards, *(robot.doubt for robot in self.robots)]))

    def _is_in_play(self, robot: Robot, now: float) -> bool:
        if self.refereed and not abs(now - robot.judged) <= self.patience:
            raise ValueError(f"{robot.name}: no word of a referee for {now - robot.judged:.2f} s")
        return robot.in_play

    def _state(self, robot: Robot, active: bool, now: float) -> Sequence[float]:
        """Return a robot's last state, if it is to be trusted or does not matter; raises
        otherwise.
        """
        facts, age = self.player.facts, now - robot.seen
        if not active:
            return (0.0,) * 4
        is_searched = robot in self.robots[1 + facts["mates"] :] and facts["game"].get("sensors")
        if is_searched and not abs(age) <= self.patience:
            return NOT_SEEN
        if robot.state is None:
            raise ValueError(f"{robot.name}: never seen")
        x, y, v, heading = robot.state
        walls, fastest = facts["game"]["arena"], facts["fastest"]
        is_inside = (
            walls["x_min"] - MARGIN <= x <= walls["x_max"] + MARGIN
            and walls["y_min"] - MARGIN <= y <= walls["y_max"] + MARGIN
        )
        upright = "orientation not a quaternion of length 1, or tilted by over 30 degrees"
        for holds, fault in (  # a NaN holds nowhere
            (abs(age) <= self.patience, f"seen {age:.2f} s ago"),
            (abs(heading) <= 2 * math.pi, upright),
            (is_inside, f"at {x:g}, {y:g} m, outside the arena; is its frame the arena's?"),
            (abs(v) <= EXCESS * fastest, f"at {v:g} m/s, and none is faster than {fastest:g} m/s"),
        ):
            if not holds:
                raise ValueError(f"{robot.name}: {fault}")
        return robot.trust(robot.state)
