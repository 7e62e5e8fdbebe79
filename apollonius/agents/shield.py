"""A player that does not crash: another player's actions, unless they leave no way to stop in time."""

from collections.abc import Callable
from dataclasses import replace
from math import ceil
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.batching import batched_by, spread, where_needed
from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle, gears
from apollonius.game.game import Game
from apollonius.game.nearby import Edges, Surroundings, surroundings
from apollonius.game.types import NUM_ACTIONS, Action, Actions, Real, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.observe.view import View

MARGIN = 1e-3
"""Room [m] that must be left: many times what rounding can make of it."""
BRAKING = (0, 1, 2)
"""Actions that brake: while turning right, going straight, or turning left."""
_TRIED = 8
"""Robots that may not do what they want for which all actions are tried at a time."""


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
        surroundings: the arena's polygons by where a robot is; None: all are looked at from everywhere.
        anywhere: whether arena and body are those of the view, where they differ from state to state or robot to robot.
    """

    arena: Arena
    body: Unicycle
    dt: Real
    steps: int = eqx.field(static=True)
    manoeuvres: tuple[Callable[[RobotState], Int[Array, ""]], ...] = tuple(Brake(action) for action in BRAKING)
    surroundings: Surroundings | None = None
    anywhere: bool = eqx.field(static=True, default=False)

    def of(self, view: View) -> "Backup":
        """The manoeuvres of the robot that sees this."""
        return replace(self, arena=view.arena, body=view.own.body) if self.anywhere else self

    def room(self, robot: RobotState) -> Scalar:
        """Least clearance [m] on the way to rest by the best of the manoeuvres, the body's radius taken off.

        Polygons that are out of reach by the `surroundings` are left out: where that makes a difference, there is more
        room than `MARGIN` without them and with them.
        """
        return jnp.max(self.rooms(robot))

    def rooms(self, robot: RobotState) -> Float[Array, " manoeuvres"]:
        """The same by each of the manoeuvres."""
        return self._rooms(robot, self._near(robot))

    def room_after(self, robot: RobotState, action: Action) -> Scalar:
        """The same, for the way that begins with one step of an action."""
        near = self._near(robot)
        after = self._hold(robot, action)
        (clearance,) = self._along([robot], [after], near)
        if near is not None:
            clearance = jnp.minimum(clearance, near.clearance_from(robot.x, robot.y))
        return jnp.minimum(clearance - self.body.radius, jnp.max(self._rooms(after, near)))

    def _rooms(self, robot: RobotState, near: Edges | None) -> Float[Array, " manoeuvres"]:
        def one_step(_: Int[Array, ""], carry: list[tuple[RobotState, Scalar]]) -> list[tuple[RobotState, Scalar]]:
            before = [robot for robot, _ in carry]
            after = [self._hold(at, manoeuvre(at)) for at, manoeuvre in zip(before, self.manoeuvres, strict=True)]
            clearances = self._along(before, after, near)
            moved = zip(after, carry, clearances, strict=True)
            return [(to, jnp.minimum(least, clearance)) for to, (_, least), clearance in moved]

        here = self._arena(near).clearance(robot.x, robot.y)
        if near is not None:
            here = jnp.minimum(here, near.clearance_from(robot.x, robot.y))
        ends = jax.lax.fori_loop(0, self.steps, one_step, [(robot, here)] * len(self.manoeuvres))
        return jnp.stack([least for _, least in ends]) - self.body.radius

    def _near(self, robot: RobotState) -> Edges | None:
        return self.surroundings.near(robot.x, robot.y) if self.surroundings else None

    def _arena(self, near: Edges | None) -> Arena:
        """What is left of the arena where the polygons' edges are given."""
        return self.arena if near is None else replace(self.arena, polygons=())

    def _along(self, before: list[RobotState], after: list[RobotState], near: Edges | None) -> list[Scalar]:
        """Least clearance [m] on each of some segments."""
        arena = self._arena(near)
        clearances = [arena.clearance_along(one, other) for one, other in zip(before, after, strict=True)]
        if near is None:
            return clearances
        return [jnp.minimum(*both) for both in zip(clearances, near.clearances_along(before, after), strict=True)]

    def _hold(self, robot: RobotState, action: Action) -> RobotState:
        return self.body.move(robot, *self.body.controls(action), self.dt)


