"""A player that does not crash: another player's actions, unless they leave no way to stop in time."""

from collections.abc import Callable
from math import ceil

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.policy import AbstractPolicy, acts_continuously
from apollonius.errors import require
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle, gears
from apollonius.game.game import Game
from apollonius.game.observation import own_state
from apollonius.game.types import NUM_ACTIONS, Action, Real, RobotState, Role, Scalar

MARGIN = 1e-3
"""Room [m] that must be left: many times what is lost when a state is read from an observation."""
BRAKING = (0, 1, 2)
"""Actions that brake: while turning right, going straight, or turning left."""


class Brake(eqx.Module):
    """The manoeuvre that holds one braking action to the end."""

    action: int = eqx.field(static=True)

    def __call__(self, robot: RobotState) -> Int[Array, ""]:
        """The action, wherever the robot is."""
        return jnp.full((), self.action, jnp.int32)


class Backup(eqx.Module):
    """Manoeuvres in which a robot comes to rest, played by the rules' own dynamics and contact.

    Attributes:
        arena, body, dt: what the manoeuvres are tried on.
        steps: how many steps they last.
        manoeuvres: each the braking action to take in a state.
    """

    arena: Arena
    body: Unicycle
    dt: Real
    steps: int = eqx.field(static=True)
    manoeuvres: tuple[Callable[[RobotState], Int[Array, ""]], ...] = tuple(Brake(action) for action in BRAKING)

    def room(self, robot: RobotState) -> Scalar:
        """Least clearance [m] on the way to rest by the best of the manoeuvres, the body's radius taken off."""

        def one_step(carry: list[tuple[RobotState, Scalar]], _: None) -> tuple[list[tuple[RobotState, Scalar]], None]:
            moved = []
            for (before, least), manoeuvre in zip(carry, self.manoeuvres, strict=True):
                after = self._hold(before, manoeuvre(before))
                moved.append((after, jnp.minimum(least, self.arena.clearance_along(before, after))))
            return moved, None

        here = self.arena.clearance(robot.x, robot.y)
        ends, _ = jax.lax.scan(one_step, [(robot, here)] * len(self.manoeuvres), None, self.steps)
        return jnp.max(jnp.stack([least for _, least in ends])) - self.body.radius

    def room_after(self, robot: RobotState, action: Action) -> Scalar:
        """The same, for the way that begins with one step of an action."""
        after = self._hold(robot, action)
        return jnp.minimum(self.arena.clearance_along(robot, after) - self.body.radius, self.room(after))

    def _hold(self, robot: RobotState, action: Action) -> RobotState:
        return self.body.move(robot, *self.body.controls(action), self.dt)


class Shielded(AbstractPolicy):
    """Another player, held back from actions after which the robot could not brake to rest without touching anything.

    An action is allowed where, after it, one of the backup manoeuvres comes to rest with room to spare. The rest of
    that manoeuvre is then allowed in the next step, and so on; so from rest, or from any state from which one of the
    manoeuvres is free, the robot never fails. This is a safety filter with backup manoeuvres (Hobbs et al., "Runtime
    assurance for safety-critical systems", 2023): what it calls safe is a part of the viability kernel.

    A player with continuous actions keeps its own where that is allowed, and otherwise has the allowed discrete action
    nearest to it.

    Attributes:
        policy: the player behind the shield.
        backup: the manoeuvres.
    """

    policy: AbstractPolicy
    backup: Backup

    @property
    def observation(self) -> str:
        """What the player behind the shield sees."""
        return self.policy.observation

    def __call__(self, observation: Float[Array, " size"], word: UInt32[Array, ""]) -> Action:
        own = own_state(self.observation, self.backup.arena, self.backup.body, observation)
        room = jax.vmap(lambda action: self.backup.room_after(own, action))(jnp.arange(NUM_ACTIONS))
        allowed = room > MARGIN
        among = self.policy.act_among(allowed, observation, word)
        safest = jnp.where(jnp.any(allowed), among, jnp.argmax(room)).astype(jnp.int32)
        if not acts_continuously(self.policy):
            return safest
        wanted = self.policy(observation, word)
        return jnp.where(self.backup.room_after(own, wanted) > MARGIN, wanted, jnp.stack(gears(safest)))


def brakes(game: Game, role: Role) -> Backup:
    """Full braking in three directions, for the robot of one side of a game.

    Raises:
        InvalidInput: when that side's robot cannot brake to rest.
    """
    body = game.pursuer if role == Role.PURSUER else game.evader
    bound = "0 and more than 0: of a robot that can stop, as it does when it brakes"
    require(body.brakes_to_rest, "v_min, u1_max", (body.v_min, body.u1_max), bound)
    return Backup(game.arena, body, game.dt, steps=ceil(body.v_max / (body.u1_max * game.dt)))


def shielded(policy: AbstractPolicy, game: Game, role: Role) -> Shielded:
    """A player behind a shield, for one side of a game; errors as those of `brakes`."""
    return Shielded(policy, brakes(game, role))
