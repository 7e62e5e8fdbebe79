"""Robots of several kinds, of which each game draws one: bodies, sensors and drives."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.sensing import Noise, Sensing, Sensors
from apollonius.game.types import Real, Role
from apollonius.io.errors import require

_WHOLE = "delay", "lag"
"""Numbers that are whole."""
_PARTS = {"sensors": Sensing, "drives": Drives, "noise": Noise, "own_noise": Noise}
"""Parts that a game need not have, by their names."""
_OF_A_SIDE = {Sensing: Sensors, Drives: Drive}
"""What a side has of them."""


@dataclass(frozen=True)
class Spread:
    """Numbers that each game draws, each apart: uniform, of whole ones both ends included.

    Attributes:
        fields: their dotted paths in a game, as `pursuer.v_max` or `sensors.pursuer.noise.heading`.
        low, high: least and largest value.
    """

    fields: tuple[str, ...]
    low: float
    high: float

    def __post_init__(self) -> None:
        require(self.low <= self.high, f"{', '.join(self.fields)}: low", self.low, f"at most high = {self.high}")


class RobotKinds(eqx.Module):
    """Pairs of robots of several kinds, leaves `[kinds]`, with the capture distance of each [m].

    Sensors and drives are those of the game where they are None.
    """

    pursuer: Unicycle
    evader: Unicycle
    capture_distance: Float[Array, " kinds"]
    sensors: Sensing | None = None
    drives: Drives | None = None

    def __len__(self) -> int:
        return len(self.capture_distance)

    def every(self, role: Role) -> list[Unicycle]:
        """Return the robots of one side in plain numbers."""
        bodies = self.evader if role == Role.EVADER else self.pursuer
        return [jax.tree.map(lambda leaf, one=one: float(leaf[one]), bodies) for one in range(len(self))]

    def spread(self, spreads: Sequence[Spread]) -> "RobotKinds":
        """Return kinds whose numbers of these fields are drawn, always the same ones.

        Raises:
            InvalidInput: for a field that robots do not have, and for impossible values.
        """
        rng, count, kinds = np.random.default_rng(0), len(self), self
        for one in spreads:
            for field in one.fields:
                for end in (one.low, one.high):
                    alone = _with(RobotKinds(Unicycle(), Unicycle(), jnp.ones(1)), field.split("."), end, field)
                    for part in (alone.sensors, alone.drives):
                        if part is not None:
                            part.check()
                if field.rpartition(".")[2] in _WHOLE:
                    values = rng.integers(int(one.low), int(one.high) + 1, count)
                else:
                    values = rng.uniform(one.low, one.high, count)
                kinds = _with(kinds, field.split("."), jnp.asarray(values, jnp.float32), field)
        return jax.tree.map(lambda leaf: jnp.broadcast_to(jnp.asarray(leaf, jnp.float32), (count,)), kinds)


def _with(part: Any, path: Sequence[str], value: Real, field: str) -> Any:
    """Return a part of the kinds with a value at a path; parts on it that are None begin with their defaults."""
    name, *rest = path
    known = [one.name for one in fields(part)]
    require(name in known, "field", field, f"of the robots: '{name}' is none of {', '.join(known)}")
    inner, kind = getattr(part, name), _PARTS.get(name) or _OF_A_SIDE.get(type(part))
    is_part = kind is not None or (isinstance(part, RobotKinds) and name != "capture_distance")
    require(is_part == bool(rest), "field", field, "the whole path of one number")
    if rest and inner is None and kind is not None:
        inner = kind()
    return replace(part, **{name: _with(inner, rest, value, field) if rest else value})
