"""What the rules speak of: robots, the state of the game, how a game ends, one transition."""

from enum import IntEnum

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.by_side import BySide, one_each

Scalar = Float[Array, ""]
"""A traced real number; its unit is in the docstring of whatever holds it."""

Real = float | int | Array
"""A parameter of the rules: a Python float, or an array where a caller sweeps it with `vmap`."""

NUM_ACTIONS = 9
"""3 accelerations x 3 turn rates (Eq. 5)."""

Action = Int[Array, ""] | Float[Array, "2"]
"""What a robot does in a step: one of the nine actions of Eq. 5, `3 * i_u1 + i_u2` in 0..8, or two gears in [-1, 1],
the shares of its largest acceleration and of its largest turn rate. Which of the two is known by number type and shape,
so before anything runs; a player does always the one or always the other, and both kinds may meet."""

Actions = Int[Array, " games"] | Float[Array, "games 2"]
"""Actions of one side of a batch of games."""


class Role(IntEnum):
    """The two sides of the game."""

    PURSUER = 0
    EVADER = 1

    @property
    def other(self) -> "Role":
        """The opponents' side."""
        return Role(1 - self)


ROLES = BySide(Role.PURSUER, Role.EVADER)
"""Both sides; `ROLES.map` makes something for each."""


class Outcome(IntEnum):
    """How a game stands. The rows of Tables II and III, plus `BOTH_FAILED` for two failures in one step.

    `TERRITORY_REACHED`, by the evader, is possible only where an arena has a territory. A game of teams that is decided
    has the outcome of the last robot of the side that is out altogether; a body of a team mate is an obstacle then.
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


class RobotStatus(IntEnum):
    """Whether a robot is in play, or what put it out. `HIT_MATE` is possible only where a game asks for it."""

    ACTIVE = 0
    CAPTURED = 1
    HIT_OBSTACLE = 2
    OUT_OF_RANGE = 3
    HIT_MATE = 4


class RobotState(eqx.Module):
    """One robot (Eq. 6). Four scalar leaves, so that a batch of robots is four contiguous arrays.

    `x`, `y` in metres in the arena's frame; `v` in m/s along the heading;
    `heading` in radians from the x axis, counter-clockwise, wrapped to (-pi, pi].
    """

    x: Scalar
    y: Scalar
    v: Scalar
    heading: Scalar


class GameState(eqx.Module):
    """The robots of both sides, and the number of control steps played since the start.

    `place` is the number of the arena that the game is played in, None where there is only one (`game.scenario`).
    `status` is a `RobotStatus` for each robot; None in a game of two, which is over when one of them is out.
    """

    robots: BySide[tuple[RobotState, ...]]
    steps: Int[Array, ""]
    place: Int[Array, ""] | None = None
    status: BySide[tuple[Int[Array, ""], ...]] | None = None

    @classmethod
    def at_start(cls, robots: BySide[tuple[RobotState, ...]]) -> "GameState":
        """The state of a game that begins: all robots are active."""
        steps, is_of_two = jnp.zeros((), jnp.int32), all(len(side) == 1 for side in robots)
        active = jnp.full((), RobotStatus.ACTIVE, jnp.int32)
        return cls(robots, steps, status=None if is_of_two else robots.map(lambda side: (active,) * len(side)))

    @property
    def active(self) -> BySide[tuple[Bool[Array, ""], ...]]:
        """Whether each robot is in play."""
        if self.status is None:
            return self.robots.map(lambda side: tuple(jnp.ones(robot.x.shape, bool) for robot in side))
        return self.status.map(lambda side: tuple(status == RobotStatus.ACTIVE for status in side))

    @classmethod
    def of_two(cls, pursuer: RobotState, evader: RobotState, steps: Int[Array, ""]) -> "GameState":
        """The state of a game of two robots."""
        return cls(BySide((pursuer,), (evader,)), steps)

    @property
    def pursuer(self) -> RobotState:
        """The pursuer of a game of two robots."""
        return one_each(self.robots).pursuer

    @property
    def evader(self) -> RobotState:
        """The evader of a game of two robots."""
        return one_each(self.robots).evader


class Timestep(eqx.Module):
    """One transition: the state it leads to, how the game stands there, and what each robot is paid for it.

    `terminated`: the rules ended the game. `truncated`: the time limit stopped it, so its value goes on beyond.
    Never both.
    """

    state: GameState
    outcome: Int[Array, ""]
    rewards: BySide[tuple[Scalar, ...]]
    terminated: Bool[Array, ""]
    truncated: Bool[Array, ""]

    @property
    def reward(self) -> BySide[Scalar]:
        """What either side is paid in a game of two robots."""
        return one_each(self.rewards)
