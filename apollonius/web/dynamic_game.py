"""Games as the page writes them: the numbers of robots, obstacles, cells and movers are data."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.agents.wrappers.backup import Backup, BrakingMotion
from apollonius.game.arena import Arena, Disc
from apollonius.game.car import Car
from apollonius.game.chart import Chart
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.movers import MoverBodies, Movers
from apollonius.game.obstacle import AbstractObstacle
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.omni import Omni
from apollonius.game.polygon import Edge, Edges
from apollonius.game.teams import Teams
from apollonius.game.timetable import Door, Leg, Shuttle, duration
from apollonius.game.types import (
    BySide,
    Flag,
    GameState,
    MoverMotion,
    MoverStates,
    Real,
    RobotState,
    Role,
    Scalar,
)
from apollonius.game.wheels import Wheels
from apollonius.observe.surroundings import MoversInView
from apollonius.observe.tracking import Track
from apollonius.observe.view import Robot, View, look
from apollonius.web.site import ROBOTS

Field = Float[Array, " corners"]
"""Distances of an occupancy map's corners, row by row from the bottom [m]."""


class Discs(AbstractObstacle):
    """Discs, leaves `[most]`, of which the first `count` exist."""

    discs: Disc
    count: Int[Array, ""]

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        return self._least(lambda disc: disc.clearance(x, y))

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        return self._least(lambda disc: disc.clearance_along(before, after))

    def _least(self, clearance: Callable[[Disc], Scalar]) -> Scalar:
        def look(number: Int[Array, ""], least: Scalar) -> Scalar:
            return jnp.minimum(least, clearance(at(self.discs, number)))

        return jax.lax.fori_loop(0, self.count, look, jnp.asarray(jnp.inf, jnp.float32))


class BoundedEdges(Edges):
    """The edges of polygons, leaves `[most]`, of which the first `count` exist."""

    count: Int[Array, ""]

    def _over_edges(self, add_edge: Callable[[Any, Edge], Any], initial: Any) -> Any:
        return jax.lax.fori_loop(
            0, self.count, lambda number, total: add_edge(total, at(self.edges, number)), initial
        )


class Cells(OccupancyMap):
    """An occupancy map of any size, its field flattened; infinitely far away where it has no
    columns.
    """

    field: Field
    rows: Int[Array, ""]
    columns: Int[Array, ""]

    @property
    def _corners(self) -> tuple[Int[Array, ""], Int[Array, ""]]:
        return self.rows, self.columns

    def _at(self, row: Int[Array, ""], column: Int[Array, ""]) -> Scalar:
        return self.field[row * self.columns + column]

    def clearance(self, x: Scalar, y: Scalar) -> Scalar:
        return self._where_present(lambda: OccupancyMap.clearance(self, x, y))

    def clearance_along(self, before: RobotState, after: RobotState) -> Scalar:
        return self._where_present(lambda: OccupancyMap.clearance_along(self, before, after))

    def _where_present(self, clearance: Callable[[], Scalar]) -> Scalar:
        return jax.lax.cond(self.columns > 0, clearance, lambda: jnp.asarray(jnp.inf, jnp.float32))

    def hides(self, observer: RobotState, target: RobotState) -> Bool[Array, ""]:
        no = jnp.zeros((), bool)
        return jax.lax.cond(
            self.columns > 0, lambda: OccupancyMap.hides(self, observer, target), lambda: no
        )


class DynamicArena(Arena):
    """An arena whose obstacles are data, with one translated function for each query however often
    it is called.
    """

    clearance = jax.jit(Arena.clearance)
    clearance_along = jax.jit(Arena.clearance_along)
    hits_obstacle = jax.jit(Arena.hits_obstacle)


class Floor(eqx.Module):
    """An arena as the page writes it, without the field of its map.

    Attributes:
        walls: x_min, x_max, y_min, y_max [m].
        territory: with radius 0 if the arena has none.
        map: x, y and side length of a cell [m].
        counts: of discs, edges, rows and columns of the map.
    """

    walls: Float[Array, "4"]
    territory: Disc
    discs: Disc
    edges: Edge
    map: Float[Array, "3"]
    counts: Int[Array, "4"]

    def arena(self, field: Float[Array, " corners"]) -> DynamicArena:
        """Return the arena with the field of its map."""
        discs, edges, rows, columns = self.counts
        (x, y, cell), (x_min, x_max, y_min, y_max) = self.map, self.walls
        cells = Cells(field, x, y, cell, "", "", rows, columns)
        drawn = Discs(self.discs, discs), BoundedEdges(self.edges, edges), cells
        return DynamicArena(x_min, x_max, y_min, y_max, territory=self.territory, extra=drawn)


