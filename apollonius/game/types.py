"""The two sides, robots, actions, outcomes, the state of the game, and one transition."""

from collections.abc import Callable, Iterator, Sequence
from enum import IntEnum
from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.io.errors import require

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
U = TypeVar("U")

Scalar = Float[Array, ""]
"""A traced real number; its unit is in the docstring of its owner."""

Flag = Bool[Array, ""]
"""A traced truth value."""

RandomBits = UInt32[Array, ""]
"""Random bits, 32 as one number."""

Real = float | int | Array
"""A parameter of the rules: a Python float, or an array where a caller sweeps it with `vmap`."""

NUM_ACTIONS = 9
"""3 accelerations x 3 turn rates (Eq. 5)."""

Action = Int[Array, ""] | Float[Array, "2"]
"""A robot's action in a step: one of the nine of Eq. 5, `3 * i_u1 + i_u2` in 0..8, or two numbers
in [-1, 1], the shares of its largest acceleration and of its largest turn rate. Number type and
shape say which before anything runs; each player always does the one or always the other, and both
kinds may meet."""

SideAction = Action | int | Sequence[Action | int]
"""The action of a side's robot, or a list of one for each robot; of a discrete one its number, too.
"""

Controls = tuple[Scalar, Scalar]
"""Acceleration u1 [m/s^2] and turn rate u2 [rad/s] of a robot in a step."""

Actions = Int[Array, " games"] | Float[Array, "games 2"]
"""Actions of one side of a batch of games."""


class NamedEnum(IntEnum):
    """A whole number that is printed by its name."""

    def __str__(self) -> str:
        return self.name


class Role(NamedEnum):
    """The two sides of the game."""

    PURSUER = 0
    EVADER = 1

    @property
    def other(self) -> "Role":
        return Role(1 - self)


class BySide(eqx.Module, Generic[T_co]):
    """One value for each side, indexed by `Role`: `values[role]`, and `values[role.other]` for the
    opponent's.

    The values of a side's robots are a tuple: `BySide[tuple[RobotState, ...]]`.
    """

    pursuer: T_co
    evader: T_co

    @classmethod
    def of(cls, role: int, own: U, other: U) -> "BySide[U]":
        """Return the values of a side, a `Role`, and of its opponents."""
        return BySide(other, own) if role else BySide(own, other)

    def __getitem__(self, role: int) -> T_co:
        return (self.pursuer, self.evader)[role]

    def __iter__(self) -> Iterator[T_co]:
        return iter((self.pursuer, self.evader))

    def map(self, function: Callable[[T_co], U]) -> "BySide[U]":
        return BySide(function(self.pursuer), function(self.evader))


def value_for_each(robots: BySide[tuple[T, ...]]) -> BySide[T]:
    """Return the values of the two robots of a game of two; raises InvalidInput for other numbers
    of robots.
    """
    counts = " v ".join(str(len(side)) for side in robots)
    require(
        counts == "1 v 1", "robots", counts, "1 v 1: this is known for games of two robots only"
    )
    return robots.map(lambda side: side[0])


def tree_where(condition: Bool[Array, "..."], value: T, other: T) -> T:
    """Return the first of two pytrees where the flags say so, elsewhere the other."""

    def select(leaf: Any, other_leaf: Any) -> Any:
        return leaf if leaf is other_leaf else jnp.where(condition, leaf, other_leaf)

    return jax.tree.map(select, value, other)


ROLES = BySide(Role.PURSUER, Role.EVADER)
"""Both sides."""


class Outcome(NamedEnum):
    """Outcomes: the rows of Tables II and III, plus `BOTH_FAILED` for two failures in one step.

    `TERRITORY_REACHED`, by the evader, is possible only where an arena has a territory. A decided
    game of teams has the outcome of the last robot of the beaten side; a body of a team mate counts
    as an obstacle.
    """

    ONGOING = 0
    CAPTURED = 1
    PURSUER_HIT_OBSTACLE = 2
    EVADER_HIT_OBSTACLE = 3
    PURSUER_OUT_OF_RANGE = 4
    EVADER_OUT_OF_RANGE = 5
    BOTH_FAILED = 6
    NO_RESULT = 7
    TERRITORY_REACHED = 8


class RobotStatus(NamedEnum):
    """A robot in play, or the reason why it is not. `HIT_MATE` is possible only where a game asks
    for it.
    """

    ACTIVE = 0
    CAPTURED = 1
    HIT_OBSTACLE = 2
    OUT_OF_RANGE = 3
    HIT_MATE = 4


