"""A player that does not crash: another player's actions, unless they leave no way to stop in time."""

from dataclasses import replace
from math import ceil
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.agents.batching import batched_by, spread
from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle, action_levels, unit_vector
from apollonius.game.game import Game
from apollonius.game.nearby import Surroundings, surroundings
from apollonius.game.polygon import Edges
from apollonius.game.types import NUM_ACTIONS, Action, Actions, Real, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.observe.view import View

MARGIN = 1e-3
"""Clearance [m] that must be left: many times what rounding can make of it."""
BRAKING = (0, 1, 2)
"""Actions that brake: while turning right, going straight, or turning left."""
_TRIED = 8
"""Actions that are tried at a time, of robots that may not do what they want."""
_Clearances = Float[Array, "*games tried"]
"""What the actions tried leave [m]; infinite of the others."""


class Backup(eqx.Module):
    """Manoeuvres in which a robot comes to rest, played by the rules' own dynamics and contact.

    Attributes:
        arena, body, dt: what the manoeuvres are tried on.
        steps: how many steps they last.
        manoeuvres: the braking action that each holds to the end.
        surroundings: the arena's polygons by where a robot is; None: all are looked at from everywhere.
        anywhere: whether arena and body are those of the view, where they differ from state to state or robot to robot.
    """

    arena: Arena
    body: Unicycle
    dt: Real
    steps: int = eqx.field(static=True)
    manoeuvres: tuple[int, ...] = eqx.field(static=True, default=BRAKING)
    surroundings: Surroundings | None = None
    anywhere: bool = eqx.field(static=True, default=False)

    def of(self, view: View) -> "Backup":
        """Return the manoeuvres of the robot that sees this."""
        return replace(self, arena=view.arena, body=view.own.body) if self.anywhere else self

    @jax.jit
    def clearance_after(self, robot: RobotState, action: Action) -> Scalar:
        """Return the least clearance [m] on the best manoeuvre to rest that begins with one step of an action.

        The body's radius is taken off. Polygons that are out of reach by the `surroundings` are left out: where that
        makes a difference, there is more clearance than `MARGIN` without them and with them.
        """
        near, after = self._near(robot), self._hold(robot, action)
        step = self._along(robot, after, near) - self.body.radius
        return jnp.minimum(step, jnp.max(self._clearances(after, near)))

    @jax.jit
    def surely_stops(self, robot: RobotState, action: Action) -> Bool[Array, ""]:
        """Return whether more than `MARGIN` is left if it brakes straight ahead after one step of an action.

        That path is one segment, so this takes little arithmetic; rounding gets another `MARGIN`.
        """
        if self.arena.map is not None:  # whose clearance along a segment depends on where it is cut
            return replace(self, manoeuvres=(1,)).clearance_after(robot, action) > MARGIN
        near, after = self._near(robot), self._hold(robot, action)
        (cos, sin), length = unit_vector(after.heading), after.v**2 / (2 * self.body.u1_max)
        rest = replace(after, x=after.x + length * cos, y=after.y + length * sin)
        least = jnp.minimum(self._along(robot, after, near), self._along(after, rest, near))
        return least - self.body.radius > 2 * MARGIN

    def _clearances(self, robot: RobotState, near: Edges | None) -> Float[Array, " manoeuvres"]:
        def one_step(before: list[RobotState], _: None) -> tuple[list[RobotState], list[RobotState]]:
            after = self._braked(before)
            return after, after

        _, paths = jax.lax.scan(one_step, [robot] * len(self.manoeuvres), length=self.steps)
        after = jax.tree.map(lambda *leaves: jnp.stack(leaves), *paths)
        before = jax.tree.map(
            lambda first, later: jnp.concatenate([jnp.broadcast_to(first, (len(later), 1)), later[:, :-1]], axis=1),
            robot, after,
        )  # fmt: skip
        along = jax.vmap(jax.vmap(lambda start, end: self._along(start, end, near)))(before, after)
        return jnp.min(along, axis=1) - self.body.radius

    def _near(self, robot: RobotState) -> Edges | None:
        return self.surroundings.near(robot.x, robot.y) if self.surroundings else None

    def _along(self, before: RobotState, after: RobotState, near: Edges | None) -> Scalar:
        """Return the least clearance [m] on a segment; of the polygons only the given edges count."""
        if near is None:
            return self.arena.clearance_along(before, after)
        others = replace(self.arena, polygons=()).clearance_along(before, after)
        return jnp.minimum(others, near.clearance_along(before, after))

    def _braked(self, robots: list[RobotState]) -> list[RobotState]:
        """Return the robot of each manoeuvre after one more step."""
        actions = [jnp.full((), action, jnp.int32) for action in self.manoeuvres]
        return [self._hold(robot, action) for robot, action in zip(robots, actions, strict=True)]

    def _hold(self, robot: RobotState, action: Action) -> RobotState:
        return self.body.move(robot, *self.body.controls(action), self.dt)