class Shielded(AbstractWrapper):
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

    backup: Backup

    def __call__(self, seen: View, memory: Memory, bits: UInt32[Array, ""]) -> tuple[Action, Memory]:
        weighed, memory = self.policy.weigh(self.policy.observation(seen), memory, bits)
        return _held_back(self, seen, weighed), memory

    def room_after(self, view: View, action: Action) -> Scalar:
        """Return the room [m] on the way to rest that begins with one step of an action."""
        return self.backup.of(view).room_after(view.own.state, action)

    def wanted(self, weighed: Any) -> Action:
        """Return what the player behind the shield would do."""
        return weighed if self.policy.continuous else self.policy.choose(weighed, jnp.ones(NUM_ACTIONS, bool))

    def instead(self, weighed: Any, room: Float[Array, "9"]) -> Action:
        """Return what it does where that is not allowed, by the room that each of the nine actions leaves."""
        allowed = room > MARGIN
        among = self.policy.choose(weighed, allowed)
        safest = jnp.where(jnp.any(allowed), among, jnp.argmax(room)).astype(jnp.int32)
        return jnp.stack(gears(safest)) if self.policy.continuous else safest


def _held_back_together(size: int, batched: Any, player: Shielded, seen: View, weighed: Any) -> Actions:
    """Return the actions in many games.

    Most of the time robots may do what they want: all nine actions are tried only for those that may not. Each action
    is tried for all of these at once, rather than all actions for each: what is near to a robot is then read from
    memory in a row.
    """
    axes, weighed = jax.tree.map(lambda has: 0 if has else None, batched[1]), spread(size, batched[2], weighed)
    wanted = jax.vmap(player.wanted)(weighed)
    room = jax.vmap(player.room_after, in_axes=(axes, 0), axis_size=size)(seen, wanted)

    def some(games: Int[Array, " few"]) -> Actions:
        theirs = jax.tree.map(lambda leaf, has: leaf[games] if has else leaf, seen, batched[1])
        of_all = jax.vmap(player.room_after, in_axes=(axes, None), axis_size=_TRIED)
        rooms = jax.vmap(of_all, in_axes=(None, 0))(theirs, jnp.arange(NUM_ACTIONS))
        return jax.vmap(player.instead, in_axes=(0, 1))(jax.tree.map(lambda leaf: leaf[games], weighed), rooms)

    return where_needed(~(room > MARGIN), some, wanted, _TRIED)


@batched_by(_held_back_together)
def _held_back(player: Shielded, seen: View, weighed: Any) -> Action:
    """Return the action that a player behind a shield takes, from what it thinks of the nine."""
    wanted = player.wanted(weighed)
    keeps = player.room_after(seen, wanted) > MARGIN
    room = jax.vmap(player.room_after, in_axes=(None, 0))(seen, jnp.arange(NUM_ACTIONS))
    return jnp.where(keeps, wanted, player.instead(weighed, room))


def brakes(game: Game, role: Role) -> Backup:
    """Full braking in three directions, for the robots of one side of a game.

    Raises:
        InvalidInput: when one of that side's robots cannot brake to rest.
    """
    kinds = game.scenario.kinds if game.scenario else None
    bodies = game.bodies[role] if kinds is None else kinds.every(role)
    for body in bodies:
        bound = "0 and more than 0: of a robot that can stop, as it does when it brakes"
        require(body.brakes_to_rest, "v_min, u1_max", (body.v_min, body.u1_max), bound)
    steps = max(ceil(body.v_max / (body.u1_max * game.dt)) for body in bodies)
    body = bodies[0]
    if game.scenario is not None or any(other != body for other in bodies):
        return Backup(game.arena, body, game.dt, steps, anywhere=True)
    return Backup(game.arena, body, game.dt, steps, surroundings=_surroundings(game, body))


def _surroundings(game: Game, body: Unicycle) -> Surroundings | None:
    """The arena's polygons by where a robot is that brakes after one step; None if their numbers are not known yet."""
    arena = game.arena
    numbers = (arena.polygons, arena.x_min, arena.x_max, arena.y_min, arena.y_max, body, game.dt)
    if not arena.polygons or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(numbers)):
        return None
    reach = body.v_max * game.dt + body.v_max**2 / (2 * body.u1_max) + body.radius + MARGIN
    return surroundings(arena.polygons, *map(float, (reach, arena.x_min, arena.x_max, arena.y_min, arena.y_max)))


def shielded(policy: AbstractPolicy, game: Game, role: Role) -> Shielded:
    """A player behind a shield, for one side of a game; errors as those of `brakes`."""
    return Shielded(policy, brakes(game, role))