class AnyRobot(Unicycle):
    """A robot of any kind, with one translated motion however often it moves: of a number that its
    kind does not have it has 0.
    """

    wheelbase: Real = 0.0
    track: Real = 0.0
    wheel_speed: Real = 0.0
    lateral_acceleration: Real = 0.0

    move = jax.jit(Unicycle.move)

    @property
    def turns_on_the_spot(self) -> Flag:
        """Check whether it turns at rest."""
        return jnp.asarray(self.wheelbase == 0)

    @property
    def turning_radius(self) -> Scalar:
        """The radius of its sharpest turn [m]."""
        return jnp.where(self.turns_on_the_spot, 0.0, self._car.turning_radius)

    def turn_rate(self, u2: Scalar, v: Scalar) -> Scalar:
        """Return the turn rate [rad/s] under a control u2 at a speed [m/s]."""
        of_wheels = Wheels(track=_positive(self.track), wheel_speed=self.wheel_speed)
        of_omni = Omni(lateral_acceleration=self.lateral_acceleration)
        rate = jnp.where(self.track > 0, of_wheels.turn_rate(u2, v), u2)
        rate = jnp.where(self.lateral_acceleration > 0, of_omni.turn_rate(u2, v), rate)
        return jnp.where(self.wheelbase > 0, self._car.turn_rate(u2, v), rate)

    def turn(self, u2: Scalar, fastest: Scalar, distance: Scalar, dt: Real) -> Scalar:
        """Return the turn in a step [rad]; the arguments are those of `Unicycle.turn`."""
        turn = super().turn(u2, fastest, distance, dt)
        of_car = self._car.turn(u2, fastest, distance, dt)
        return jnp.where(self.wheelbase > 0, of_car, turn)

    def fastest_on_arc(self, radius: Scalar) -> Scalar:
        """Return the highest speed [m/s] at which the robot can drive an arc of a radius [m]."""
        limits = self.v_min, self.v_max, self.u1_max, self.u2_max, self.radius
        of_wheels = Wheels(*limits, _positive(self.track), self.wheel_speed)
        of_omni = Omni(*limits, self.lateral_acceleration)
        fastest = super().fastest_on_arc(radius)
        fastest = jnp.where(self.track > 0, of_wheels.fastest_on_arc(radius), fastest)
        is_omni = self.lateral_acceleration > 0
        fastest = jnp.where(is_omni, of_omni.fastest_on_arc(radius), fastest)
        return jnp.where(self.wheelbase > 0, self.v_max, fastest)

    @property
    def _car(self) -> Car:
        return Car(u2_max=self.u2_max, wheelbase=_positive(self.wheelbase))


def _positive(value: Real) -> Scalar:
    """Return a number by which can be divided, also where it is 0 and the result is not used."""
    return jnp.where(jnp.asarray(value) > 0, value, 1.0)


class Robots(eqx.Module):
    """Robots, leaves `[2 * ROBOTS]`: one side, then the other. Places without a robot are not
    active.
    """

    bodies: AnyRobot
    states: RobotState
    status: Int[Array, " robots"]

    @property
    def first(self) -> tuple[AnyRobot, RobotState]:
        """The body and the state of the first robot."""
        return at(self.bodies, 0), at(self.states, 0)

    @property
    def state(self) -> GameState:
        """The state of the game, the first side its pursuers."""
        return GameState(_by_side(self.states), jnp.zeros((), jnp.int32), _by_side(self.status))

    def game(
        self, arena: Arena, capture_distance: Scalar, dt: Real, max_steps: int | Array = 1
    ) -> Game:
        """Return the game between them."""
        (first_pursuer, *pursuers), (first_evader, *evaders) = _by_side(self.bodies)
        teams = Teams(tuple(pursuers), tuple(evaders))
        return Game(
            first_pursuer, first_evader, arena, capture_distance, dt, max_steps, teams=teams
        )

    def view(self, arena: Arena, chart: Chart, capture_distance: Scalar, dt: Scalar) -> View:
        """Return the view of the first robot."""
        game = replace(self.game(arena, capture_distance, dt), chart=chart)
        return look(game, self.state, Role.PURSUER)


class SearcherState(eqx.Module):
    """Knowledge of a robot with a line of sight, and the cell that it searches
    (`apollonius.agents.wrappers.searching`).
    """

    track: Track
    cell: Int[Array, ""]


def _by_side(values: Any) -> BySide[tuple[Any, ...]]:
    """Return the bodies, states or statuses of robots by side."""
    rows = [at(values, number) for number in range(2 * ROBOTS)]
    return BySide(tuple(rows[:ROBOTS]), tuple(rows[ROBOTS:]))


def at(values: Any, number: int | Int[Array, ""]) -> Any:
    """Return one row of each leaf."""
    return jax.tree.map(lambda leaf: leaf[number], values)


