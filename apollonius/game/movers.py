"""Things that move by themselves in a game: shuttles, doors and walkers.

They are obstacles that move: a capsule each, which is only shifted and never turned. A robot that
touches one fails as at an obstacle, but one that rests does not when it is walked into. They do not
hide robots from each other, and may overlap each other.
"""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, UInt32

from apollonius.accelerate.bit_mixing import mix_bits
from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.obstacle import closest_approach_squared
from apollonius.game.starts import draw_until
from apollonius.game.timetable import AbstractTimed, Door, Shuttle
from apollonius.game.types import (
    BySide,
    Flag,
    GameState,
    MoverMotion,
    MoverStates,
    Real,
    RobotState,
    Scalar,
)
from apollonius.game.walkers import MARGIN, Crowd, Walker, Walkers, look_for_goals, walk
from apollonius.io.errors import require

MOST_TIMED = 50
"""Most shuttles and doors together: each takes some time to compile."""
TRIES = 8
"""Places that are drawn for each mover at the start, from which one clear of robots is taken."""

Bodies = BySide[tuple[Unicycle, ...]]


class MoverBodies(eqx.Module):
    """The shapes and limits of movers, leaves `[movers]`: half axis hx, hy [m], radius [m], top
    speed v_max [m/s] and largest acceleration a_max [m/s^2].
    """

    hx: Float[Array, " movers"]
    hy: Float[Array, " movers"]
    radius: Float[Array, " movers"]
    v_max: Float[Array, " movers"]
    a_max: Float[Array, " movers"]

    def distance_along(
        self, motion: MoverMotion, moved: MoverMotion, before: RobotState, after: RobotState
    ) -> Float[Array, " movers"]:
        """Return the least distance [m] of a robot's centre from the outline of each mover along a
        step, in which both go straight; negative inside.

        Args:
            motion, moved: the movers before and after the step.
            before, after: the robot before and after the step.
        """
        from_x, from_y = before.x - motion.x, before.y - motion.y
        to_x, to_y = after.x - moved.x, after.y - moved.y
        approach = jax.vmap(axis_approach_squared)
        return jnp.sqrt(approach(from_x, from_y, to_x, to_y, self.hx, self.hy)) - self.radius

    def distance_from_reach(
        self, motion: MoverMotion, before: RobotState, after: RobotState, time: Real, dt: Real
    ) -> Float[Array, " movers"]:
        """Return a lower bound of the distance [m] of a robot's centre, on a later step, from all
        that each mover can reach until the end of that step.

        Its speed bounds how far it comes; its acceleration, how far from where it would come at the
        velocity that it has.

        Args:
            motion: the movers now.
            before, after: the robot before and after the step.
            time: from now to the start of the step [s].
            dt: duration of the step [s].
        """
        end = time + dt
        by_speed = self.distance_along(motion, motion, before, after) - self.v_max * end
        ahead, farther = (
            replace(motion, x=motion.x + motion.vx * later, y=motion.y + motion.vy * later)
            for later in (time, end)
        )
        # After k steps the velocity differs by at most k a_max dt.
        deviation = self.a_max * end * (end + dt) / 2
        by_acceleration = self.distance_along(ahead, farther, before, after) - deviation
        return jnp.maximum(by_speed, by_acceleration)