class Shielded(AbstractWrapper):
    """Another player, held back from actions after which the robot could not brake to rest without touching anything.

    An action is allowed where, after it, one of the backup manoeuvres comes to rest with clearance to spare. The rest
    of that manoeuvre is then allowed in the next step, and so on; so from rest, or from any state from which one of the
    manoeuvres is free, the robot never fails. This is a safety filter with backup manoeuvres (Hobbs et al., "Runtime
    assurance for safety-critical systems", 2023): what it calls safe is a part of the viability kernel.

    A player with continuous actions keeps its own where that is allowed, and otherwise has the allowed discrete action
    nearest to it.
    """

    backup: Backup

    def __call__(self, seen: View, memory: Memory, bits: UInt32[Array, ""]) -> tuple[Action, Memory]:
        weighed, memory = self.policy.weigh(self.policy.observation(seen), memory, bits)
        return _held_back(self, seen, weighed), memory

    def wanted(self, weighed: Any) -> Action:
        """Return what the player behind the shield would do."""
        return weighed if self.policy.continuous else self.policy.choose(weighed, jnp.ones(NUM_ACTIONS, bool))

    @property
    def tried(self) -> int:
        """The number of actions that can be tried: the nine, and its own if that is continuous."""
        return NUM_ACTIONS + self.policy.continuous

    def is_sure(self, seen: View, weighed: Any) -> Bool[Array, ""]:
        """Return whether the player's own action surely is allowed."""
        return self.backup.of(seen).surely_stops(seen.own.state, self.wanted(weighed))

    def next(self, weighed: Any, clearances: _Clearances, others: Array | int) -> tuple[Int[Array, ""], Array]:
        """Return which action is to be tried after some others, and whether there is one."""
        untried = jnp.isinf(clearances)
        left = jax.lax.fori_loop(0, others, lambda _, left: left.at[self._first(weighed, left)].set(False), untried)
        return self._first(weighed, left), jnp.any(left)

    def clearance(self, seen: View, weighed: Any, number: Int[Array, ""]) -> Scalar:
        """Return what an action leaves [m]."""
        return self.backup.of(seen).clearance_after(seen.own.state, self._action(weighed, number))

    def taken(self, weighed: Any, clearances: _Clearances) -> Action:
        """Return the action to be taken at the end: the best that is allowed, or else that which leaves most."""
        allowed, most = _allowed(clearances), jnp.argmax(clearances[:NUM_ACTIONS]).astype(jnp.int32)
        found = self._action(weighed, jnp.where(jnp.any(allowed), self._first(weighed, allowed), most))
        return jnp.where(jnp.all(jnp.isinf(clearances)), self.wanted(weighed), found)

    def _first(self, weighed: Any, among: Bool[Array, " tried"]) -> Int[Array, ""]:
        """Return the number of the action that the player likes best; its own has a number if it is continuous."""
        discrete = self.policy.choose(weighed, among[:NUM_ACTIONS])
        return jnp.where(among[-1], NUM_ACTIONS, discrete) if self.policy.continuous else discrete

    def _action(self, weighed: Any, number: Int[Array, ""]) -> Action:
        if not self.policy.continuous:
            return number
        return jnp.where(number == NUM_ACTIONS, weighed, jnp.stack(action_levels(number)))


