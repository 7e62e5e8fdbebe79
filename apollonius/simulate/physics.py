"""MuJoCo at work: a game as its model, and many games' robots, placed, moved and looked at."""

from collections.abc import Iterator
from importlib import import_module
from math import atan2, cos, hypot, sin
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from jaxtyping import Bool, Float, Float64

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.models import require_unicycle
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Polygon
from apollonius.game.types import Real, Role
from apollonius.io.errors import InvalidInput, require, require_extra
from apollonius.simulate.drive import RobotHardware

WHEELS = ("left", "right")
SHELL = 0.01
"""Difference [m] between the radius of the body, which the referee measures, and that of the shell,
which obstacles push back.
"""
REST = 0.01
"""Speed [m/s] below which a body is at rest in a game with movers, which may then walk into it; a
drive that stands rolls out for ever.
"""
_HEIGHT = 0.3
_THICKNESS = 0.05
# A geom collides with those whose kind is in its `conaffinity`. Robots do not touch each other.
_FLOOR = "1"
_OBSTACLE = "2"
_NOTHING = "0"
_COLOURS = {"pursuer": "0.8 0.2 0.2 1", "evader": "0.2 0.4 0.8 1"}
_ABOVE = 0.06
"""Height of the middle of the chassis above the axle [m]."""


def robots_of(game: Game) -> dict[str, Unicycle]:
    """Return the bodies of the pursuers and then of the evaders by their names: `pursuer`, `pursuer
    2` and so on.
    """
    return {
        f"{role.name.lower()} {number + 1}".removesuffix(" 1"): body
        for role in Role
        for number, body in enumerate(game.bodies[role])
    }


def mjcf(game: Game, drive: RobotHardware, step: float) -> str:
    """Return the model as text, for a physics of steps of `step` [s]; raises InvalidInput for an
    obstacle of another kind, and for a robot that is not driven by two wheels.

    Walls stand outside the arena's bounds. Discs are cylinders; a polygon is its edges, since
    MuJoCo would fill a hollow one; a map is boxes of its cells. Robots do not touch each other:
    whether the evader is caught is for the referee to say.
    """
    bound = "discs, polygons and maps, the only ones that robots with bodies know"
    game.arena.require_only((Disc, Polygon, OccupancyMap), bound)
    robots = robots_of(game)
    for side, body in robots.items():
        require_unicycle(body, side, "simulate, whose robots have two driven wheels,")
    model = Element("mujoco", model="pursuit-evasion")
    SubElement(model, "option", timestep=f"{step:.9g}", integrator="implicitfast", cone="elliptic")
    world = SubElement(model, "worldbody")
    _geom(world, "floor", "plane", size=(0, 0, 1), kind=_FLOOR)
    for number, attributes in enumerate(_obstacles(game.arena)):
        _geom(world, f"obstacle {number}", kind=_OBSTACLE, rgba="0.35 0.35 0.35 1", **attributes)
    actuators = SubElement(model, "actuator")
    for side, body in robots.items():
        _add_robot(world, actuators, side, drive, float(body.radius))
    ElementTree.indent(model)
    return ElementTree.tostring(model, encoding="unicode")


def _numbers(*values: Real) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _geom(
    parent: Element,
    name: str,
    shape: str,
    kind: str = _NOTHING,
    meets: str = _NOTHING,
    **more: object,
) -> None:
    texts = {
        key: _numbers(*value) if isinstance(value, tuple) else str(value)
        for key, value in more.items()
    }
    SubElement(parent, "geom", name=name, type=shape, contype=kind, conaffinity=meets, attrib=texts)


def _obstacles(arena: Arena) -> Iterator[dict[str, Any]]:
    out = _THICKNESS
    x_min, y_min = float(arena.x_min) - out, float(arena.y_min) - out
    x_max, y_max = float(arena.x_max) + out, float(arena.y_max) + out
    corners = [(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)]
    yield from _edges(corners, _THICKNESS)
    for disc in arena.discs:
        place = (float(disc.x), float(disc.y), _HEIGHT / 2)
        yield {"shape": "cylinder", "size": (float(disc.radius), _HEIGHT / 2), "pos": place}
    for polygon in arena.polygons:
        yield from _edges([(float(x), float(y)) for x, y in polygon.vertices], 1e-3)
    cells = arena.map
    if cells is not None:
        for row, column, rows, columns in rectangles(cells.occupied()):
            half_x = columns * float(cells.cell) / 2
            half_y = rows * float(cells.cell) / 2
            x = float(cells.x + column * cells.cell) + half_x
            y = float(cells.y + row * cells.cell) + half_y
            yield {
                "shape": "box",
                "size": (half_x, half_y, _HEIGHT / 2),
                "pos": (x, y, _HEIGHT / 2),
            }


