"""What to drive, from what is seen of both robots and an exported policy. Plain Python: no ROS, no Apollonius.

A `Pilot` never raises and always has a command. While it cannot trust what it sees, it brakes, and says why.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

Decide = Callable[[Sequence[float]], Sequence[float]]
"""An exported policy: own x, y [m], v [m/s], heading [rad], then the opponent's; in turn u1 and u2, and before them a
discrete policy's action."""


@dataclass(frozen=True)
class Limits:
    """Those that the policy's file says it was made for, and how much is asked of the robots' senses."""

    v_max: float = 1.2
    """Largest speed [m/s]."""
    u1_max: float = 0.3
    """Largest acceleration, either sign [m/s^2]."""
    u2_max: float = 0.8
    """Largest turn rate, either sign [rad/s]."""
    dt: float = 0.1
    """How long a command is held [s]."""
    patience: float = 0.3
    """How old a state may be [s]."""
    lead: float = 0.2
    """How far the commanded speed may be ahead of the measured one [m/s], so that a robot that is held does not jump
    when it is let go."""


@dataclass(frozen=True)
class Command:
    """What to drive until the next one: speed [m/s] and turn rate [rad/s]; `trouble` says why, if it is braking."""

    speed: float
    turn_rate: float
    trouble: str = ""


class Pilot:
    """Remembers the last state of either robot and the last speed it commanded, and nothing else."""

    def __init__(self, decide: Decide, limits: Limits) -> None:
        self.decide, self.limits = decide, limits
        self.speed = 0.0
        self.seen: dict[str, tuple[Sequence[float], float]] = {}

    def saw(self, robot: str, state: Sequence[float], stamp: float) -> None:
        """Store the state (x, y, v, heading) of robot `own` or `opponent` at this time [s]."""
        self.seen[robot] = (state, stamp)

    def command(self, now: float) -> Command:
        """Return the command from now [s] on; to be called every `dt`."""
        limits, trouble = self.limits, ""
        try:
            u1, turn_rate = self.ask(now)
        except Exception as error:  # whatever it is, a robot under way must be stopped
            u1, turn_rate, trouble = -limits.u1_max, 0.0, str(error) or repr(error)
        self.speed = min(max(self.speed + u1 * limits.dt, 0.0), limits.v_max)
        return Command(self.speed, turn_rate, trouble)

    def ask(self, now: float) -> tuple[float, float]:
        """Return the policy's acceleration [m/s^2] and turn rate [rad/s]; raises where it cannot be believed."""
        own, opponent = self.state("own", now), self.state("opponent", now)
        *_, u1, turn_rate = self.decide([*own, *opponent])
        limits = self.limits
        if not (abs(u1) <= 1.01 * limits.u1_max and abs(turn_rate) <= 1.01 * limits.u2_max):  # also where either is NaN
            raise ValueError(f"policy: controls {u1}, {turn_rate} beyond {limits.u1_max}, {limits.u2_max}")
        self.speed = min(self.speed, own[2] + limits.lead)
        return u1, turn_rate

    def state(self, robot: str, now: float) -> Sequence[float]:
        """Return the robot's last state, if it is to be trusted; raises otherwise."""
        if robot not in self.seen:
            raise ValueError(f"{robot}: never seen")
        state, stamp = self.seen[robot]
        if not abs(now - stamp) <= self.limits.patience:  # also where either is NaN, or a clock is ahead
            raise ValueError(f"{robot}: seen {now - stamp:.2f} s ago")
        if len(state) != 4 or not all(map(math.isfinite, state)):
            raise ValueError(f"{robot}: broken state {list(state)}")
        return state


def load_policy(file: Path) -> Decide:
    """Return the policy in a file that `apollonius export --to onnx` wrote."""
    import numpy as np
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])

    bits = {one.name: np.uint32(0) for one in session.get_inputs() if one.name == "bits"}

    def decide(state: Sequence[float]) -> Sequence[float]:
        return session.run(["controls"], {"state": np.array(state, np.float32).reshape(2, 4), **bits})[0].tolist()

    return decide
