"""The player that follows a potential field, chasing or fleeing."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from apollonius.agents.classical import AbstractClassical, AbstractSteering, facing_speed
from apollonius.game.game import Game
from apollonius.game.types import Real, Role, Scalar
from apollonius.observe.view import View


class PotentialField(AbstractSteering):
    """Goes where an artificial potential falls: to or from the opponent, and away from walls and obstacles.

    Khatib, "Real-Time Obstacle Avoidance for Manipulators and Mobile Robots" (1986). The opponent's part is a cone: it
    pulls or pushes with strength 1 from everywhere. Each wall and obstacle within reach adds Khatib's own
    `strength / 2 (1 / clearance - 1 / reach)^2`. As the field knows nothing of inertia, the robot is never to be
    faster than it could stop within the room it has. It may still crash, and where the forces cancel it is held.

    Attributes:
        chases: whether the opponent pulls, as it does the pursuer, or pushes.
        reach: clearance [m] beyond which a wall or obstacle is not felt.
        strength: of the repulsion [m]; it balances the opponent where
            `strength (1 / clearance - 1 / reach) / clearance^2 = 1`.
    """

    chases: bool = eqx.field(static=True, default=True)
    reach: Real = 2.0
    strength: Real = 0.2

    @classmethod
    def for_side(cls, game: Game, role: Role, **rule: Any) -> AbstractClassical:
        """The player of one side of a game: the pursuer chases."""
        return super().for_side(game, role, chases=role == Role.PURSUER, **rule)

    def course(self, seen: View) -> tuple[Scalar, Scalar]:
        """Along the force, as fast as the turn still to be made and the room to stop in allow."""
        body, own = seen.own.body, seen.own.state
        slope_x, slope_y = jax.grad(self.potential, argnums=(0, 1))(own.x, own.y, seen)
        heading = jnp.arctan2(-slope_y, -slope_x)
        room = jnp.maximum(seen.arena.clearance(own.x, own.y) - body.radius, 0.0)
        stopping = jnp.sqrt(2 * body.u1_max * room)
        return heading, jnp.minimum(facing_speed(body, own, heading), stopping)

    def potential(self, x: Scalar, y: Scalar, seen: View) -> Scalar:
        """The potential [m] that the robot would have at a place."""
        opponent = seen.opponent.state
        distance = jnp.hypot(x - opponent.x, y - opponent.y)
        total = distance if self.chases else -distance
        for clearance in seen.arena.clearances(x, y):
            room = jnp.maximum(clearance - seen.own.body.radius, 1e-3)
            total = total + self.strength / 2 * jnp.maximum(1 / room - 1 / self.reach, 0.0) ** 2
        return total