class Movers(eqx.Module):
    """The movers of a game. Only their numbers and the numbers of waypoints are static."""

    shuttles: tuple[Shuttle, ...] = ()
    doors: tuple[Door, ...] = ()
    walkers: tuple[Walkers, ...] = ()

    @property
    def timed(self) -> tuple[AbstractTimed, ...]:
        """The shuttles and doors, which move by the clock."""
        return (*self.shuttles, *self.doors)

    @property
    def number_of_walkers(self) -> int | Int[Array, ""]:
        """The number of walkers of all groups."""
        return sum(group.count for group in self.walkers)

    @property
    def bodies(self) -> MoverBodies:
        """The shapes and limits of all: shuttles, doors, then walkers."""
        rows = [
            (mover.hx, mover.hy, mover.radius, mover.v_max, mover.a_max) for mover in self.timed
        ]
        for group in self.walkers:
            rows += [(0.0, 0.0, group.radius, group.v_max, group.a_max)] * group.count
        numbers = [[jnp.asarray(number, jnp.float32) for number in row] for row in rows]
        return MoverBodies(*(jnp.stack(column) for column in zip(*numbers, strict=True)))

    def check(self, arena: Arena) -> None:
        """Refuse impossible movers, and none."""
        count = len(self.timed) + len(self.walkers)
        require(count > 0, "movers", "empty", "shuttles, doors or walkers; or left out")
        bound = f"at most {MOST_TIMED}"
        require(len(self.timed) <= MOST_TIMED, "movers", f"{len(self.timed)} by the clock", bound)
        for table, movers in (("shuttles", self.shuttles), ("doors", self.doors)):
            for number, mover in enumerate(movers):
                mover.check(f"movers.{table}[{number}]", arena)
        for number, group in enumerate(self.walkers):
            group.check(f"movers.walkers[{number}]")

    def sample(
        self,
        key: PRNGKeyArray,
        arena: Arena,
        robots: Sequence[tuple[RobotState, Real]],
        room: Real,
        dt: Real,
    ) -> MoverStates:
        """Draw movers beside robots. The key is consumed.

        Shuttles and doors are anywhere in their periods; walkers are anywhere on the floor, at
        rest. Of some draws for each the first counts that leaves robots their room, or else the one
        that leaves them most.

        Args:
            key: draws clocks, places and bits.
            arena: the arena.
            robots: the robots in their places, and the radius of each [m].
            room: least distance [m] of a mover from a robot's body.
            dt: duration of a step [s].
        """
        clock_key, place_key, bits_key = jax.random.split(key, 3)
        timed = len(self.timed)
        rooms = self.bodies.radius[timed:] + 2 * MARGIN
        shares = jax.random.uniform(clock_key, (timed, TRIES))
        places = _draw_floor(place_key, arena, rooms)
        bits = jax.random.bits(bits_key, (len(rooms),), jnp.uint32)
        return self.start(shares, places, bits, robots, room, dt)

    def start(
        self,
        shares: Float[Array, "timed tries"],
        walker_places: tuple[Float[Array, "walkers tries"], Float[Array, "walkers tries"]],
        bits: UInt32[Array, " walkers"],
        robots: Sequence[tuple[RobotState, Real]],
        room: Real,
        dt: Real,
    ) -> MoverStates:
        """Return movers at the start, each where the first of some draws leaves robots their room.

        Args:
            shares: of their periods, drawn for shuttles and doors.
            walker_places: x and y drawn for walkers [m].
            bits: random bits of walkers.
            robots, room, dt: as in `sample`.
        """
        timed, bodies = len(self.timed), self.bodies
        tried = [mover.period * share for mover, share in zip(self.timed, shares, strict=True)]
        places = [
            jax.vmap(mover.place)(clocks) for mover, clocks in zip(self.timed, tried, strict=True)
        ]
        walker_x, walker_y = walker_places
        xs = jnp.stack([*(x for x, _ in places), *walker_x])
        ys = jnp.stack([*(y for _, y in places), *walker_y])
        choice = jax.vmap(_first_with_room, (0, 0, 0, None, None))(bodies, xs, ys, robots, room)
        rows = jnp.arange(len(choice))
        x, y = xs[rows, choice], ys[rows, choice]
        clocks = _row([clocks[choice[number]] for number, clocks in enumerate(tried)])
        earlier = self._timed_places(self._advanced(clocks, -dt))
        vx, vy = (
            jnp.concatenate([(now[:timed] - before) / dt, jnp.zeros(len(choice) - timed)])
            for now, before in zip((x, y), earlier, strict=True)
        )
        return MoverStates(MoverMotion(x, y, vx, vy), clocks, x[timed:], y[timed:], bits)

    @fusion_barrier
    def step(self, arena: Arena, state: GameState, bodies: Bodies, dt: Real) -> MoverStates:
        """Return the movers after a step.

        Args:
            arena: the arena.
            state: the state before the step.
            bodies: the limits of the robots.
            dt: duration of the step [s].
        """
        before = state.movers
        assert before is not None, "a state of a game with movers has theirs"
        timed = len(self.timed)
        clocks = self._advanced(before.clocks, dt)
        x, y = self._timed_places(clocks)
        motion = before.motion
        vx, vy = (x - motion.x[:timed]) / dt, (y - motion.y[:timed]) / dt
        if not self.walkers:
            return MoverStates(
                MoverMotion(x, y, vx, vy), clocks, before.goal_x, before.goal_y, before.bits
            )
        walkers, crowd, own_places = self._crowd(before, state, bodies)
        bits = mix_bits(before.bits, state.steps.astype(jnp.uint32))
        moved_walkers = walk(arena, walkers, crowd, own_places, dt)
        number = self.number_of_walkers
        after = look_for_goals(arena, moved_walkers, bits, state.steps, dt, number)
        parts = ((x, after.x), (y, after.y), (vx, after.vx), (vy, after.vy))
        moved = MoverMotion(*(jnp.concatenate(part) for part in parts))
        return MoverStates(moved, clocks, after.goal_x, after.goal_y, before.bits)

    def is_hit(
        self,
        before: MoverStates,
        after: MoverStates,
        move: tuple[RobotState, RobotState],
        radius: Real,
    ) -> Flag:
        """Check whether a robot touches a mover anywhere along a step, in which both go straight.

        A robot at rest, before the step and after it, does not: it may be walked into.

        Args:
            before, after: the movers before and after the step.
            move: the robot before and after the step.
            radius: the robot's radius [m].
        """
        distances = self.bodies.distance_along(before.motion, after.motion, *move)
        is_at_rest = (move[0].v == 0) & (move[1].v == 0)
        return jnp.any(distances < radius) & ~is_at_rest

    def _advanced(self, clocks: Float[Array, " timed"], time: Real) -> Float[Array, " timed"]:
        """Return clocks [s] after a time [s]."""
        pairs = zip(self.timed, clocks, strict=True)
        return _row([mover.advance(clock, time) for mover, clock in pairs])

    def _timed_places(
        self, clocks: Float[Array, " timed"]
    ) -> tuple[Float[Array, " timed"], Float[Array, " timed"]]:
        """Return x and y [m] of shuttles and doors by their clocks [s]."""
        places = [mover.place(clock) for mover, clock in zip(self.timed, clocks, strict=True)]
        return _row([x for x, _ in places]), _row([y for _, y in places])

    def _crowd(
        self, before: MoverStates, state: GameState, robot_bodies: Bodies
    ) -> tuple[Walker, Crowd, Bool[Array, "walkers bodies"]]:
        """Return the walkers, all that they keep away from, and which body is which walker."""
        timed, bodies, motion = len(self.timed), self.bodies, before.motion
        own = jax.tree.map(lambda leaf: leaf[timed:], (motion, bodies))
        (motion_of_walkers, bodies_of_walkers) = own
        walkers = Walker(
            x=motion_of_walkers.x,
            y=motion_of_walkers.y,
            vx=motion_of_walkers.vx,
            vy=motion_of_walkers.vy,
            goal_x=before.goal_x,
            goal_y=before.goal_y,
            radius=bodies_of_walkers.radius,
            v_max=bodies_of_walkers.v_max,
            a_max=bodies_of_walkers.a_max,
        )
        robots = [robot for side in state.robots for robot in side]
        radii = [jnp.asarray(body.radius, jnp.float32) for side in robot_bodies for body in side]
        no_axis = jnp.zeros(len(robots))
        numbers = jnp.arange(len(motion.x) + len(robots))
        crowd = Crowd(
            x=jnp.concatenate([motion.x, _row([robot.x for robot in robots])]),
            y=jnp.concatenate([motion.y, _row([robot.y for robot in robots])]),
            hx=jnp.concatenate([bodies.hx, no_axis]),
            hy=jnp.concatenate([bodies.hy, no_axis]),
            radius=jnp.concatenate([bodies.radius, _row(radii)]),
            is_walker=(numbers >= timed) & (numbers < len(motion.x)),
        )
        return walkers, crowd, numbers[None] == timed + jnp.arange(len(walkers.x))[:, None]