class AnyShuttle(Shuttle):
    """A shuttle of whose waypoints, `[most, 2]`, the first `count` exist, with one translated
    motion.
    """

    waypoints: Any = ()
    count: int | Array = 2

    def place(self, clock: Scalar) -> tuple[Scalar, Scalar]:
        """Return its place x, y [m] at a time [s] of its clock."""
        return self._go(clock)[1:]

    @property
    def period(self) -> Scalar:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The time there and back with all pauses [s]."""
        return self._go(jnp.zeros(()))[0]

    @jax.jit
    def _go(self, clock: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """Return the time at the end of all legs [s], and the place x, y [m] at a time [s]."""
        points, last = jnp.asarray(self.waypoints), 2 * (self.count - 1)

        def go_on(
            number: Int[Array, ""], now: tuple[Scalar, Scalar, Scalar]
        ) -> tuple[Scalar, Scalar, Scalar]:
            time, x, y = now
            start, target = (
                points[jnp.minimum(turn, last - turn)] for turn in (number, number + 1)
            )
            leg = Leg(time, target[0] - start[0], target[1] - start[1])
            end = time + duration(leg.length, self.v_max, self.a_max) + self.pause
            return end, *self.place_along(leg, x, y, clock)

        return jax.lax.fori_loop(0, last, go_on, (jnp.zeros(()), *points[0]))


class AnyDoor(Door):
    """A door with one translated motion."""

    place = jax.jit(Door.place)


class AnyBodies(MoverBodies):
    """The bodies of movers with one translated distance however often it is asked for."""

    distance_along = jax.jit(MoverBodies.distance_along)


class AnyMovers(Movers):
    """Movers of a fixed number, of which `count` exist, and of the walkers the first `walking`. The
    others are far away and at rest. Where there are none, nothing is computed.
    """

    count: int | Array = 0
    walking: int | Array = 0

    @property
    def number_of_walkers(self) -> int | Array:
        """The number of walkers that exist."""
        return self.walking

    @property
    def bodies(self) -> MoverBodies:
        """The shapes and limits of all."""
        return AnyBodies(**vars(super().bodies))

    def in_view(self, motion: MoverMotion) -> MoversInView:
        """Return the movers in the view of a robot."""
        return AnyMoversInView(self.bodies, motion, None, 0.0, self.count)

    def step(
        self, arena: Arena, state: GameState, bodies: BySide[tuple[Unicycle, ...]], dt: Real
    ) -> MoverStates:
        """Return the movers after a step; the arguments are those of `Movers.step`."""
        step = super().step
        return jax.lax.cond(
            self.count > 0, lambda: step(arena, state, bodies, dt), lambda: state.movers
        )

    def is_hit(
        self,
        before: MoverStates,
        after: MoverStates,
        move: tuple[RobotState, RobotState],
        radius: Real,
    ) -> Flag:
        """Check whether a robot touches a mover; the arguments are those of `Movers.is_hit`."""
        return self._is_hit(before, after, move, radius)

    @jax.jit
    def _is_hit(self, *contact: Any) -> Flag:
        no = jnp.zeros((), bool)
        return jax.lax.cond(self.count > 0, lambda: Movers.is_hit(self, *contact), lambda: no)


class AnyMoversInView(MoversInView):
    """Movers in view, of which `count` exist; each distance is that of `MoversInView`, infinite
    without any, and translated once.
    """

    count: int | Array = 0

    def clearance_along(
        self, before: RobotState, after: RobotState, time: Real, dt: Real
    ) -> Scalar:
        """Return a lower bound of a robot's distance from all that movers can reach [m]."""
        return self._distance(MoversInView.clearance_along, before, after, time, dt)

    def clearance(self, x: Scalar, y: Scalar, time: Real) -> Scalar:
        """Return the distance of a point from the nearest mover [m]."""
        return self._distance(MoversInView.clearance, x, y, time)

    def range(self, x: Scalar, y: Scalar, cos: Scalar, sin: Scalar, radius: Real) -> Scalar:
        """Return the distance that a disc can go in a direction [m]."""
        return self._distance(MoversInView.range, x, y, cos, sin, radius)

    @partial(jax.jit, static_argnums=1)
    def _distance(self, distance: Callable[..., Scalar], *args: Any) -> Scalar:
        free = jnp.asarray(jnp.inf, jnp.float32)
        return jax.lax.cond(self.count > 0, lambda: distance(self, *args), lambda: free)


class DynamicBackup(Backup):
    """Manoeuvres of any number of steps, among obstacles without an index."""

    steps: int | Array  # pyright: ignore[reportIncompatibleVariableOverride]

    def _clearances(self, robot: Robot, motion: BrakingMotion) -> Float[Array, " manoeuvres"]:
        def one_step(
            number: Int[Array, ""], carry: list[tuple[BrakingMotion, Scalar]]
        ) -> list[tuple[BrakingMotion, Scalar]]:
            time = self.dt * (number + 1).astype(jnp.float32)
            after = self._brake(robot, [before for before, _ in carry])
            return [
                (to, jnp.minimum(least, self._clearance_along(before.state, to.state, time)))
                for to, (before, least) in zip(after, carry, strict=True)
            ]

        current = self.arena.clearance(motion.state.x, motion.state.y)
        ends = jax.lax.fori_loop(
            0, self.steps, one_step, [(motion, current)] * len(self.manoeuvres)
        )
        return jnp.stack([least for _, least in ends]) - robot.body.radius
