"""People who walk from one place to the next that they see, by the social force model (Helbing and
Molnár, "Social force model for pedestrian dynamics", 1995).
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.accelerate.bit_mixing import mix_bits
from apollonius.game.arena import Arena
from apollonius.game.timetable import check_limits
from apollonius.game.types import Flag, Real, RobotState, Scalar
from apollonius.io.errors import require

MARGIN = 1e-3
"""Room [m] that walkers leave to obstacles and walls besides their radius: many times the rounding
error of single precision.
"""
_RELAXATION = 0.5
"""Time in which a walker takes up its desired velocity [s] (tau of the model)."""
_TOP_SPEED = 1.3
"""Top speed of a walker over its desired speed (the model's v_max / v_0)."""
_REPULSION, _REACH = 7.0, 0.3
"""Repulsion by another walker at no distance [m/s^2], V_0 / sigma of the model, and the distance
[m] in which it falls to 1/e.
"""
_WALL_REPULSION, _WALL_REACH = 50.0, 0.2
"""Repulsion by a thing at no distance [m/s^2], U_0 / R of the model, and the distance [m] in which
it falls to 1/e: by an obstacle or wall, a robot, a shuttle or a door.
"""
_SIGHT = -0.1736
"""Cosine of half the field of view, 100 degrees."""
_UNSEEN = 0.5
"""Share of the repulsion by a walker outside the field of view."""
_SLOPE = 0.1
"""Distance [m] over which the slope of the clearance is taken."""
_PIECES = 2
"""Pieces of the way to a stop, at whose ends the clearance is taken."""
_ARRIVAL = 0.5
"""Distance [m] within which a walker has arrived at its goal."""
_TURNS = 5
"""Steps in which each walker of a game gets a turn to look for a goal."""
_NEAR = 3.0
"""Largest difference in x and in y of a place near by [m]."""
_PATIENCE = 20.0
"""Mean time [s] after which a walker that has not arrived turns to another goal."""
_SLOW = 0.1
"""Speed, as a share of its top speed, below which a walker gets no farther."""
MOST_WALKERS = 100
"""Most walkers of a group."""


class Walkers(eqx.Module):
    """A group of people, all alike.

    A walker goes straight to a place that it can see, so that the straight line is the shortest
    path, and then to another. It is repelled by robots, other movers, obstacles and walls.

    Attributes:
        count: their number.
        radius: of the disc that each takes up [m].
        v_max: top speed [m/s], 1.3 times the speed at which one walks undisturbed.
        a_max: largest acceleration [m/s^2].
    """

    count: int = eqx.field(static=True, default=1)
    radius: Real = 0.25
    v_max: Real = 1.3
    a_max: Real = 2.0

    def check(self, name: str) -> None:
        """Refuse impossible numbers."""
        is_count = self.count == int(self.count) and 1 <= self.count <= MOST_WALKERS
        require(is_count, f"{name}.count", self.count, f"a whole number from 1 to {MOST_WALKERS}")
        check_limits(name, self.radius, self.v_max, self.a_max)


class Crowd(eqx.Module):
    """Discs and capsules that walkers keep away from, leaves `[bodies]`: centre x, y, half axis
    hx, hy and radius [m], and whether each is a walker itself.
    """

    x: Float[Array, " bodies"]
    y: Float[Array, " bodies"]
    hx: Float[Array, " bodies"]
    hy: Float[Array, " bodies"]
    radius: Float[Array, " bodies"]
    is_walker: Bool[Array, " bodies"]


class Walker(eqx.Module):
    """One walker, or several, leaves `[walkers]`.

    Attributes:
        x, y: its place [m].
        vx, vy: its velocity in the last step [m/s].
        goal_x, goal_y: where it goes [m]; its own place while it looks for a goal.
        radius, v_max, a_max: as in `Walkers`.
    """

    x: Float[Array, "*walkers"]
    y: Float[Array, "*walkers"]
    vx: Float[Array, "*walkers"]
    vy: Float[Array, "*walkers"]
    goal_x: Float[Array, "*walkers"]
    goal_y: Float[Array, "*walkers"]
    radius: Float[Array, "*walkers"]
    v_max: Float[Array, "*walkers"]
    a_max: Float[Array, "*walkers"]

    @property
    def goal_distance(self) -> Scalar:
        """The distance of its goal [m]."""
        return jnp.hypot(self.goal_x - self.x, self.goal_y - self.y)


def walk(
    arena: Arena, walkers: Walker, crowd: Crowd, own_places: Bool[Array, "walkers bodies"], dt: Real
) -> Walker:
    """Return walkers after a step, with their goals so far.

    A walker takes the velocity of the social force model only if it can still come to rest on the
    free floor afterwards, by braking straight ahead; otherwise it brakes, and gives up its goal.
    Braking is free because it was in the step before, by the same rule, and because a walker starts
    at rest on the free floor. So it never leaves the floor. No speed exceeds the top speed, and no
    change of velocity in a step exceeds `a_max` times `dt`.

    Args:
        arena: the arena.
        walkers: before the step, leaves `[walkers]`.
        crowd: all robots and movers.
        own_places: which body of the crowd is the walker itself.
        dt: duration of the step [s].
    """

    def next_walker(walker: Walker, is_own: Bool[Array, " bodies"]) -> Walker:
        clearance = arena.clearance(walker.x, walker.y)
        social_x, social_y = social_force(walker, crowd, is_own)
        wall_x, wall_y = _wall_force(arena, walker, clearance)
        vx, vy = _within_limits(walker, social_x + wall_x, social_y + wall_y, dt)
        is_free = _can_stop_after(arena, walker, clearance, vx, vy, dt)
        speed = jnp.hypot(walker.vx, walker.vy)
        share = jnp.maximum(speed - walker.a_max * dt, 0.0) / jnp.maximum(speed, 1e-6)
        vx = jnp.where(is_free, vx, share * walker.vx)
        vy = jnp.where(is_free, vy, share * walker.vy)
        x, y = walker.x + vx * dt, walker.y + vy * dt
        goal_x = jnp.where(is_free, walker.goal_x, x)
        goal_y = jnp.where(is_free, walker.goal_y, y)
        return replace(walker, x=x, y=y, vx=vx, vy=vy, goal_x=goal_x, goal_y=goal_y)

    return jax.vmap(next_walker)(walkers, own_places)


def look_for_goals(
    arena: Arena,
    walkers: Walker,
    bits: UInt32[Array, " walkers"],
    steps: Int[Array, ""],
    dt: Real,
    count: int | Int[Array, ""],
) -> Walker:
    """Return walkers some of whom have new goals.

    Those whose turn it is and who have arrived, get no farther or have lost their patience think of
    a place, half the time anywhere in the arena and half the time near by, and go there if the
    straight line is free for their bodies.

    Args:
        arena: the arena.
        walkers: leaves `[walkers]`.
        bits: random bits of each in this step.
        steps: the number of steps so far.
        dt: duration of a step [s].
        count: how many of the walkers, the first ones, take part.
    """

    def next_goal(walker: Walker, bits: UInt32[Array, ""]) -> tuple[Scalar, Scalar]:
        right, up, near, hurry = (_uniform(mix_bits(bits, jnp.uint32(use))) for use in range(1, 5))
        is_near = near < 0.5
        x = jnp.where(
            is_near,
            walker.x + _NEAR * (2 * right - 1),
            arena.x_min + right * (arena.x_max - arena.x_min),
        )
        y = jnp.where(
            is_near, walker.y + _NEAR * (2 * up - 1), arena.y_min + up * (arena.y_max - arena.y_min)
        )
        is_slow = jnp.hypot(walker.vx, walker.vy) < _SLOW * walker.v_max
        gives_up = is_slow | (hurry < _TURNS * dt / _PATIENCE)
        clearance = arena.clearance_along(_place(walker.x, walker.y), _place(x, y))
        is_free = clearance >= walker.radius + MARGIN
        is_new = is_free & ((walker.goal_distance < _ARRIVAL) | gives_up)
        return jnp.where(is_new, x, walker.goal_x), jnp.where(is_new, y, walker.goal_y)

    lookers = -(-count // _TURNS)
    turns = jnp.arange(-(-len(walkers.x) // _TURNS))
    # A number beyond the walkers is nobody's.
    numbers = jnp.where(turns < lookers, (steps * lookers + turns) % count, len(walkers.x))
    goal_x, goal_y = jax.vmap(next_goal)(*jax.tree.map(lambda leaf: leaf[numbers], (walkers, bits)))
    return replace(
        walkers,
        goal_x=walkers.goal_x.at[numbers].set(goal_x),
        goal_y=walkers.goal_y.at[numbers].set(goal_y),
    )


def social_force(
    walker: Walker, crowd: Crowd, is_own: Bool[Array, " bodies"]
) -> tuple[Scalar, Scalar]:
    """Return the acceleration x, y [m/s^2] of the social force model towards a walker's goal and
    away from robots and movers.

    Repulsion depends on the distance from the walker's centre to an outline, where the model has an
    ellipse.

    Args:
        walker: one walker.
        crowd: all robots and movers.
        is_own: which of these is the walker itself.
    """
    distance = jnp.maximum(walker.goal_distance, 1e-6)
    ahead_x = (walker.goal_x - walker.x) / distance
    ahead_y = (walker.goal_y - walker.y) / distance
    desired_speed = walker.v_max / _TOP_SPEED
    away_x, away_y, gap = jax.vmap(_away_from, (None, 0))(walker, crowd)
    is_ahead = -(away_x * ahead_x + away_y * ahead_y) >= _SIGHT
    by_walkers = _REPULSION * jnp.exp(-gap / _REACH) * jnp.where(is_ahead, 1.0, _UNSEEN)
    by_things = _WALL_REPULSION * jnp.exp(-gap / _WALL_REACH)
    repulsion = jnp.where(crowd.is_walker, by_walkers, by_things)
    repulsion = jnp.where(is_own, 0.0, repulsion)
    return (
        (desired_speed * ahead_x - walker.vx) / _RELAXATION + jnp.sum(repulsion * away_x),
        (desired_speed * ahead_y - walker.vy) / _RELAXATION + jnp.sum(repulsion * away_y),
    )


def _away_from(walker: Walker, body: Crowd) -> tuple[Scalar, Scalar, Scalar]:
    """Return the direction x, y from a body to a walker, and the walker's distance from it [m]."""
    dx, dy = walker.x - body.x, walker.y - body.y
    length_squared = body.hx**2 + body.hy**2
    along = (dx * body.hx + dy * body.hy) / jnp.maximum(length_squared, 1e-12)
    share = jnp.clip(along, -1.0, 1.0)
    dx, dy = dx - share * body.hx, dy - share * body.hy
    distance = jnp.maximum(jnp.hypot(dx, dy), 1e-6)
    return dx / distance, dy / distance, jnp.maximum(distance - body.radius, 0.0)


def _wall_force(arena: Arena, walker: Walker, clearance: Scalar) -> tuple[Scalar, Scalar]:
    """Return the acceleration x, y [m/s^2] away from the nearest obstacle or wall, whose distance
    [m] is the clearance.
    """
    right = arena.clearance(walker.x + _SLOPE, walker.y) - clearance
    up = arena.clearance(walker.x, walker.y + _SLOPE) - clearance
    force = _WALL_REPULSION * jnp.exp(-clearance / _WALL_REACH) / _SLOPE
    return force * right, force * up


def _within_limits(walker: Walker, ax: Scalar, ay: Scalar, dt: Real) -> tuple[Scalar, Scalar]:
    """Return the velocity [m/s] after a step, cut to the walker's limits.

    Args:
        walker: the walker before the step.
        ax, ay: the acceleration that it wants [m/s^2].
        dt: duration of the step [s].
    """
    share = jnp.minimum(walker.a_max / jnp.maximum(jnp.hypot(ax, ay), 1e-6), 1.0)
    vx, vy = walker.vx + share * ax * dt, walker.vy + share * ay * dt
    # The nearest velocity within the top speed: never farther from the one before.
    share = jnp.minimum(walker.v_max / jnp.maximum(jnp.hypot(vx, vy), 1e-6), 1.0)
    return share * vx, share * vy


def _can_stop_after(
    arena: Arena, walker: Walker, clearance: Scalar, vx: Scalar, vy: Scalar, dt: Real
) -> Flag:
    """Check whether a walker can certainly come to rest on the free floor after a step.

    Between two points a clearance is less than their mean by at most half their distance. A walker
    at rest needs half the `MARGIN`, so that rounding never holds it where it stopped.

    Args:
        arena: the arena.
        walker: the walker before the step.
        clearance: where it is [m].
        vx, vy: its velocity in the step [m/s].
        dt: duration of the step [s].
    """
    speed = jnp.hypot(vx, vy)
    time = dt + speed / (2 * walker.a_max)
    is_at_rest = (walker.vx == 0) & (walker.vy == 0)
    room = walker.radius + jnp.where(is_at_rest, MARGIN / 2, MARGIN)
    is_free = jnp.ones((), bool)
    for piece in range(1, _PIECES + 1):
        later = time * piece / _PIECES
        further = arena.clearance(walker.x + vx * later, walker.y + vy * later)
        is_free &= (clearance + further - speed * time / _PIECES) / 2 >= room
        clearance = further
    return is_free


def _uniform(bits: UInt32[Array, ""]) -> Scalar:
    """Return a number from 0 to 1, uniform if the bits are random."""
    return (bits >> 8).astype(jnp.float32) * 2.0**-24


def _place(x: Scalar, y: Scalar) -> RobotState:
    """Return a place [m] as the arena's methods take it."""
    return RobotState(x, y, jnp.zeros_like(x), jnp.zeros_like(x))