def axis_approach_squared(
    from_x: Scalar, from_y: Scalar, to_x: Scalar, to_y: Scalar, hx: Real, hy: Real
) -> Scalar:
    """Return the least squared distance [m^2] between a segment and an axis through the origin.

    Two segments that do not cross are nearest to each other at an end of either.

    Args:
        from_x, from_y: the start of the segment [m].
        to_x, to_y: its end [m].
        hx, hy: an end of the axis; the other is opposite [m].
    """
    dx, dy = to_x - from_x, to_y - from_y
    ends = (
        closest_approach_squared(-hx - from_x, -hy - from_y, 2 * hx, 2 * hy),
        closest_approach_squared(-hx - to_x, -hy - to_y, 2 * hx, 2 * hy),
        closest_approach_squared(from_x - hx, from_y - hy, dx, dy),
        closest_approach_squared(from_x + hx, from_y + hy, dx, dy),
    )
    # The ends of each on opposite sides of the other.
    crosses_axis = (from_x * hy - from_y * hx) * (to_x * hy - to_y * hx) < 0
    offset, turn = from_x * dy - from_y * dx, hx * dy - hy * dx
    crosses_segment = jnp.abs(offset) < jnp.abs(turn)
    least = jnp.minimum(jnp.minimum(ends[0], ends[1]), jnp.minimum(ends[2], ends[3]))
    return jnp.where(crosses_axis & crosses_segment, 0.0, least)


