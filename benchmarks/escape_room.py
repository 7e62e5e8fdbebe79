"""Room to escape: for how long a course of the evader stays out of reach of every pursuer.

Two bounds hold for all pursuers in an arena of discs. Its heading is within `u2_max t` of that at
the start, so along each direction it comes only so far: its speed changes at most once, from
braking to driving, in the best case. And it cannot drive farther than along the shortest path
around each disc alone. A course that is out of reach by one of the two at each time is not caught,
whatever the pursuer knows of it.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.types import Action, Flag, Real, RobotState, Role, Scalar

_SPEEDS = 25
"""Speeds for which the reach is known; between two, that of the faster one is taken."""
_DIRECTIONS = 32
"""Directions along which it is known."""
_TICKS = 5
"""Ticks of a step by which it is computed."""
_BRAKING = 15
"""Steps before a crash that do not count: they are too late to brake."""


class Reach(NamedTuple):
    """How far a robot comes in some steps.

    Attributes:
        support: along directions from its heading [m].
        length: length of its path [m].
    """

    support: Float[Array, "speeds directions times"]
    length: Float[Array, "speeds times"]


def reach_of(body: Unicycle, dt: float, steps: int) -> Reach:
    """Compute the reach of a robot at the ends of steps 0 to `steps` of `dt` [s]."""
    tick = dt / _TICKS
    count = steps * _TICKS
    ends = np.arange(1, count + 1) * tick
    support = np.zeros((_SPEEDS, _DIRECTIONS, steps + 1))
    length = np.zeros((_SPEEDS, steps + 1))
    angles = np.arange(_DIRECTIONS) * 2 * np.pi / _DIRECTIONS
    angles = np.abs((angles + np.pi) % (2 * np.pi) - np.pi)
    # The cosine at the end of a tick is the largest in it.
    cosines = np.cos(np.maximum(0.0, angles[:, None] - body.u2_max * ends))
    for row, speed in enumerate(np.linspace(0.0, body.v_max, _SPEEDS)):
        for switch in range(0, count + 1, 2):
            after = np.empty(count)
            v = speed
            for number in range(count):
                change = -body.u1_max if number < switch else body.u1_max
                v = min(max(v + change * tick, 0.0), body.v_max)
                after[number] = v
            before = np.concatenate([[speed], after[:-1]])
            faster, slower = np.maximum(before, after), np.minimum(before, after)
            along = np.cumsum(np.where(cosines > 0, faster, slower) * cosines, axis=1) * tick
            best = np.maximum(support[row, :, 1:], along[:, _TICKS - 1 :: _TICKS])
            support[row, :, 1:] = best
            if switch == 0:
                length[row, 1:] = np.cumsum(faster)[_TICKS - 1 :: _TICKS] * tick
    return Reach(jnp.asarray(support, jnp.float32), jnp.asarray(length, jnp.float32))


def path_around(
    x: Scalar, y: Scalar, to_x: Array, to_y: Array, disc: tuple[Real, Real, Scalar]
) -> Array:
    """Return the lengths of the shortest paths from a point to others around a disc [m].

    Args:
        x, y: the point [m].
        to_x, to_y: the others [m], of any shape.
        disc: its centre and radius [m].
    """
    disc_x, disc_y, radius = disc
    dx, dy = x - disc_x, y - disc_y
    to_dx, to_dy = to_x - disc_x, to_y - disc_y
    straight = jnp.hypot(to_x - x, to_y - y)
    first = jnp.sqrt(jnp.maximum(dx**2 + dy**2 - radius**2, 0.0))
    second = jnp.sqrt(jnp.maximum(to_dx**2 + to_dy**2 - radius**2, 0.0))
    between = jnp.arctan2(jnp.abs(dx * to_dy - dy * to_dx), dx * to_dx + dy * to_dy)
    arc = between - jnp.arctan2(first, radius) - jnp.arctan2(second, radius)
    return jnp.where(arc > 0, first + second + radius * arc, straight)


def gaps(
    game: Game,
    reach: Reach,
    pursuer: RobotState,
    x: Float[Array, "courses times"],
    y: Float[Array, "courses times"],
    times: Int[Array, " times"],
) -> Float[Array, "courses times"]:
    """Return by how much places of the evader are out of the pursuer's reach [m].

    Args:
        game: the rules, in an arena of discs.
        reach: of the pursuer.
        pursuer: its state now.
        x, y: the places [m].
        times: steps from now.
    """
    row = jnp.ceil(pursuer.v / game.pursuer.v_max * (_SPEEDS - 1) - 1e-3).astype(jnp.int32)
    row = jnp.clip(row, 0, _SPEEDS - 1)
    support = reach.support[row][:, times]
    length = reach.length[row][times]
    dx, dy = x - pursuer.x, y - pursuer.y
    gap = jnp.full(dx.shape, -jnp.inf)
    for number in range(_DIRECTIONS):
        angle = pursuer.heading + number * 2 * jnp.pi / _DIRECTIONS
        along = dx * jnp.cos(angle) + dy * jnp.sin(angle)
        gap = jnp.maximum(gap, along - support[number][None])
    for disc in game.arena.discs:
        # A path to the capture distance and straight on enters the disc by this much at most.
        inner = jnp.sqrt(disc.radius**2 - (game.capture_distance / 2) ** 2)
        path = path_around(pursuer.x, pursuer.y, x, y, (disc.x, disc.y, inner))
        gap = jnp.maximum(gap, path - length[None])
    return gap - game.capture_distance


def drive(
    game: Game, role: Role, robot: RobotState, courses: Int[Array, "courses steps"]
) -> tuple[RobotState, Bool[Array, "courses steps"]]:
    """Return a robot after each step of some courses, and whether it has not failed until then."""
    body = game.body(role)

    def one_course(course: Int[Array, " steps"]) -> tuple[RobotState, Bool[Array, " steps"]]:
        def one_step(carry: tuple[RobotState, Flag], action: Action) -> Any:
            before, is_free = carry
            after = body.move(before, *body.controls(action), game.dt)
            clearance = game.arena.clearance_along(before, after)
            is_free &= (clearance > body.radius) & ~game.arena.is_out_of_range(after, body.radius)
            return (after, is_free), (after, is_free)

        return jax.lax.scan(one_step, (robot, jnp.ones((), bool)), course)[1]

    return jax.vmap(one_course)(courses)


def rooms(
    game: Game,
    reach: Reach,
    courses: Int[Array, "courses steps"],
    pursuer: RobotState,
    evader: RobotState,
) -> tuple[Int[Array, " courses"], Float[Array, " courses"]]:
    """Return the room of courses of the evader [steps], and the gap at their ends, at most 3 m.

    Every second step is looked at. A course that ends in a crash has less room than until then.
    """
    steps = courses.shape[1]
    times = np.arange(2, steps + 1, 2)
    states, is_free = drive(game, Role.EVADER, evader, courses)
    x, y = states.x[:, times - 1], states.y[:, times - 1]
    gap = gaps(game, reach, pursuer, x, y, jnp.asarray(times))
    is_out_of_reach = jnp.cumprod(((gap > 0) & is_free[:, times - 1]).astype(jnp.int32), axis=1)
    crash = jnp.sum(is_free, axis=1)
    before_crash = jnp.where(crash < steps, jnp.maximum(crash - _BRAKING, 0), steps)
    room = jnp.minimum(2 * jnp.sum(is_out_of_reach, axis=1), before_crash)
    return room, jnp.clip(gap[:, -1], -3.0, 3.0)
