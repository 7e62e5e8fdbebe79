"""The view of one robot: bodies, states and the arena, in metres, m/s and radians."""

from dataclasses import replace
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.game.arena import Arena
from apollonius.game.chart import Chart
from apollonius.game.drive import drive_of, predict_after_lag
from apollonius.game.dynamics import Unicycle
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.game import Game
from apollonius.game.teams import Teams, nearest
from apollonius.game.types import (
    BySide,
    DriveState,
    DriveStates,
    Flag,
    GameState,
    Real,
    RobotState,
    Role,
    Scalar,
)
from apollonius.io.errors import InvalidInput

T = TypeVar("T")


class Robot(eqx.Module):
    """A robot in a view.

    Attributes:
        body, state: its limits, and its state as it is known.
        active: whether it is in play.
        age: for how long the robot has been hidden [s].
        predicted_state: its state when a command that is given now takes effect; None if that is
            now, or not
            known.
        turn_time: in which its drive changes the turn rate by u2_max [s]; None for one that does so
            at once.
        turn_rate: when a command that is given now takes effect [rad/s]; None without a turn time.
    """

    body: Unicycle
    state: RobotState
    active: Flag | bool = True
    age: Real = 0.0
    predicted_state: RobotState | None = None
    turn_time: Real | None = None
    turn_rate: Scalar | None = None

    @property
    def predicted(self) -> RobotState:
        """The state in which a command that is given now takes effect, as far as that is known."""
        return self.predicted_state or self.state


class View(eqx.Module):
    """The view of one robot, whose mates and opponents are robots too. Nothing in it is scaled.

    Attributes:
        capture_distance: distance at which an evader is captured [m].
        dt: time for which an action is held [s].
        belief: as in `apollonius.game.types.Sight`; None for a side that sees all.
    """

    arena: Arena
    own: Robot
    mates: tuple[Robot, ...]
    opponents: tuple[Robot, ...]
    capture_distance: Real
    dt: Real
    belief: Float[Array, "rows columns"] | None = None

    @property
    def chart(self) -> Chart:
        """The arena's chart; raises InvalidInput in an arena without one."""
        chart = self.arena.chart
        if chart is None:
            remedy = "draw it by apollonius.arenas.charting.with_chart"
            raise InvalidInput(f"a player that reads an arena's chart: {remedy}.")
        return chart

    @property
    def opponent(self) -> Robot:
        """The opponent or, of several that are in play, the one whose centre is nearest."""
        states = [robot.state for robot in self.opponents]
        active = [robot.active for robot in self.opponents]
        return nearest(self.own.state, states, active, self.opponents)

    @property
    def robots(self) -> tuple[Robot, Robot]:
        """The robot and that opponent, the one that looks first."""
        return self.own, self.opponent


def look(game: Game, state: GameState, role: Role, number: int = 0) -> View:
    """Return the view of one robot in a state of the game.

    Args:
        game: the rules.
        state: the state, as the robot's side knows it.
        role: the robot's side.
        number: the robot's index in its side.
    """
    local_game = game.at(state)

    def robots(role: Role) -> tuple[Robot, ...]:
        return tuple(map(Robot, local_game.bodies[role], state.robots[role], state.active[role]))

    side_robots = _robots_of_side(local_game, role, robots(role), state.drives)
    opponents = robots(role.other)
    belief = None
    sight = state.sight
    if sight is not None:
        pairs = zip(opponents, sight.ages, strict=True)
        opponents = tuple(replace(robot, age=age) for robot, age in pairs)
        belief = sight.belief
    mates = side_robots[:number] + side_robots[number + 1 :]
    return View(
        arena=local_game.arena,
        own=side_robots[number],
        mates=mates,
        opponents=opponents,
        capture_distance=local_game.capture_distance,
        dt=local_game.dt,
        belief=belief,
    )


def _robots_of_side(
    game: Game, role: Role, robots: tuple[Robot, ...], drives: DriveStates | None
) -> tuple[Robot, ...]:
    """Return the robots of a side with what they know of their drives in a game in one arena."""
    drive = drive_of(game.drives, role)
    if not drives or not jax.tree.leaves(drive):
        return robots

    def with_drive(robot: Robot, driven: DriveState) -> Robot:
        soon, rate = predict_after_lag(drive, driven, robot.body, robot.state, game.dt)
        return replace(robot, predicted_state=soon, turn_time=drive.turn_time, turn_rate=rate)

    return tuple(map(with_drive, robots, drives))


Row = tuple[GameState, Int[Array, ""] | None]
"""One robot in one game: the state with the side's robots in an order that begins with it, and its
number; None for the only robot of a side."""


def robot_rows(states: GameState, role: Role) -> tuple[GameState, Int[Array, " rows"] | None]:
    """Return a row for each robot of a side in each game, leaves `[games]`: those of the first
    robots come first, then the second's."""
    count, games = len(states.robots[role]), states.steps.shape[0]
    if count == 1:
        return states, None

    def first(number: int) -> GameState:
        def rotate(values: BySide[tuple[T, ...]]) -> BySide[tuple[T, ...]]:
            own = values[role]
            return BySide.of(role, own[number:] + own[:number], values[role.other])

        def of_one(state: GameState) -> GameState:
            drives = state.drives and state.drives[number:] + state.drives[:number]
            return replace(
                state, robots=rotate(state.robots), status=rotate(state.status), drives=drives
            )

        return jax.vmap(of_one)(states)

    return _concatenate_states(*map(first, range(count))), jnp.repeat(jnp.arange(count), games)


def look_from_row(game: Game, role: Role, row: Row) -> View:
    """Return the view of the robot of one row of `robot_rows`."""
    state, number = row
    return look(
        game if number is None else _with_robot_first(game.at(state), role, number), state, role
    )


@fusion_barrier
def _concatenate_states(*states: GameState) -> GameState:
    """Concatenate batches of states, so that whatever follows is computed once for all rows."""
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *states)


def _with_robot_first(game: Game, role: Role, number: Int[Array, ""]) -> Game:
    """Return a game in one arena with the bodies of one side in another order, that of this number
    first.
    """
    bodies = game.bodies[role]

    def body_at(place: int) -> Unicycle:
        def pick(*leaves: Real) -> Scalar:
            is_turn = [(number + place) % len(bodies) == other for other in range(len(bodies))]
            return jnp.select(is_turn, [jnp.asarray(leaf, jnp.float32) for leaf in leaves])

        return jax.tree.map(pick, *bodies)

    first, *mates = map(body_at, range(len(bodies)))
    name = role.name.lower()
    teams = replace(game.teams or Teams(), **{f"{name}s": tuple(mates)})
    return replace(game, **{name: first}, teams=teams)
