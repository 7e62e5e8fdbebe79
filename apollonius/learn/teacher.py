"""The teacher of a distillation: what each of the nine actions is worth in a state, as the student shall see it."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, GameState, Real, RobotState, Role, Scalar
from apollonius.observe.observation import perceive
from apollonius.solve.grid import Grid
from apollonius.solve.motion import Motion, last

DEEPEST = 0.3
"""How much worse than the best an action is, at most, before room is looked at: bad is bad, and what a network learns
of how bad is lost to the choice between good ones."""
STEEPNESS = 10.0
"""What a missing metre of room costs."""
COSTLIEST = 0.8
"""What missing room costs at most."""


class Room(eqx.Module):
    """The room that a robot can keep for ever after each of its actions, by the safety table of `solve.safety`.

    Attributes:
        motion: the robot, for as many steps as an action is looked at.
        grid, table: the room [m] at the nodes.
        wanted: with more than this there is nothing to worry about [m].
    """

    motion: Motion
    grid: Grid
    table: Float[Array, "v heading x y"]
    wanted: Real

    def weighed(self, behind: Float[Array, "9"], robot: RobotState) -> Float[Array, "9"]:
        """What the actions are worth once their room counts, from how far each is behind the best.

        As room runs out, what a teacher prefers counts less and less, and room alone in the end: a wall is come to by
        many steps, none of which leaves much less room than another would.
        """
        rooms = jnp.minimum(self.after(robot), self.wanted)
        most = jnp.max(rooms)
        ease = jnp.clip(most / self.wanted, 0.0, 1.0)
        return ease * behind - jnp.minimum(STEEPNESS * (most - rooms), COSTLIEST)

    def after(self, robot: RobotState) -> Float[Array, "9"]:
        """The room after each action [m]."""

        def room(action: Array) -> Scalar:
            course = self.motion.hold(robot, action)
            return jnp.minimum(self.motion.room(course), self.grid.interpolate(self.table, last(course)))

        return jax.vmap(room)(jnp.arange(NUM_ACTIONS))


class Teacher(eqx.Module):
    """A player that values all nine actions, and the room that they leave.

    Attributes:
        policy: the player.
        scale: what a game that is lost is worth to it, about, its sign turned.
        room: of the student's robot; None leaves it out.
    """

    policy: AbstractActionValuePolicy
    scale: Real
    room: Room | None

    def worths(self, game: Game, states: GameState, role: Role) -> Float[Array, "games 9"]:
        """Return what the nine actions are worth in many games, in the player's own units; the best is worth what the
        player says it is.

        Args:
            states: of the games, leaves `[games]`.
            role: the student's side.
        """
        read, rows = perceive(self.policy.observation, game, states, role)
        bits = jnp.zeros((), jnp.uint32)
        values = jax.vmap(lambda row: self.policy.weigh(read(row), self.policy.memory, bits)[0])(rows)
        best = jnp.max(values, axis=1, keepdims=True)
        behind = jnp.maximum((values - best) / self.scale, -DEEPEST)
        if self.room is not None:
            own = states.robots[role][0]
            behind = jax.vmap(self.room.weighed)(behind, own)
        return best + self.scale * (behind - jnp.max(behind, axis=1, keepdims=True))