def _allowed(clearances: _Clearances) -> Bool[Array, "*games tried"]:
    return ~jnp.isinf(clearances) & (clearances > MARGIN)


def _is_open(clearances: _Clearances) -> Bool[Array, "*games"]:
    """Return whether a search has still to find an action that is allowed, and one to try."""
    return ~jnp.any(_allowed(clearances), axis=-1) & jnp.any(jnp.isinf(clearances), axis=-1)


def _held_back_together(size: int, batched: Any, player: Shielded, seen: View, weighed: Any) -> Actions:
    """Return the actions in many games: a few are tried at a time, several of each robot where few are held back."""
    axes, weighed = jax.tree.map(lambda has: 0 if has else None, batched[1]), spread(size, batched[2], weighed)
    is_sure = jax.vmap(player.is_sure, in_axes=(axes, 0), axis_size=size)(seen, weighed)

    def some(clearances: _Clearances) -> _Clearances:
        (rows,) = jnp.nonzero(~is_sure & _is_open(clearances), size=_TRIED, fill_value=size)
        others, first = jnp.divmod(jnp.arange(_TRIED), jnp.sum(rows < size, dtype=jnp.int32))
        rows = rows[first]
        theirs = jax.tree.map(lambda leaf, has: leaf[rows] if has else leaf, seen, batched[1])
        given = jax.tree.map(lambda leaf: leaf[rows], weighed)
        number, is_left = jax.vmap(player.next)(given, clearances[rows], others)
        found = jax.vmap(player.clearance, in_axes=(axes, 0, 0), axis_size=_TRIED)(theirs, given, number)
        return clearances.at[jnp.where(is_left, rows, size), number].set(found, mode="drop")

    untried = jnp.full((size, player.tried), jnp.inf)
    clearances = jax.lax.while_loop(lambda known: jnp.any(~is_sure & _is_open(known)), some, untried)
    return jax.vmap(player.taken)(weighed, clearances)


@batched_by(_held_back_together)
def _held_back(player: Shielded, seen: View, weighed: Any) -> Action:
    """Return the action that a player behind a shield takes, from what it thinks of the nine."""
    is_sure = player.is_sure(seen, weighed)

    def one(clearances: _Clearances) -> _Clearances:
        number, _ = player.next(weighed, clearances, 0)
        return clearances.at[number].set(player.clearance(seen, weighed, number))

    found = jax.lax.while_loop(lambda known: ~is_sure & _is_open(known), one, jnp.full(player.tried, jnp.inf))
    return player.taken(weighed, found)


def brakes(game: Game, role: Role) -> Backup:
    """Return full braking in three directions, for one side; raises InvalidInput where one of its robots cannot."""
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
    """Return the polygons near a robot that brakes after one step, by its cell; None if they are not known yet."""
    arena = game.arena
    numbers = (arena.polygons, arena.x_min, arena.x_max, arena.y_min, arena.y_max, body, game.dt)
    if not arena.polygons or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(numbers)):
        return None
    reach = body.v_max * game.dt + body.v_max**2 / (2 * body.u1_max) + body.radius + MARGIN
    return surroundings(arena.polygons, *map(float, (reach, arena.x_min, arena.x_max, arena.y_min, arena.y_max)))


def shielded(policy: AbstractPolicy, game: Game, role: Role) -> Shielded:
    """Return a player behind a shield, for one side of a game; errors as those of `brakes`."""
    return Shielded(policy, brakes(game, role))
