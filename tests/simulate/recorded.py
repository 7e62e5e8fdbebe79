"""Drives on record: commands, and the odometry of a robot that follows them as the simulation's drives do."""

import math
from dataclasses import dataclass

import numpy as np

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


def towards(value, goal, reach):
    return value + min(max(goal - value, -reach), reach)


def motion(robot, commands):
    """Rows of time, x, y, heading, speed and turn rate, one for each step."""
    times = np.arange(1, int((commands[-1, 0] + 0.3) / STEP) + 1) * STEP
    places = np.searchsorted(commands[:, 0], times - STEP / 2 - robot.latency) - 1
    asked = np.where(places[:, None] >= 0, commands[np.maximum(places, 0), 1:], 0.0)
    lowest, highest = [robot.v_min, -robot.u2_max], [robot.v_max, robot.u2_max]
    fade = 1 - math.exp(-STEP / robot.lag)
    v_followed = turn_followed = x = y = heading = v = turn = 0.0
    rows = []
    for time, (v_asked, turn_asked) in zip(times, np.clip(asked, lowest, highest).tolist(), strict=True):
        v_followed = towards(v_followed, v_asked, robot.u1_max * STEP)
        turn_followed = towards(turn_followed, turn_asked, robot.turn_acceleration * STEP)
        v, turn = v + fade * (v_followed - v), turn + fade * (turn_followed - turn)
        heading += turn * STEP
        x, y = x + v * math.cos(heading) * STEP, y + v * math.sin(heading) * STEP
        rows.append((time, x, y, heading, v, turn))
    return np.array(rows)


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
