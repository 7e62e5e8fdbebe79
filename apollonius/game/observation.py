"""What a robot sees: both states (Eq. 6, 7), scaled; or the same, encoded for a network.

Every observation is that of one robot, `own`, facing another, `opponent`. An observation is named by its profile, and
an agent's file says which one it was made for.

`paper`, 8 numbers (Eq. 7): x, y, v, heading of `own`, then of `opponent`. Positions and speeds are mapped linearly
from their limits to [-1, 1], headings are divided by pi.

`encoded`, 17 numbers: of each robot x, y, v as above and the cosine and sine of its heading (10); the opponent's
position ahead of and to the left of `own`, and its distance, over the arena's longer side (3); of each robot the
clearance [m] where it stands and where it would come to rest if it braked straight ahead, clipped to [-1, 1] (4).
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.errors import require
from apollonius.game.apart import computed_apart
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Real, RobotState, Scalar

OBSERVATION_SIZES = {"paper": 8, "encoded": 17}
"""Numbers in an observation of each profile."""
_ROBOT_SIZES = {"paper": 4, "encoded": 5}
"""Numbers that describe one robot; those of `own` come first, then those of `opponent`."""


def _scale(value: Scalar, low: Real, high: Real) -> Scalar:
    """Map [low, high] to [-1, 1]."""
    return (2 * value - (low + high)) / jnp.maximum(high - low, 1e-6)


def _position_and_speed(arena: Arena, body: Unicycle, robot: RobotState) -> list[Scalar]:
    return [
        _scale(robot.x, arena.x_min, arena.x_max),
        _scale(robot.y, arena.y_min, arena.y_max),
        _scale(robot.v, body.v_min, body.v_max),
    ]


@computed_apart
def _turned(heading: Scalar) -> tuple[Scalar, Scalar]:
    """Cosine and sine of a heading, which several numbers of an observation are made of."""
    return jnp.cos(heading), jnp.sin(heading)


def _clearances(arena: Arena, body: Unicycle, robot: RobotState, cos: Scalar, sin: Scalar) -> list[Scalar]:
    """Clearance [m] of the body here, and at the point where braking straight ahead would stop it."""
    braking = jnp.maximum(robot.v, 0.0) ** 2 / jnp.maximum(2 * body.u1_max, 1e-6)
    here = arena.clearance(robot.x, robot.y)
    ahead = arena.clearance(robot.x + braking * cos, robot.y + braking * sin)
    return [jnp.clip(here - body.radius, -1.0, 1.0), jnp.clip(ahead - body.radius, -1.0, 1.0)]


def observe(
    profile: str, arena: Arena, own_body: Unicycle, own: RobotState, opponent_body: Unicycle, opponent: RobotState
) -> Float[Array, " size"]:
    """The observation of `own` facing `opponent`, in the named profile (Eq. 6, 7).

    Raises:
        InvalidInput: for an unknown profile.
    """
    require(profile in OBSERVATION_SIZES, "observation", profile, f"one of {', '.join(OBSERVATION_SIZES)}")
    robots = ((own_body, own), (opponent_body, opponent))
    parts: list[Scalar] = []
    if profile == "paper":
        for body, robot in robots:
            parts += [*_position_and_speed(arena, body, robot), robot.heading / jnp.pi]
        return jnp.stack(parts)
    directions = [_turned(robot.heading) for _, robot in robots]
    for (body, robot), direction in zip(robots, directions, strict=True):
        parts += [*_position_and_speed(arena, body, robot), *direction]
    size = jnp.maximum(arena.x_max - arena.x_min, arena.y_max - arena.y_min)
    dx, dy = (opponent.x - own.x) / size, (opponent.y - own.y) / size
    cos, sin = directions[0]
    parts += [cos * dx + sin * dy, cos * dy - sin * dx, jnp.hypot(dx, dy)]
    for (body, robot), direction in zip(robots, directions, strict=True):
        parts += _clearances(arena, body, robot, *direction)
    return jnp.stack(parts)


def own_state(profile: str, arena: Arena, own_body: Unicycle, observation: Float[Array, " size"]) -> RobotState:
    """The state of `own` that an observation tells."""
    return _robot_state(profile, arena, own_body, observation)


def both_states(
    profile: str, arena: Arena, own_body: Unicycle, opponent_body: Unicycle, observation: Float[Array, " size"]
) -> tuple[RobotState, RobotState]:
    """The states of `own` and `opponent` that an observation tells: `observe`, undone."""
    rest = observation[_ROBOT_SIZES[profile] :]
    return (
        _robot_state(profile, arena, own_body, observation),
        _robot_state(profile, arena, opponent_body, rest),
    )


def _robot_state(profile: str, arena: Arena, body: Unicycle, numbers: Float[Array, " rest"]) -> RobotState:
    """The state of the robot that the first of these numbers of an observation describe."""
    return RobotState(
        x=_unscale(numbers[0], arena.x_min, arena.x_max),
        y=_unscale(numbers[1], arena.y_min, arena.y_max),
        v=_unscale(numbers[2], body.v_min, body.v_max),
        heading=numbers[3] * jnp.pi if profile == "paper" else jnp.arctan2(numbers[4], numbers[3]),
    )


def _unscale(value: Scalar, low: Real, high: Real) -> Scalar:
    """Map [-1, 1] to [low, high]."""
    return (value * (high - low) + low + high) / 2