def rectangles(cells: Bool[np.ndarray, "rows columns"]) -> Iterator[tuple[int, int, int, int]]:
    """Yield first row, first column, rows and columns of rectangles that cover each of these cells
    once.
    """
    uncovered = cells.copy()
    while uncovered.any():
        row, column = map(int, np.unravel_index(uncovered.argmax(), uncovered.shape))
        right_of_it = uncovered[row, column:]
        columns = right_of_it.size if right_of_it.all() else int(right_of_it.argmin())
        full = uncovered[row:, column : column + columns].all(axis=1)
        rows = full.size if full.all() else int(full.argmin())
        uncovered[row : row + rows, column : column + columns] = False
        yield row, column, rows, columns


def _edges(corners: list[tuple[float, float]], half_thickness: float) -> Iterator[dict[str, Any]]:
    for (x, y), (next_x, next_y) in zip(corners, [*corners[1:], corners[0]], strict=True):
        half = atan2(next_y - y, next_x - x) / 2
        yield {
            "shape": "box",
            "size": (hypot(next_x - x, next_y - y) / 2, half_thickness, _HEIGHT / 2),
            "pos": ((x + next_x) / 2, (y + next_y) / 2, _HEIGHT / 2),
            "quat": (cos(half), 0, 0, sin(half)),
        }


def _add_robot(
    world: Element, actuators: Element, side: str, drive: RobotHardware, radius: float
) -> None:
    """Add a chassis with two wheels and a caster; its frame is on the axle, x ahead.

    Obstacles push the robot where the game's has a radius; one that is a point is judged by its
    centre alone.
    """
    body = SubElement(world, "body", name=side, pos=_numbers(0, 0, drive.wheel_radius))
    SubElement(body, "freejoint", name=side)
    _geom(
        body,
        f"{side} chassis",
        "cylinder",
        size=(drive.chassis_radius, 0.1),
        pos=(-drive.mass_behind, 0, _ABOVE),
        mass=drive.mass - 2 * drive.wheel_mass,
        rgba=_COLOURS[side.split()[0]],
    )
    if radius > 2 * SHELL:
        _add_shell(body, side, radius)
    _add_caster(body, side, drive)
    for wheel, place in zip(WHEELS, (1, -1), strict=True):
        _add_wheel(body, f"{side} {wheel}", place, drive)
        _add_motor(actuators, f"{side} {wheel}", drive)


def _add_shell(body: Element, side: str, radius: float) -> None:
    """Add the part of a robot that obstacles push, which weighs nothing."""
    _geom(
        body,
        f"{side} shell",
        "cylinder",
        meets=_OBSTACLE,
        size=(radius - SHELL, 0.1),
        pos=(0, 0, _ABOVE),
        mass=0,
        group=3,
    )


def _add_caster(body: Element, side: str, drive: RobotHardware) -> None:
    """Add a ball that rolls freely in every direction: next to no friction, and its own counts,
    not the floor's.
    """
    ball = 0.4 * drive.wheel_radius
    _geom(
        body,
        f"{side} caster",
        "sphere",
        meets=_FLOOR,
        size=(ball,),
        pos=(-drive.caster, 0, ball - drive.wheel_radius),
        mass=0,
        friction=(0.01, 0, 0),
        priority=1,
    )


def _add_wheel(body: Element, name: str, place: int, drive: RobotHardware) -> None:
    """Add a wheel on the left, `place` 1, or on the right, -1."""
    part = SubElement(body, "body", name=name, pos=_numbers(0, place * drive.track / 2, 0))
    joint = {"frictionloss": _numbers(drive.resistance), "armature": _numbers(drive.inertia)}
    SubElement(part, "joint", name=name, axis="0 1 0", attrib=joint)
    _geom(
        part,
        name,
        "ellipsoid",
        meets=_FLOOR,
        # crowned, so that it touches the floor in one point
        size=(drive.wheel_radius, 0.02, drive.wheel_radius),
        mass=drive.wheel_mass,
        friction=(drive.friction, 0.005, 0.0001),
        condim=4,
        priority=1,
    )


def _add_motor(actuators: Element, name: str, drive: RobotHardware) -> None:
    """Add the motor of a wheel, which holds a speed as far as its torque allows."""
    motor = {
        "joint": name,
        "gainprm": _numbers(drive.stiffness),
        "biastype": "affine",
        "biasprm": _numbers(0, 0, -drive.stiffness),
        "forcerange": _numbers(-drive.torque, drive.torque),
    }
    lag = {"dyntype": "filterexact", "dynprm": _numbers(drive.lag)} if drive.lag else {}
    SubElement(actuators, "general", name=name, attrib=motor | lag)


LONGEST_STEP = 0.005
"""Of the physics [s]; a step of the game is divided into the fewest steps that are no longer."""


