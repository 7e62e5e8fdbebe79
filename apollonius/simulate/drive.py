"""A differential drive: what it weighs and measures, and how its controller follows a policy's
controls.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from apollonius.arenas.file import from_dict
from apollonius.io.document import parse_toml, read_bytes
from apollonius.io.errors import require, require_within

_BOUNDS = {
    "mass": (0.01, 10_000),
    "wheel_mass": (0.001, 1_000),
    "wheel_radius": (0.005, 2),
    "track": (0.01, 10),
    "caster": (0.005, 10),
    "mass_behind": (0, 10),
    "chassis_radius": (0.005, 10),
    "friction": (0.0001, 10),
    "inertia": (0, 1_000),
    "resistance": (0, 10_000),
    "torque": (0.001, 100_000),
    "stiffness": (0.001, 100_000),
    "lag": (0, 10),
    "latency": (0, 10),
    "turn_acceleration": (0.001, 1_000_000),
}
"""The least and the largest number of each field: of a toy and of a lorry."""


@dataclass(frozen=True)
class RobotHardware:
    """A robot of about the size of a Pioneer 3-DX; `examples/robots/pioneer.toml` says which
    numbers have a source.

    Two driven wheels stand left and right of the point that the game calls the robot's position; a
    ball caster behind.
    """

    mass: float = 9.0
    """Of the whole robot [kg]."""
    wheel_mass: float = 0.7
    """Of one wheel [kg]."""
    wheel_radius: float = 0.0975
    """Of one wheel [m]."""
    track: float = 0.33
    """From wheel to wheel [m]."""
    caster: float = 0.2
    """Distance of the caster behind the axle [m]."""
    mass_behind: float = 0.04
    """Distance of the chassis' centre of mass behind the axle [m]."""
    chassis_radius: float = 0.19
    """Of the cylinder that gives the chassis its moments of inertia, and that is seen [m]."""
    friction: float = 0.8
    """Coulomb coefficient between tyre and floor."""
    inertia: float = 0.01
    """Of a motor's rotor at the wheel, behind the gearbox [kg m^2]; without it a stiff controller
    rings.
    """
    resistance: float = 0.05
    """Torque that turning a wheel takes at any speed: rolling resistance and gearbox [N m]."""
    torque: float = 3.0
    """Largest torque of a wheel [N m]."""
    stiffness: float = 5.0
    """Torque of the wheel-speed controller for an error of speed [N m per rad/s]."""
    lag: float = 0.05
    """Time constant with which the wheel-speed controller takes up a reference [s]."""
    latency: float = 0.05
    """From the measurement of a state until the controls chosen in it take effect [s]; at most one
    step of the game.
    """
    turn_acceleration: float = 1.745
    """The drive changes its turn rate no faster than this [rad/s^2]."""

    def __post_init__(self) -> None:
        for name, (low, high) in _BOUNDS.items():
            require_within(self, low, high, name)
        bound = f"less than half the mass = {self.mass} kg"
        require(2 * self.wheel_mass < self.mass, "wheel_mass", self.wheel_mass, bound)
        bound = f"less than caster = {self.caster} m, or the robot falls over backwards"
        require(self.mass_behind < self.caster, "mass_behind", self.mass_behind, bound)

    def wheel_speeds(
        self, v: Float[np.ndarray, "*robots"], turn_rate: Float[np.ndarray, "*robots"]
    ) -> np.ndarray:
        """Return the speeds of left and right wheels [rad/s] at a speed [m/s] and a turn rate
        [rad/s].
        """
        half = turn_rate * self.track / 2
        return np.stack([v - half, v + half], axis=-1) / self.wheel_radius


def load_drive(path: Path | None) -> RobotHardware:
    """Return the drive of a .toml file with what is other about a robot, or the usual one; raises
    InvalidInput.
    """
    if path is None:
        return RobotHardware()
    return from_dict(
        RobotHardware,
        parse_toml(read_bytes(path, "a drive's .toml file", "check the path"), path),
        f"'{path}'",
    )


@dataclass
class References:
    """The speeds [m/s], turn rates [rad/s] and controls that the drives of a batch of robots follow
    now.

    It changes as they go; new controls replace those after the latency.
    """

    v: Float[np.ndarray, "games robots"]
    turn_rate: Float[np.ndarray, "games robots"] = field(init=False)
    controls: Float[np.ndarray, "games robots 2"] = field(init=False)

    def __post_init__(self) -> None:
        self.turn_rate = np.zeros_like(self.v)
        self.controls = np.zeros((*self.v.shape, 2))

    def follow(
        self,
        drive: RobotHardware,
        chosen: Float[np.ndarray, "games robots 2"],
        limits: Float[np.ndarray, "robots 2"],
        steps: int,
        h: float,
        turn_acceleration: Float[np.ndarray, " robots"],
    ) -> Float[np.ndarray, "games steps wheels"]:
        """Compute the reference wheel speeds [rad/s] over one step of the game, left and right of
        each robot in turn.

        Args:
            drive: The robots' drive.
            chosen: New controls: acceleration [m/s^2] and turn rate [rad/s].
            limits: Lowest and highest speed of each robot [m/s].
            steps: Steps of the physics in a step of the game.
            h: Duration of a step of the physics [s].
            turn_acceleration: Largest turn acceleration of each robot [rad/s^2].
        """
        wheel_speeds = np.empty((len(self.v), steps, *self.v.shape[1:], 2))
        reach = turn_acceleration * h
        # As in the rules a robot is at rest for the rest of a step before it drives the other way.
        slowest = np.where(self.v > 0, np.maximum(limits[:, 0], 0.0), limits[:, 0])
        reverses = (self.v < 0) & (limits[:, 0] < 0)
        fastest = np.where(reverses, np.minimum(limits[:, 1], 0.0), limits[:, 1])
        for step in range(steps):
            if step * h >= drive.latency - 1e-9:
                self.controls = chosen
            self.v = np.clip(self.v + self.controls[..., 0] * h, slowest, fastest)
            self.turn_rate = self.turn_rate + np.clip(
                self.controls[..., 1] - self.turn_rate, -reach, reach
            )
            wheel_speeds[:, step] = drive.wheel_speeds(self.v, self.turn_rate)
        self.controls = chosen
        return wheel_speeds.reshape(len(wheel_speeds), steps, -1)
