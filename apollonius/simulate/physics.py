"""MuJoCo at work: many games' robots, placed, moved and looked at."""

from importlib import import_module
from math import cos, sin
from typing import Any

import numpy as np
from jaxtyping import Float, Float64

from apollonius.errors import InvalidInput, require
from apollonius.extras import install
from apollonius.game.game import Game
from apollonius.simulate.drive import Drive
from apollonius.simulate.scene import SIDES, WHEELS, mjcf

LONGEST_STEP = 0.005
"""Of the physics [s]; a step of the game is divided into the fewest steps that are no longer."""


class Physics:
    """The model of a game. States are MuJoCo's own, a row for each game.

    Raises:
        InvalidInput: where MuJoCo is not installed, for a latency of more than a step of the game, and as `mjcf`.
    """

    def __init__(self, game: Game, drive: Drive) -> None:
        try:
            self._mujoco: Any = import_module("mujoco")  # not by name: it has no types, and is needed nowhere else
            rollout: Any = import_module("mujoco.rollout")
        except ModuleNotFoundError as error:
            raise InvalidInput(f"robots with bodies need MuJoCo: {install('sim')}.") from error
        dt = float(game.dt)
        require(drive.latency <= dt, "latency", drive.latency, f"at most one step of the game, {dt:g} s")
        self.drive = drive
        self.steps = int(np.ceil(dt / LONGEST_STEP - 1e-6))
        self.step = dt / self.steps
        self.model = self._mujoco.MjModel.from_xml_string(mjcf(game, drive, self.step))
        self._data = self._mujoco.MjData(self.model)
        self._rollout = rollout.Rollout(nthread=1)

    def place(self, rows: Float[np.ndarray, "games 8"]) -> Float64[np.ndarray, "games numbers"]:
        """States in which the robots stand, or roll, where rows of x, y, v and heading say."""
        data, kind = self._data, self._mujoco.mjtState.mjSTATE_FULLPHYSICS
        states = np.empty((len(rows), self._mujoco.mj_stateSize(self.model, kind)))
        for row, state in zip(rows.astype(float).reshape(-1, 2, 4), states, strict=True):
            self._mujoco.mj_resetData(self.model, data)
            for side, (x, y, v, heading) in zip(SIDES, row, strict=True):
                joint = data.joint(side)
                joint.qpos[:] = [x, y, self.drive.wheel_radius, cos(heading / 2), 0, 0, sin(heading / 2)]
                joint.qvel[:2] = v * cos(heading), v * sin(heading)
                for wheel in WHEELS:
                    turning = v / self.drive.wheel_radius
                    data.joint(f"{side} {wheel}").qvel[0] = turning
                    if self.model.na:
                        data.act[self.model.actuator(f"{side} {wheel}").actadr[0]] = turning
            self._mujoco.mj_getState(self.model, data, state, kind)
        return states

    def advance(
        self, states: Float64[np.ndarray, "games numbers"], wheel_speeds: Float[np.ndarray, "games steps 4"]
    ) -> Float64[np.ndarray, "games numbers"]:
        """States after a step of the physics for each of the wheel speeds asked for [rad/s]."""
        moved, _ = self._rollout.rollout(self.model, self._data, states, wheel_speeds)
        return moved[:, -1]

    def measure(self, states: Float64[np.ndarray, "games numbers"]) -> Float64[np.ndarray, "games 8"]:
        """What the game knows of states: x, y, forward speed and heading of pursuer and evader."""
        positions, speeds = np.split(states[:, 1 : 1 + self.model.nq + self.model.nv], [self.model.nq], axis=1)
        columns = []
        for side in SIDES:
            joint = self.model.joint(side)
            x, y, _, w, i, j, k = positions[:, joint.qposadr[0] : joint.qposadr[0] + 7].T
            heading = np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
            along_x, along_y = speeds[:, joint.dofadr[0] : joint.dofadr[0] + 2].T
            columns += [x, y, along_x * np.cos(heading) + along_y * np.sin(heading), heading]
        return np.stack(columns, axis=-1)