class Physics:
    """The model of a game. States are MuJoCo's own, a row for each game.

    Raises:
        InvalidInput: where MuJoCo is not installed, for a latency of more than a step of the game,
            and as `mjcf`.
    """

    def __init__(self, game: Game, drive: RobotHardware) -> None:
        require_extra("sim", "simulate")
        # not by name: it has no types, and is needed nowhere else
        self._mujoco: Any = import_module("mujoco")
        rollout: Any = import_module("mujoco.rollout")
        dt = float(game.dt)
        require(
            drive.latency <= dt, "latency", drive.latency, f"at most one step of the game, {dt:g} s"
        )
        self.drive = drive
        self._rest = REST if game.movers else 0.0
        self.robots = tuple(robots_of(game))
        self.steps = int(np.ceil(dt / LONGEST_STEP - 1e-6))
        self.step = dt / self.steps
        self.model = self._mujoco.MjModel.from_xml_string(mjcf(game, drive, self.step))
        self._data = self._mujoco.MjData(self.model)
        self._rollout = rollout.Rollout(nthread=1)

    def set_poses(
        self, rows: Float[np.ndarray, "games columns"]
    ) -> Float64[np.ndarray, "games numbers"]:
        """Return states in which the robots stand, or roll, where rows of x, y, v and heading
        say.
        """
        data, kind = self._data, self._mujoco.mjtState.mjSTATE_FULLPHYSICS
        states = np.empty((len(rows), self._mujoco.mj_stateSize(self.model, kind)))
        for row, state in zip(rows.astype(float).reshape(len(rows), -1, 4), states, strict=True):
            self._mujoco.mj_resetData(self.model, data)
            for side, (x, y, v, heading) in zip(self.robots, row, strict=True):
                joint = data.joint(side)
                joint.qpos[:] = [
                    x,
                    y,
                    self.drive.wheel_radius,
                    cos(heading / 2),
                    0,
                    0,
                    sin(heading / 2),
                ]
                joint.qvel[:2] = v * cos(heading), v * sin(heading)
                for wheel in WHEELS:
                    turning = v / self.drive.wheel_radius
                    data.joint(f"{side} {wheel}").qvel[0] = turning
                    if self.model.na:
                        data.act[self.model.actuator(f"{side} {wheel}").actadr[0]] = turning
            self._mujoco.mj_getState(self.model, data, state, kind)
        return states

    def advance(
        self,
        states: Float64[np.ndarray, "games numbers"],
        wheel_speeds: Float[np.ndarray, "games steps wheels"],
    ) -> Float64[np.ndarray, "games numbers"]:
        """Return the states after a step of the physics for each of the wheel speeds asked for
        [rad/s].

        Raises InvalidInput where MuJoCo warns of its numbers: it would put such a robot back to
        where it began.
        """
        warnings: list[str] = []
        # Without a handler MuJoCo writes MUJOCO_LOG.TXT into the current folder.
        self._mujoco.set_mju_user_warning(warnings.append)
        try:
            trajectories, _ = self._rollout.rollout(self.model, self._data, states, wheel_speeds)
        finally:
            self._mujoco.set_mju_user_warning(None)
        if warnings:
            raise InvalidInput(
                f"MuJoCo cannot simulate these robots ({warnings[0]}): make masses, inertia, "
                "torque and stiffness of the drive more like a real robot's."
            )
        return trajectories[:, -1]

    def measure(
        self, states: Float64[np.ndarray, "games numbers"]
    ) -> Float64[np.ndarray, "games columns"]:
        """Return the game's view of states: x, y, forward speed and heading of pursuers, then
        evaders. In a game with movers a speed below `REST` is 0.
        """
        positions, speeds = np.split(
            states[:, 1 : 1 + self.model.nq + self.model.nv], [self.model.nq], axis=1
        )
        columns = []
        for side in self.robots:
            joint = self.model.joint(side)
            x, y, _, w, i, j, k = positions[:, joint.qposadr[0] : joint.qposadr[0] + 7].T
            heading = np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
            along_x, along_y = speeds[:, joint.dofadr[0] : joint.dofadr[0] + 2].T
            speed = along_x * np.cos(heading) + along_y * np.sin(heading)
            columns += [x, y, np.where(np.abs(speed) < self._rest, 0.0, speed), heading]
        return np.stack(columns, axis=-1)

    def turn_rates(
        self, states: Float64[np.ndarray, "games numbers"]
    ) -> Float64[np.ndarray, "games robots"]:
        """Return the turn rates of robots in some states [rad/s], as a gyroscope measures them."""
        first = 1 + self.model.nq
        return np.stack(
            [states[:, first + self.model.joint(side).dofadr[0] + 5] for side in self.robots],
            axis=-1,
        )
