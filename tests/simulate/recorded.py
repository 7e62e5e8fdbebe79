"""Drives on record: commands, and the odometry of a robot that follows them as the simulation's drives do."""

from dataclasses import dataclass

import numpy as np

from apollonius.simulate.drive import References, RobotHardware
from apollonius.simulate.drive_record import DriveRecord

STEP = 0.005
"""Of the motion [s]."""
ROUND = [(v, 0, 3) for v in (0.9, 0, -0.9, 0)] * 2
TURNS = [(0.3, turn, 3) for turn in (1.4, -1.4)] * 3
REST = [(0, 0, 6)]
CALIBRATION = [*REST, *ROUND, *TURNS, *REST]
"""Speeds [m/s], turn rates [rad/s] and durations [s] of a calibration drive."""


@dataclass(frozen=True)
class Robot:
    """A robot with its odometry; noise is of position, heading, speed and turn rate."""

    v_min: float = -0.7
    v_max: float = 0.7
    u1_max: float = 0.5
    u2_max: float = 1.0
    turn_acceleration: float = 2.0
    latency: float = 0.12
    lag: float = 0.08
    noise: tuple[float, ...] = (0.01, 0.008, 0.015, 0.02)
    rate: float = 40.0


def command_rows(holds, period=0.1):
    """The times, speeds and turn rates of commands."""
    rows = [(v, turn) for v, turn, duration in holds for _ in range(round(duration / period))]
    return np.column_stack([np.arange(len(rows)) * period, np.array(rows, float)])


def motion(robot, commands):
    """Rows of time, x, y, heading, speed and turn rate, one for each step."""
    steps = int((commands[-1, 0] + 0.3) / STEP)
    times = np.arange(1, steps + 1) * STEP
    asked = np.searchsorted(commands[:, 0], times - STEP / 2 - robot.latency) - 1
    rows = np.where(asked[:, None] >= 0, commands[np.maximum(asked, 0), 1:], 0.0)
    hardware = RobotHardware(latency=0.0, turn_acceleration=robot.turn_acceleration)
    references, out, actual = References(np.zeros((1, 1))), np.empty((steps, 6)), np.zeros(2)
    x = y = heading = 0.0
    limits, turning = np.array([[robot.v_min, robot.v_max]]), np.array([robot.turn_acceleration])
    fade = 1 - np.exp(-STEP / robot.lag) if robot.lag else 1.0
    for step, (v, turn) in enumerate(rows):
        u1 = np.clip((v - references.v[0, 0]) / STEP, -robot.u1_max, robot.u1_max)
        controls = np.array([[[u1, np.clip(turn, -robot.u2_max, robot.u2_max)]]])
        references.follow(hardware, controls, limits, 1, STEP, turning)
        actual += fade * (np.array([references.v[0, 0], references.turn_rate[0, 0]]) - actual)
        heading += actual[1] * STEP
        x, y = x + actual[0] * np.cos(heading) * STEP, y + actual[0] * np.sin(heading) * STEP
        out[step] = times[step], x, y, heading, *actual
    return out


def record_of(robot, holds=CALIBRATION, seed=0, jitter=0.0, lost=0.0, commands=None):
    """What a robot recorded; odometry comes unevenly by `jitter`, a share of it is `lost`."""
    rng = np.random.default_rng(seed)
    commands = command_rows(holds) if commands is None else commands
    rows = motion(robot, commands)
    times = np.arange(0.1, rows[-1, 0], 1 / robot.rate)
    times = np.sort(times + rng.uniform(0, jitter, len(times)) / robot.rate)[rng.random(len(times)) >= lost]
    columns = np.array([np.interp(times, rows[:, 0], column) for column in rows[:, 1:].T])
    position, *others = robot.noise
    columns += rng.normal(size=columns.shape) * np.array([position, position, *others])[:, None]
    columns[2] = (columns[2] + np.pi) % (2 * np.pi) - np.pi
    return DriveRecord(times, *columns, *commands.T)
