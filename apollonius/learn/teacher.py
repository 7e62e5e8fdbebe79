"""The teacher of a distillation: values of the nine actions, and the clearance that they leave."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, GameState, Real, RobotState, Role, Scalar
from apollonius.learn.one_side import TrainingTask
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.observation import observation_rows
from apollonius.solve.grid import Grid
from apollonius.solve.motion import Motion, end_state, motion_of
from apollonius.solve.players import SaddlePolicy

_AHEAD = 2
"""Steps of an action, of about 0.1 s, after which the clearance is looked up."""
DEEPEST = 0.3
"""Largest difference to the best action, before clearance counts: capacity spent on how bad a bad
action is would be lost to the choice between good ones.
"""
STEEPNESS = 10.0
"""Cost of a missing metre of clearance, on the scale of the paper's robots."""
COSTLIEST = 0.8
"""Largest cost of missing clearance."""


class Clearance(eqx.Module):
    """The cost of missing clearance, of what is less than the `margin` [m] after `_AHEAD` steps, by
    the table of `solve_safety`.
    """

    motion: Motion
    grid: Grid
    table: Float[Array, "v heading x y"]
    margin: Real

    def after(self, robot: RobotState, actions: Int[Array, " actions"]) -> Float[Array, " actions"]:
        """Return the clearance [m] that can be kept for ever after each action."""

        def clearance(action: Int[Array, ""]) -> Scalar:
            course = self.motion.hold(robot, action)
            return jnp.minimum(
                self.motion.clearance(course), self.grid.interpolate(self.table, end_state(course))
            )

        return jax.vmap(clearance)(actions)

    def weigh_against(self, behind: Float[Array, "9"], robot: RobotState) -> Float[Array, "9"]:
        """Return the differences to the best action, less the cost of missing clearance.

        As clearance runs out, the given differences fade, and clearance alone decides in the end: a
        wall is reached by many steps, none of which leaves much less clearance than another would.
        """
        left = jnp.minimum(self.after(robot, jnp.arange(NUM_ACTIONS)), self.margin)
        most = jnp.max(left)
        ease = jnp.clip(most / self.margin, 0.0, 1.0)
        return ease * behind - jnp.minimum(STEEPNESS * (most - left), COSTLIEST)


def motion_of_clearance(game: Game, role: Role) -> Motion:
    """Return the motion after which the clearance is looked up, by the actions of a side's
    robots.
    """
    return motion_of(game, role, _AHEAD)


class DistillationTask(TrainingTask):
    """A game with a teacher, which values all nine actions, the value of a lost game in its units,
    and the clearance that actions leave, or None.

    Some games are those of attackers, who look ahead by a table, the other side's player by the
    game solved in this one arena; None without any.
    """

    teacher: AbstractActionValuePolicy
    loss_value: Real
    clearance: Clearance | None
    table: SaddlePolicy | None

    def values(self, states: GameState, role: Role) -> Float[Array, "games 9"]:
        """Return one side's values of the nine actions in states, leaves `[games]`; the best has
        the teacher's own.
        """
        read, rows = observation_rows(
            self.teacher.observation, self.game, Knowledge.complete(states), role
        )
        bits = jnp.zeros((), jnp.uint32)
        values = jax.vmap(lambda row: self.teacher.score(read(row), self.teacher.memory, bits)[0])(
            rows
        )
        best = jnp.max(values, axis=1, keepdims=True)
        behind = jnp.maximum((values - best) / self.loss_value, -DEEPEST)
        if self.clearance is not None:
            behind = jax.vmap(self.clearance.weigh_against)(behind, states.robots[role][0])
        return best + self.loss_value * (behind - jnp.max(behind, axis=1, keepdims=True))
