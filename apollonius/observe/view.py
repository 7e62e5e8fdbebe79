"""The view of one robot: bodies, states and the arena, in metres, m/s and radians."""

from dataclasses import replace
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.game.arena import Arena
from apollonius.game.chart import Chart
from apollonius.game.drive import PredictedRobot, drive_of, predict_after_lag
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.teams import Teams, nearest
from apollonius.game.types import (
    BySide,
    Controls,
    DriveState,
    DriveStates,
    Flag,
    GameState,
    Real,
    RobotState,
    Role,
    Scalar,
)
from apollonius.game.uncertainty import Uncertainty
from apollonius.io.errors import InvalidInput
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.surroundings import MoversInView, Surroundings

T = TypeVar("T")


class Robot(eqx.Module):
    """A robot in a view.

    Attributes:
        body, state: its limits, and its state as it is known.
        active: whether it is in play.
        age: for how long the robot has been hidden [s].
        predicted_state: its state when a command that is given now takes effect; None if that is
            now, or not known.
        turn_time: in which its drive changes the turn rate by u2_max [s]; None for one that does so
            at once.
        turn_rate: when a command that is given now takes effect [rad/s]; None without a turn time.
        uncertainty: bounds of the errors of all this; None for one that knows itself exactly.
        command: its latest command, u1 [m/s^2] and u2 [rad/s]; None where it is not known.
    """

    body: Unicycle
    state: RobotState
    active: Flag | bool = True
    age: Real = 0.0
    predicted_state: RobotState | None = None
    turn_time: Real | None = None
    turn_rate: Scalar | None = None
    uncertainty: Uncertainty | None = None
    command: Controls | None = None

    @property
    def predicted(self) -> RobotState:
        """The state in which a command that is given now takes effect, as far as that is known."""
        return self.predicted_state or self.state


class View(eqx.Module):
    """The view of one robot, whose mates and opponents are robots too. Nothing in it is scaled.

    Attributes:
        capture_distance: distance at which an evader is captured [m].
        dt: time for which an action is held [s].
        belief: as in `apollonius.observe.knowledge.Knowledge`; None for a side that sees all.
        arena_chart: the chart of the arena; None where nobody reads it.
        movers: things that move by themselves; None in a game without any.
    """

    arena: Arena
    own: Robot
    mates: tuple[Robot, ...]
    opponents: tuple[Robot, ...]
    capture_distance: Real
    dt: Real
    belief: Float[Array, "rows columns"] | None = None
    arena_chart: Chart | None = None
    movers: MoversInView | None = None

    @property
    def chart(self) -> Chart:
        """The arena's chart; raises InvalidInput in a game without one."""
        if self.arena_chart is None:
            remedy = "draw it by apollonius.arenas.charting.with_chart"
            raise InvalidInput(f"a player that reads an arena's chart: {remedy}.")
        return self.arena_chart

    @property
    def surroundings(self) -> Surroundings:
        """The arena's chart and the movers; raises InvalidInput in a game without a chart."""
        return Surroundings(self.chart, self.movers)

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
    """Return the view of one robot of a side that sees everything.

    Args:
        game: the rules.
        state: the state of the game.
        role: the robot's side.
        number: the robot's index in its side.
    """
    return view_of(game, Knowledge.complete(state), role, number)


def view_of(game: Game, knowledge: Knowledge, role: Role, number: int = 0) -> View:
    """Return the view of one robot.

    Args:
        game: the rules.
        knowledge: the knowledge of the robot's side.
        role: the robot's side.
        number: the robot's index in its side.
    """
    local_game = game.at(knowledge)

    def robots(role: Role) -> tuple[Robot, ...]:
        states = knowledge.robots[role]
        return tuple(map(Robot, local_game.bodies[role], states, knowledge.active[role]))

    side_robots = _robots_of_side(local_game, role, robots(role), knowledge.drives)
    opponents = robots(role.other)
    if knowledge.ages is not None:
        pairs = zip(opponents, knowledge.ages, strict=True)
        opponents = tuple(replace(robot, age=age) for robot, age in pairs)
    mates = side_robots[:number] + side_robots[number + 1 :]
    return View(
        arena=local_game.arena,
        own=side_robots[number],
        mates=mates,
        opponents=opponents,
        capture_distance=local_game.capture_distance,
        dt=local_game.dt,
        belief=knowledge.belief,
        arena_chart=local_game.chart,
        movers=_movers_in_view(local_game, knowledge, role),
    )


def _movers_in_view(game: Game, knowledge: Knowledge, role: Role) -> MoversInView | None:
    """Return the movers in the view of a side's robots in a game in one arena."""
    if game.movers is None or knowledge.movers is None:
        return None
    lag = drive_of(game.drives, role).lag
    age = 0.0 if lag is None else jnp.asarray(lag, jnp.float32) * game.dt
    bodies = game.movers.bodies
    return MoversInView(bodies, knowledge.movers, knowledge.movers_in_sight, age)


def _robots_of_side(
    game: Game, role: Role, robots: tuple[Robot, ...], drives: DriveStates
) -> tuple[Robot, ...]:
    """Return the robots of a side with what they know of their drives in a game in one arena."""
    drive, uncertainty = drive_of(game.drives, role), game.uncertainty_of(role)
    uncertain_robots = tuple(replace(robot, uncertainty=uncertainty) for robot in robots)
    if not drives or not jax.tree.leaves(drive):
        return uncertain_robots

    def with_drive(robot: Robot, state: DriveState) -> Robot:
        now = PredictedRobot(robot.state, state.turn_rate, robot.uncertainty)
        soon = predict_after_lag(drive, state, robot.body, now, game.dt)
        return replace(
            robot,
            predicted_state=soon.robot,
            turn_time=drive.turn_time,
            turn_rate=soon.turn_rate,
            uncertainty=soon.uncertainty,
            command=None if state.pending is None else tuple(state.pending[0]),
        )

    return tuple(map(with_drive, uncertain_robots, drives))


Row = tuple[Knowledge, Int[Array, ""] | None]
"""One robot in one game: its side's knowledge with the side's robots in an order that begins with
it, and its number; None for the only robot of a side."""


def robot_rows(knowledge: Knowledge, role: Role) -> tuple[Knowledge, Int[Array, " rows"] | None]:
    """Return a row for each robot of a side in each game, leaves `[games]`: those of the first
    robots come first, then the second's."""
    robots = knowledge.robots[role]
    count, games = len(robots), robots[0].x.shape[0]
    if count == 1:
        return knowledge, None

    def first(number: int) -> Knowledge:
        def rotate(values: BySide[tuple[T, ...]]) -> BySide[tuple[T, ...]]:
            own = values[role]
            return BySide.of(role, own[number:] + own[:number], values[role.other])

        return replace(
            knowledge,
            robots=rotate(knowledge.robots),
            status=rotate(knowledge.status),
            drives=knowledge.drives[number:] + knowledge.drives[:number],
        )

    return _concatenate(*map(first, range(count))), jnp.repeat(jnp.arange(count), games)


def look_from_row(game: Game, role: Role, row: Row) -> View:
    """Return the view of the robot of one row of `robot_rows`."""
    knowledge, number = row
    if number is not None:
        game = _with_robot_first(game.at(knowledge), role, number)
    return view_of(game, knowledge, role)


@fusion_barrier
def _concatenate(*batches: Knowledge) -> Knowledge:
    """Concatenate batches of knowledge, so that whatever follows is computed once for all rows."""
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *batches)


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
