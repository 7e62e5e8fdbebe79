"""Players without a network: the one that stands still, the random one, and what those with a rule
share.
"""

from abc import abstractmethod
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy, Memory
from apollonius.game.dynamics import wrap_angle
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, RandomBits, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.paper import PAPER
from apollonius.observe.view import View

BRAKE_STRAIGHT = 1
"""Index of the action (u1 = -u1_max, u2 = 0)."""
COAST = 4
"""Index of the action (u1 = 0, u2 = 0)."""


class AbstractOpenLoop(AbstractPolicy):
    """A player that does not look."""

    @property
    def observation(self) -> AbstractObservation:
        """The paper's observation, for those who collect its transitions."""
        return PAPER

    @classmethod
    def for_side(cls, game: Game, role: Role) -> "AbstractOpenLoop":
        """Return the player of one side of a game."""
        del game, role
        return cls()


class Still(AbstractOpenLoop):
    """Brakes straight ahead and then stays: the stationary evader of stage 1 (Algorithm 1).

    A robot that can drive backwards would do so if it went on braking: it coasts, and so stays
    where it starts at rest.
    """

    action: int = eqx.field(static=True, default=BRAKE_STRAIGHT)

    @classmethod
    def for_side(cls, game: Game, role: Role) -> "Still":
        """Return the player of one side of a game."""
        reverses = any(body.v_min < 0 for body in game.bodies[role])
        return cls(COAST if reverses else BRAKE_STRAIGHT)

    def __call__(
        self, observation: Float[Array, " size"], memory: Memory, bits: RandomBits
    ) -> tuple[Int[Array, ""], Memory]:
        return jnp.full((), self.action, jnp.int32), memory


def uniform_action(bits: RandomBits) -> Int[Array, ""]:
    """Return one of the 9 actions from the upper half of random bits, uniform to 1.5e-5."""
    return (((bits >> 16) * NUM_ACTIONS) >> 16).astype(jnp.int32)


class Uniform(AbstractOpenLoop):
    """Each of the 9 actions with equal probability at every step (section V-B of the paper)."""

    def __call__(
        self, observation: Float[Array, " size"], memory: Memory, bits: RandomBits
    ) -> tuple[Int[Array, ""], Memory]:
        return uniform_action(bits), memory


class AbstractClassical(AbstractActionValuePolicy):
    """A player that reads the view and follows a rule."""

    misfit: ClassVar[tuple[str, str, str]] = ("game", "another", "one for this player")
    """The refusal of a game that its rule does not fit: name, value and bound."""

    @classmethod
    def fits(cls, game: Game) -> bool:
        """Check whether its rule can be followed in a game."""
        return True

    @classmethod
    def for_side(cls, game: Game, role: Role, **rule: Any) -> "AbstractClassical":
        """Return the player of one side of a game; raises InvalidInput where its rule does not fit
        the game.
        """
        require(cls.fits(game), *cls.misfit)
        return cls(**rule)


class AbstractSteering(AbstractClassical):
    """A player whose rule is a course: a heading and a speed to have."""

    def values(self, view: View) -> Float[Array, "9"]:
        """Return the negative distance from the course after each action, in steps of full control.

        So a control is used only while more than half a step is missing, and a robot on its course
        does not oscillate.
        """
        heading, speed = self.course(view)
        own = view.own
        dt = view.dt
        turn = jnp.maximum(own.body.usual_turn_rate * dt, 1e-6)
        thrust = jnp.maximum(own.body.u1_max * dt, 1e-6)

        def value(action: Int[Array, ""]) -> Scalar:
            after = own.body.move(own.state, *own.body.controls(action), dt)
            heading_error = -jnp.abs(wrap_angle(heading - after.heading)) / turn
            return heading_error - jnp.abs(speed - after.v) / thrust

        return jax.vmap(value)(jnp.arange(NUM_ACTIONS))

    @abstractmethod
    def course(self, view: View) -> tuple[Scalar, Scalar]:
        """Return the heading [rad] and the speed [m/s] wanted now."""


def direction(start: RobotState, end: RobotState) -> Scalar:
    """Return the direction [rad] from one robot to another."""
    return jnp.arctan2(end.y - start.y, end.x - start.x)
