"""Players that flee: straight away, past walls and obstacles."""

from math import ceil
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.classical import AbstractClassical, AbstractSteering, direction, separation
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, Real, RobotState, Role, Scalar
from apollonius.observe.view import Robot, View

_HORIZON = 4.0
"""How far ahead [s] a fleeing robot looks: the paper's takes as long to stop from its top speed."""

_Reached = tuple[RobotState, Scalar, Scalar]
"""State that a robot has reached, least clearance on its way [m], and number of steps with clearance enough."""


class Flee(AbstractSteering):
    """Moves in the direction furthest from the pursuer: the heuristic evader of the paper's reference [13].

    Egorov, "Multi-Agent Deep Reinforcement Learning" (2016). It minds neither walls nor obstacles.
    """

    def course(self, seen: View) -> tuple[Scalar, Scalar]:
        return direction(seen.opponent.state, seen.own.state), jnp.asarray(seen.own.body.v_max, jnp.float32)


class FleeAware(AbstractClassical):
    """Moves to where it will be furthest from the pursuer, among the ways that touch neither wall nor obstacle.

    The dynamic window approach (Fox, Burgard and Thrun, 1997): each action is tried for 4 s ahead, and judged by the
    distance from the pursuer there, which is taken to go straight on, and by its least clearance on the way.

    Attributes:
        steps: how many steps it looks ahead.
        margin: least clearance of a way [m].
        caution: value of a metre of clearance, in metres of distance; beyond 1 m it has none.
    """

    steps: int | Array = eqx.field(static=True, default=40)
    margin: Real = 0.1
    caution: Real = 1.0

    @classmethod
    def for_side(cls, game: Game, role: Role, **rule: Any) -> AbstractClassical:
        return super().for_side(game, role, steps=ceil(_HORIZON / game.dt), **rule)

    def values(self, seen: View) -> Float[Array, "9"]:
        """Return distance and clearance in metres; where that runs out, how late, below all ways on which it lasts."""
        coast, body = jnp.zeros(()), seen.own.body
        pursuer = seen.opponent.body.move(seen.opponent.state, coast, coast, self.steps * self.dt)

        def value(action: Int[Array, ""]) -> Scalar:
            def one_step(_: Int[Array, ""], reached: _Reached) -> _Reached:
                robot, clearance, clear = reached
                after = self.hold(Robot(body, robot), action)
                clearance = jnp.minimum(clearance, seen.arena.clearance_along(robot, after) - body.radius)
                return after, clearance, clear + (clearance > self.margin).astype(jnp.float32)

            start = seen.own.state, jnp.asarray(jnp.inf, jnp.float32), jnp.zeros(())
            end, clearance, clear = jax.lax.fori_loop(0, self.steps, one_step, start)
            lasts = separation(end, pursuer) + self.caution * jnp.minimum(clearance, 1.0)
            runs_out = clear - self.steps
            return jnp.where(clearance > self.margin, lasts, runs_out)

        return jax.vmap(value)(jnp.arange(NUM_ACTIONS))