class RobotState(eqx.Module):
    """The state of one robot (Eq. 6): position, speed and heading.

    `x`, `y` in metres in the arena's frame; `v` in m/s along the heading;
    `heading` in radians from the x axis, counter-clockwise, wrapped to (-pi, pi].
    """

    x: Scalar
    y: Scalar
    v: Scalar
    heading: Scalar


class DriveState(eqx.Module):
    """The latest commands u1 [m/s^2] and u2 [rad/s], newest first, and the turn rate [rad/s]."""

    pending: Float[Array, "*batch lag 2"] | None
    turn_rate: Float[Array, "*batch"] | None


DriveStates = tuple[DriveState, ...]
"""The drives of the robots of a side."""


class MoverMotion(eqx.Module):
    """Places x, y of movers [m], and their velocities in the last step [m/s]."""

    x: Float[Array, "*batch movers"]
    y: Float[Array, "*batch movers"]
    vx: Float[Array, "*batch movers"]
    vy: Float[Array, "*batch movers"]


class MoverStates(eqx.Module):
    """The movers of a game: shuttles, doors, then walkers, in the order of the rules.

    Attributes:
        motion: of all.
        clocks: of shuttles and doors, since the start of their periods [s].
        goal_x, goal_y: where walkers go [m].
        bits: random bits of each walker, drawn at the start.
    """

    motion: MoverMotion
    clocks: Float[Array, "*batch timed"]
    goal_x: Float[Array, "*batch walkers"]
    goal_y: Float[Array, "*batch walkers"]
    bits: UInt32[Array, "*batch walkers"]


def active_flags(status: BySide[tuple[Int[Array, ""], ...]]) -> BySide[tuple[Flag, ...]]:
    """Check whether each robot is in play, by the `RobotStatus` of each."""
    return status.map(lambda side: tuple(robot == RobotStatus.ACTIVE for robot in side))


class GameState(eqx.Module):
    """The robots of both sides, and the number of control steps played since the start.

    `variant` is the number of the game's arena and robots in its scenario, None where there is no
    scenario. `status` is a `RobotStatus` for each robot. `movers` are things that move by
    themselves, None in a game without any.
    """

    robots: BySide[tuple[RobotState, ...]]
    steps: Int[Array, ""]
    status: BySide[tuple[Int[Array, ""], ...]]
    variant: Int[Array, ""] | None = None
    movers: MoverStates | None = None

    @classmethod
    def at_start(cls, robots: BySide[tuple[RobotState, ...]]) -> "GameState":
        """Return the state at the start: all robots are active."""
        active = jnp.full((), RobotStatus.ACTIVE, jnp.int32)
        status = robots.map(lambda side: (active,) * len(side))
        return cls(robots, jnp.zeros((), jnp.int32), status)

    @property
    def active(self) -> BySide[tuple[Flag, ...]]:
        """Check whether each robot is in play."""
        return active_flags(self.status)

    @property
    def in_play(self) -> BySide[tuple[Flag, ...]]:
        """Check whether each robot takes part in the next step of a game that is not over.

        Of two robots both do, since the game is over when one is out. As constants these flags and
        all that depends on them cost nothing.
        """
        if all(len(side) == 1 for side in self.robots):
            return self.robots.map(lambda side: (jnp.ones(side[0].x.shape, bool),))
        return self.active

    @classmethod
    def of_two(cls, pursuer: RobotState, evader: RobotState, steps: Int[Array, ""]) -> "GameState":
        """Return the state of a game of two robots that are active."""
        active = jnp.full(jnp.shape(steps), RobotStatus.ACTIVE, jnp.int32)
        return cls(BySide((pursuer,), (evader,)), steps, BySide((active,), (active,)))

    @property
    def pursuer(self) -> RobotState:
        return value_for_each(self.robots).pursuer

    @property
    def evader(self) -> RobotState:
        return value_for_each(self.robots).evader


class Timestep(eqx.Module):
    """One transition: the next state, its outcome, and every robot's reward.

    `terminated`: the rules ended the game. `truncated`: the time limit stopped it, so its value
    continues beyond. Never both.
    """

    state: GameState
    outcome: Int[Array, ""]
    rewards: BySide[tuple[Scalar, ...]]
    terminated: Flag
    truncated: Flag

    @property
    def reward(self) -> BySide[Scalar]:
        """The rewards of a game of two robots."""
        return value_for_each(self.rewards)
