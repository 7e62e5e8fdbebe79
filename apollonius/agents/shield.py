"""A player that does not crash: another player's actions, unless they leave no way to stop in time."""

from math import ceil

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.policy import AbstractPolicy
from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.observation import own_state
from apollonius.game.types import NUM_ACTIONS, Real, RobotState, Role, Scalar

MARGIN = 1e-3
"""Room [m] that must be left: many times what is lost when a state is read from an observation."""
_ESCAPES = (0, 1, 2)
"""Brake while turning right, going straight, or turning left."""


class Shielded(AbstractPolicy):
    """Another player, held back from actions after which the robot could not brake to rest without touching anything.

    An action is allowed where, after it, full braking in one of three directions comes to rest with room to spare.
    The rest of that manoeuvre is then allowed in the next step, and so on; so from rest, or from any state from which
    one of the manoeuvres is free, the robot never fails. This is a safety filter with backup manoeuvres (Hobbs et al.,
    "Runtime assurance for safety-critical systems", 2023): what it calls safe is a part of the viability kernel.

    Attributes:
        policy: the player behind the shield.
        arena, body, dt: what the manoeuvres are tried on.
        steps: how many steps they last.
    """

    policy: AbstractPolicy
    arena: Arena
    body: Unicycle
    dt: Real
    steps: int = eqx.field(static=True)

    @property
    def observation(self) -> str:
        """What the player behind the shield sees."""
        return self.policy.observation

    def __call__(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Int[Array, ""]:
        own = own_state(self.observation, self.arena, self.body, observation)
        room = jax.vmap(lambda action: self.room_after(own, action))(jnp.arange(NUM_ACTIONS))
        allowed = room > MARGIN
        action = self.policy.act_among(allowed, observation, word)
        return jnp.where(jnp.any(allowed), action, jnp.argmax(room)).astype(jnp.int32)

    def room_after(self, own: RobotState, action: Int[Array, ""]) -> Scalar:
        """Least clearance [m] during an action and the best of the manoeuvres after it, the body's radius taken off."""
        after = self._hold(own, action)
        room = self.arena.clearance_along(own, after)

        def escape(gear: Int[Array, ""]) -> Scalar:
            def one_step(carry: tuple[RobotState, Scalar], _: None) -> tuple[tuple[RobotState, Scalar], None]:
                robot, least = carry
                moved = self._hold(robot, gear)
                return (moved, jnp.minimum(least, self.arena.clearance_along(robot, moved))), None

            (_, least), _ = jax.lax.scan(one_step, (after, room), None, self.steps)
            return least

        return jnp.max(jax.vmap(escape)(jnp.array(_ESCAPES))) - self.body.radius

    def _hold(self, robot: RobotState, action: Int[Array, ""]) -> RobotState:
        return self.body.move(robot, *self.body.controls(action), self.dt)


def shielded(policy: AbstractPolicy, game: Game, role: Role) -> Shielded:
    """A player behind a shield, for one side of a game.

    Raises:
        InvalidInput: when that side's robot cannot brake to rest.
    """
    body = game.pursuer if role == Role.PURSUER else game.evader
    require(body.v_min <= 0 < body.u1_max, "v_min, u1_max", (body.v_min, body.u1_max), "of a robot that can stop")
    return Shielded(policy, game.arena, body, game.dt, steps=ceil(body.v_max / (body.u1_max * game.dt)))
