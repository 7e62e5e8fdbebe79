"""A robot between two decisions: it holds an action for some steps of the game."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, UInt8

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, Action, Real, RobotState, Role, Scalar
from apollonius.io.limits import HOLD

HORIZON = 20.0
"""Time scale [s] of the discount of later outcomes, exp(-t / HORIZON); it tells much longer times apart less well."""
NEVER = 255
"""The step of what does not happen within a hold, later than any step of one."""
UNROLL = 5
"""Steps compiled in a row: quicker than a loop, and no longer to compile for a long hold."""


class Motion(eqx.Module):
    """One robot alone in its arena, by the rules' own dynamics and contact, which holds actions for some steps."""

    body: Unicycle
    arena: Arena
    dt: Real
    steps: int = eqx.field(static=True)

    @property
    def seconds(self) -> Real:
        return self.steps * self.dt

    @property
    def farthest(self) -> float:
        """Longest distance of a hold [m]."""
        return float(max(abs(self.body.v_min), abs(self.body.v_max)) * self.seconds)

    @property
    def discount(self) -> Scalar:
        """Value before a hold of what has the value 1 after it."""
        return discount_after(self.seconds)

    def hold(self, robot: RobotState, action: Action) -> RobotState:
        """Return the states along a hold, from the first to that after the last step: leaves `[steps + 1]`."""
        controls = self.body.controls(action)

        def one_step(before: RobotState, _: None) -> tuple[RobotState, RobotState]:
            after = self.body.move(before, *controls, self.dt)
            return after, after

        _, course = jax.lax.scan(one_step, robot, None, self.steps, unroll=min(self.steps, UNROLL))
        return jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), robot, course)

    def clearance(self, course: RobotState) -> Scalar:
        """Return the least clearance [m] of the body along a course, step by step as the rules judge it."""
        return jnp.min(jax.vmap(self.arena.clearance_along)(*ends(course))) - self.body.radius

    def failure(self, course: RobotState) -> UInt8[Array, ""]:
        """Return the step of a course in which the body first touches something, from 1; `NEVER` if in none."""
        touches = jax.vmap(self.arena.clearance_along)(*ends(course)) < self.body.radius
        return jnp.where(jnp.any(touches), jnp.argmax(touches) + 1, NEVER).astype(jnp.uint8)


def every_hold(motion: Motion, robots: RobotState) -> RobotState:
    """Return the courses of all nine actions in several games, leaves `[games]`: leaves `[steps + 1, 9, games]`."""
    in_games = jax.vmap(motion.hold, (0, None), -1)
    return jax.vmap(in_games, (None, 0), 1)(robots, jnp.arange(NUM_ACTIONS))


def discount_after(seconds: Real | Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Return the value of an outcome in some seconds that would have the value 1 at once."""
    return jnp.exp(-jnp.asarray(seconds, jnp.float32) / HORIZON)


def ends(course: RobotState) -> tuple[RobotState, RobotState]:
    """Return the states before and after each step of a course: leaves `[steps]`."""
    return jax.tree.map(lambda leaf: leaf[:-1], course), jax.tree.map(lambda leaf: leaf[1:], course)


def last(course: RobotState) -> RobotState:
    """Return the state at the end of a course."""
    return jax.tree.map(lambda leaf: leaf[-1], course)


def motion_of(game: Game, role: Role, steps: int) -> Motion:
    """Return the motion of one side's robot; raises InvalidInput for a hold of no step, or too long for memory."""
    HOLD.require("hold", steps)
    game.require_one_arena("a table")
    game.require_two("a table")
    return Motion(game.body(role), game.arena, game.dt, steps)