def _draw_floor(
    key: PRNGKeyArray, arena: Arena, rooms: Float[Array, " walkers"]
) -> tuple[Float[Array, "walkers tries"], Float[Array, "walkers tries"]]:
    """Draw places with room [m] on the floor, several for each walker; return x and y [m]. The key
    is consumed.
    """

    def draw(draw_key: PRNGKeyArray, room: Scalar) -> Float[Array, "2"]:
        def fits(place: Float[Array, "2"], matters: Flag) -> Flag:
            return arena.is_clear(place[0], place[1], room, matters)

        return draw_until(fits, draw_key, arena, 1)

    count = len(rooms)
    if not count:
        return jnp.zeros((0, TRIES)), jnp.zeros((0, TRIES))
    keys = jax.random.split(key, count * TRIES)
    places = jax.vmap(draw)(keys, jnp.repeat(rooms, TRIES)).reshape(count, TRIES, 2)
    return places[:, :, 0], places[:, :, 1]


def _first_with_room(
    body: MoverBodies,
    xs: Float[Array, " tries"],
    ys: Float[Array, " tries"],
    robots: Sequence[tuple[RobotState, Real]],
    room: Real,
) -> Int[Array, ""]:
    """Return the first of some places of a mover that leaves robots a room, or the roomiest.

    Args:
        body: the mover's.
        xs, ys: the places [m].
        robots: the robots, and the radius of each [m].
        room: its distance from a robot's body [m].
    """
    bodies = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, xs.shape), body)
    still = jnp.zeros_like(xs)
    motion = MoverMotion(xs, ys, still, still)
    least = jnp.full_like(xs, room)
    for robot, radius in robots:
        distance = bodies.distance_along(motion, motion, robot, robot) - radius
        least = jnp.minimum(least, distance)
    return jnp.argmax(least)


def _row(values: Sequence[Scalar]) -> Float[Array, " values"]:
    """Return numbers as one array, which may be empty."""
    return jnp.stack(values) if values else jnp.zeros(0)
