"""Bags of robots whose drives are known: `python benchmarks/identified_bags.py FILE` drives 100
robots with bodies in MuJoCo, identifies each from what it recorded, and counts the true values
that lie within their 95 % intervals.

Each robot has limits, delays, masses and noise of its own, and is driven as
docs/how-to/ros2.md describes, for about 80 s. Odometry comes 20 to 50 times a second, commands
come 10 times.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.io.document import to_json, write_atomically
from apollonius.simulate.drive import References, RobotHardware
from apollonius.simulate.drive_record import DriveRecord
from apollonius.simulate.identification import Estimate, identify
from apollonius.simulate.physics import Physics

STEP = 0.0025
"""Of the physics [s]."""
PERIOD = 0.1
"""Between two commands [s]."""
SIZE = 10_000
"""Side of the arena, whose walls are out of reach [m]."""


@dataclass(frozen=True)
class Robot:
    """A robot and its sensors, with the true values of all that is identified."""

    hardware: RobotHardware
    latency: float
    v_max: float
    u1_max: float
    u2_max: float
    noise: tuple[float, float, float, float]
    """Standard deviations of position [m], heading [rad], speed [m/s] and turn rate [rad/s]."""
    rate: float
    """Of the odometry [1/s]."""

    @property
    def truth(self) -> dict[str, float]:
        values = {
            "v_max": self.v_max,
            "u1_max": self.u1_max,
            "u2_max": self.u2_max,
            "turn_acceleration": self.hardware.turn_acceleration,
            "latency": self.latency,
            "lag": self.hardware.lag,
        }
        names = ("position", "heading", "speed", "turn_rate")
        return values | dict(zip(names, self.noise, strict=True))


def draw_robot(random: np.random.Generator) -> Robot:
    """Draw a robot between a TurtleBot and a Pioneer, and its limits."""
    share = random.uniform()
    v_max = random.uniform(0.3, 1.2)
    u2_max = random.uniform(0.6, 2.0)
    hardware = RobotHardware(
        mass=4 + 6 * share,
        wheel_mass=0.2 + 0.5 * share,
        wheel_radius=0.036 + 0.06 * share,
        track=0.23 + 0.1 * share,
        caster=0.125 + 0.075 * share,
        mass_behind=0.02 + 0.02 * share,
        chassis_radius=0.165 + 0.025 * share,
        inertia=0.001 + 0.009 * share,
        resistance=0.02 + 0.03 * share,
        torque=1.0 + 5.0 * share,
        stiffness=1.0 + 4.0 * share,
        lag=random.uniform(0.02, 0.2),
        latency=0.0,
        turn_acceleration=u2_max / random.uniform(0.25, 1.0),
    )
    noise = tuple(float(random.uniform(low, high)) for low, high in NOISE)
    return Robot(
        hardware,
        latency=random.uniform(0.02, 0.25),
        v_max=v_max,
        u1_max=v_max / random.uniform(0.7, 2.0),
        u2_max=u2_max,
        noise=noise,  # pyright: ignore[reportArgumentType]
        rate=random.uniform(20, 50),
    )


NOISE = ((0.002, 0.02), (0.002, 0.02), (0.005, 0.03), (0.005, 0.05))
"""Least and largest standard deviations, in the order of `Robot.noise`."""


def holds(robot: Robot, random: np.random.Generator) -> Iterator[tuple[float, float, float]]:
    """Yield speeds [m/s], turn rates [rad/s] and durations [s] of a calibration drive.

    Commands exceed limits, which the driver does not know, by 10 to 60 %.
    """
    v = robot.v_max * random.uniform(1.1, 1.6)
    turn = robot.u2_max * random.uniform(1.1, 1.6)
    ramp = robot.v_max / robot.u1_max
    yield 0.0, 0.0, 8.0
    for _ in range(3):
        yield v, 0.0, ramp + random.uniform(1.5, 2.5)
        yield 0.0, 0.0, ramp + random.uniform(0.5, 1.5)
        yield -v, 0.0, ramp + random.uniform(1.5, 2.5)
        yield 0.0, 0.0, ramp + random.uniform(0.5, 1.5)
    yield robot.v_max / 2, 0.0, 2.0
    for _ in range(3):
        yield robot.v_max / 2, turn, random.uniform(3.0, 4.0)
        yield robot.v_max / 2, -turn, random.uniform(3.0, 4.0)
    yield 0.0, 0.0, 4.0


def commands_of(robot: Robot, random: np.random.Generator) -> Float[np.ndarray, "commands 3"]:
    """Return the times [s], speeds and turn rates of a drive; times jitter by some milliseconds."""
    rows = [
        (v, turn)
        for v, turn, duration in holds(robot, random)
        for _ in range(round(duration / PERIOD))
    ]
    times = np.arange(len(rows)) * PERIOD + random.uniform(0, 0.005, len(rows))
    return np.column_stack([times, np.array(rows)])


def record_drive(robot: Robot, random: np.random.Generator) -> DriveRecord:
    """Drive a robot with a body and record it."""
    commands = commands_of(robot, random)
    body = Unicycle(v_max=robot.v_max, u1_max=robot.u1_max, u2_max=robot.u2_max)
    arena = Arena(0.0, SIZE, 0.0, SIZE)
    physics = Physics(Game(arena=arena, dt=STEP, pursuer=body, evader=body), robot.hardware)
    states = physics.set_poses(np.array([[SIZE / 2, SIZE / 2, 0, 0, 9, 9, 0, 0]], float))
    references = References(np.zeros((1, 2)))
    speeds = np.array([[-robot.v_max, robot.v_max]] * 2)
    turning = np.full(2, robot.hardware.turn_acceleration)
    period = round(1 / robot.rate / physics.step)
    samples = int(commands[-1, 0] / (period * physics.step))
    rows = np.empty((samples, 5))
    for sample in range(samples):
        wheels = np.empty((1, period, 4))
        for step in range(period):
            time = (sample * period + step + 0.5) * physics.step - robot.latency
            command = commands[max(int(np.searchsorted(commands[:, 0], time)) - 1, 0), 1:]
            command = command * (time >= commands[0, 0])
            u1 = (command[0] - references.v[0, 0]) / physics.step
            u1 = np.clip(u1, -robot.u1_max, robot.u1_max)
            turn = np.clip(command[1], -robot.u2_max, robot.u2_max)
            controls = np.array([[[u1, turn], [0, 0]]])
            follow = (robot.hardware, controls, speeds, 1, physics.step, turning)
            wheels[:, step] = references.follow(*follow)[:, 0]
        states = physics.advance(states, wheels)
        x, y, v, heading = physics.measure(states)[0, :4]
        rows[sample] = x, y, heading, v, physics.turn_rates(states)[0, 0]
    position, heading, speed, turn = robot.noise
    rows += random.normal(size=rows.shape) * [position, position, heading, speed, turn]
    times = (np.arange(samples) + 1) * period * physics.step
    return DriveRecord(times, *rows.T, *commands.T)


@dataclass
class Count:
    """What became of a number of the robots.

    Attributes:
        unidentified: bags that gave none.
        identified: bags that gave an estimate.
        inside: bags whose 95 % interval holds the true value.
        errors: of the estimates, as shares of the true values.
        reaches: half widths of the intervals, as shares of the true values.
        misses: the bags whose interval lies elsewhere.
    """

    unidentified: list[int] = field(default_factory=list[int])
    identified: int = 0
    inside: int = 0
    errors: list[float] = field(default_factory=list[float])
    reaches: list[float] = field(default_factory=list[float])
    misses: list[dict[str, float]] = field(default_factory=list[dict[str, float]])

    def add(self, bag: int, truth: float, estimate: Estimate) -> bool:
        """Count an estimate; return whether its interval holds the true value."""
        if estimate.value is None:
            self.unidentified.append(bag)
            return False
        is_inside = estimate.low <= truth <= estimate.high
        self.identified += 1
        self.inside += is_inside
        self.errors.append(estimate.value / truth - 1)
        self.reaches.append((estimate.high - estimate.low) / 2 / truth)
        if not is_inside:
            ends = {"low": estimate.low, "high": estimate.high}
            self.misses.append({"bag": bag, "true": truth} | ends)
        return is_inside

    def summary(self) -> dict[str, Any]:
        return {
            "identified": self.identified,
            "bags without": self.unidentified,
            "inside": self.inside,
            "median error": float(np.median(self.errors)),
            "median of the half width": float(np.median(self.reaches)),
            "misses": self.misses,
        }


def main() -> None:
    """Drive, identify and count; write the counts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--bags", type=int, default=100, help="(default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="(default: %(default)s)")
    options = parser.parse_args()
    counts: dict[str, Count] = {}
    whole_bags = 0
    for bag in range(options.bags):
        random = np.random.default_rng([options.seed, bag])
        robot = draw_robot(random)
        identified = identify(record_drive(robot, random))
        estimates = identified.drive | identified.noise
        inside = [
            counts.setdefault(name, Count()).add(bag, truth, estimates[name])
            for name, truth in robot.truth.items()
        ]
        whole_bags += all(inside)
        misses = [
            name for name, is_inside in zip(robot.truth, inside, strict=True) if not is_inside
        ]
        print(f"bag {bag}: {', '.join(misses) or 'all'} {'not ' * bool(misses)}inside", flush=True)
    result = {
        "command": "python benchmarks/identified_bags.py FILE",
        "seed": options.seed,
        "bags": options.bags,
        "bags with all true values inside": whole_bags,
        "numbers": {name: count.summary() for name, count in counts.items()},
    }
    write_atomically(options.out, f"{to_json(result, indent=1)}\n".encode())


if __name__ == "__main__":
    main()
