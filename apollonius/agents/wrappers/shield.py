"""A player that does not crash: another's actions, unless they leave no way to stop in time."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.game.arena import Arena
from apollonius.game.drive import limited_turn_rate
from apollonius.game.dynamics import Unicycle, action_levels, unit_vector
from apollonius.game.game import Game
from apollonius.game.near_edges import NearEdges, near_edges
from apollonius.game.packed_arena import LENGTHS, PackedArena, pack, stacked_edges, without_edges
from apollonius.game.polygon import Edges
from apollonius.game.types import (
    NUM_ACTIONS,
    Action,
    Flag,
    RandomBits,
    Real,
    RobotState,
    Role,
    Scalar,
)
from apollonius.io.errors import require
from apollonius.observe.view import Robot, View

MARGIN = 1e-3
"""Clearance [m] that must be left at any scale of the robots: many times its rounding error."""
BRAKING = (0, 1, 2)
"""Actions that brake: while turning right, going straight, or turning left."""


class BrakingMotion(eqx.Module):
    """A robot on a manoeuvre: its state and, with a slow drive, its turn rate [rad/s]."""

    state: RobotState
    turn_rate: Scalar | None


class Backup(eqx.Module):
    """Manoeuvres in which a robot comes to rest, played by the rules' own dynamics and contact.

    Attributes:
        arena, dt: where the manoeuvres are tried, and for how long an action is held [s].
        steps: how many steps they last.
        manoeuvres: the braking action that each holds to the end.
        surroundings: the polygons, which `arena` then lacks, by the edges near each step; None:
            every edge is looked at.
        uses_arena_of_view: whether the arena of the view is used, as it differs from state to
            state.
    """

    arena: Arena
    dt: Real
    steps: int = eqx.field(static=True)
    manoeuvres: tuple[int, ...] = eqx.field(static=True, default=BRAKING)
    surroundings: NearEdges | None = None
    uses_arena_of_view: bool = eqx.field(static=True, default=False)

    def for_view(self, view: View) -> "Backup":
        """Return the manoeuvres of the robot that sees this."""
        arena = view.arena
        if not self.uses_arena_of_view:
            return self
        if self.surroundings is None or not isinstance(arena, PackedArena):
            return replace(self, arena=arena)
        surroundings = replace(self.surroundings, member=arena.member)
        return replace(self, arena=without_edges(arena), surroundings=surroundings)

    @jax.jit
    def clearance_after(self, robot: Robot, action: Action) -> Scalar:
        """Return the least clearance [m] of the best stop after one step of an action.

        It is the least on the path from when the action takes effect until rest, less the body's
        radius, for the best of the manoeuvres. Of the `surroundings` only those within reach are
        looked at; that only changes clearances above `MARGIN`.
        """
        before = BrakingMotion(robot.predicted, robot.turn_rate)
        near, after = self._nearby_edges(before.state), self._hold(robot, before, action)
        step = self._clearance_along(before.state, after.state, near) - robot.body.radius
        return jnp.minimum(step, jnp.max(self._clearances(robot, after, near)))

    @jax.jit
    def can_stop_straight(self, robot: Robot, action: Action) -> Flag:
        """Check by one segment whether braking straight ahead after an action is certainly safe.

        As one segment the path takes little arithmetic. It must leave twice the `MARGIN`, once for
        rounding.
        """
        by_steps = self.arena.map is not None or self.surroundings is not None
        if by_steps or robot.turn_time is not None:
            # Clearances on maps depend on where a segment is cut, edges are looked up step by step,
            # and a slow drive keeps turning.
            return replace(self, manoeuvres=(1,)).clearance_after(robot, action) > MARGIN
        before = BrakingMotion(robot.predicted, None)
        near, after = self._nearby_edges(before.state), self._hold(robot, before, action).state
        (cos, sin), length = unit_vector(after.heading), after.v**2 / (2 * robot.body.u1_max)
        rest = replace(after, x=after.x + length * cos, y=after.y + length * sin)
        least = jnp.minimum(
            self._clearance_along(before.state, after, near),
            self._clearance_along(after, rest, near),
        )
        return least - robot.body.radius > 2 * MARGIN

    def _clearances(
        self, robot: Robot, motion: BrakingMotion, near: Edges | None
    ) -> Float[Array, " manoeuvres"]:
        def one_step(
            before: list[BrakingMotion], _: None
        ) -> tuple[list[BrakingMotion], list[RobotState]]:
            after = self._brake(robot, before)
            return after, [motion.state for motion in after]

        _, paths = jax.lax.scan(one_step, [motion] * len(self.manoeuvres), length=self.steps)
        after = jax.tree.map(lambda *leaves: jnp.stack(leaves), *paths)

        def shift(first: Array, later: Array) -> Array:
            firsts = jnp.broadcast_to(first, (len(later), 1))
            return jnp.concatenate([firsts, later[:, :-1]], axis=1)

        before = jax.tree.map(shift, motion.state, after)
        along = jax.vmap(jax.vmap(lambda start, end: self._clearance_along(start, end, near)))(
            before, after
        )
        return jnp.min(along, axis=1) - robot.body.radius

    def _nearby_edges(self, _: RobotState) -> Edges | None:
        return self.surroundings

    def _clearance_along(self, before: RobotState, after: RobotState, near: Edges | None) -> Scalar:
        """Return the least clearance [m] on a segment from the arena and these edges."""
        clearance = self.arena.clearance_along(before, after)
        if near is None:
            return clearance
        return jnp.minimum(clearance, near.clearance_along(before, after))

    def _brake(self, robot: Robot, motions: list[BrakingMotion]) -> list[BrakingMotion]:
        """Return the motion in each manoeuvre after one more step."""
        actions = [jnp.full((), action, jnp.int32) for action in self.manoeuvres]
        pairs = zip(motions, actions, strict=True)
        return [self._hold(robot, motion, action) for motion, action in pairs]

    def _hold(self, robot: Robot, motion: BrakingMotion, action: Action) -> BrakingMotion:
        u1, u2 = robot.body.controls(action)
        mean, rate = limited_turn_rate(robot.body, robot.turn_time, motion.turn_rate, u2, self.dt)
        return BrakingMotion(robot.body.move(motion.state, u1, mean, self.dt), rate)


class Shielded(AbstractWrapper[AbstractPolicy]):
    """Another player, held back from actions after which the robot could not brake to rest without
    touching anything.

    An action is allowed where, after it, one of the backup manoeuvres comes to rest with clearance
    to spare. The rest of that manoeuvre is then allowed in the next step, and so on; so from rest,
    or from any state from which one of the manoeuvres is free, the robot never fails. This is a
    safety filter with backup manoeuvres (Hobbs et al., "Runtime assurance for safety-critical
    systems", 2023): what it calls safe is a part of the viability kernel.

    A player with continuous actions keeps its own where that is allowed, and otherwise has the
    allowed discrete action nearest to it.
    """

    backup: Backup

    def __call__(self, view: View, memory: Memory, bits: RandomBits) -> tuple[Action, Memory]:
        scores, memory = self.score_view(view, memory, bits)
        search = jax.lax.while_loop(
            lambda search: search.is_open,
            lambda search: self.try_next(view, scores, search),
            self.start_search(view, scores),
        )
        return search.action, memory

    def preferred_action(self, scores: Any) -> Action:
        """Return the action of the player behind the shield."""
        if self.policy.continuous:
            return scores
        return self.policy.select(scores, jnp.ones(NUM_ACTIONS, bool))

    def start_search(self, view: View, scores: Any) -> "_Search":
        """Start the search for an allowed action; it ends at once where the own one surely is."""
        action = self.preferred_action(scores)
        number = jnp.full((), NUM_ACTIONS, jnp.int32) if self.policy.continuous else action
        is_open = ~self.backup.for_view(view).can_stop_straight(view.own, action)
        return _Search(action, number, jnp.full(NUM_ACTIONS, jnp.inf), is_open)

    def try_next(self, view: View, scores: Any, search: "_Search") -> "_Search":
        """Try the search's action; unless it is allowed, the best untried one comes next."""
        clearance = self.backup.for_view(view).clearance_after(view.own, search.action)
        allowed = clearance > MARGIN
        clearances = jnp.where(
            jnp.arange(NUM_ACTIONS) == search.number, clearance, search.clearances
        )
        untried = jnp.isinf(clearances)
        some_untried = jnp.any(untried)
        number = jnp.where(
            some_untried, self.policy.select(scores, untried), jnp.argmax(clearances)
        ).astype(jnp.int32)
        action = jnp.stack(action_levels(number)) if self.policy.continuous else number
        return _Search(
            jnp.where(allowed, search.action, action), number, clearances, ~allowed & some_untried
        )


class _Search(eqx.Module):
    """A search for an allowed action.

    Attributes:
        action: the one to try next or, at the end, to take.
        number: its index; `NUM_ACTIONS` for a player's own continuous action.
        clearances: clearance that each of the nine actions leaves [m]; infinite until it is tried.
        is_open: whether an action is still to be tried.
    """

    action: Action
    number: Int[Array, ""]
    clearances: Float[Array, "9"]
    is_open: Flag


def brakes(game: Game, role: Role) -> Backup:
    """Return full braking in three directions, for one side; raises InvalidInput where one of its
    robots cannot.
    """
    kinds = game.scenario.kinds if game.scenario else None
    bodies = game.bodies[role] if kinds is None else kinds.every(role)
    for body in bodies:
        bound = "0 and more than 0: of a robot that can stop, as it does when it brakes"
        require(body.brakes_to_rest, "v_min, u1_max", (body.v_min, body.u1_max), bound)
    steps = max(ceil(body.v_max / (body.u1_max * game.dt)) for body in bodies)
    surroundings = _surroundings(game, bodies)
    arena = pack(replace(game.arena, polygons=()) if surroundings else game.arena)
    uses_arena_of_view = game.scenario is not None
    return Backup(arena, game.dt, steps, BRAKING, surroundings, uses_arena_of_view)


def _surroundings(game: Game, bodies: Sequence[Unicycle]) -> NearEdges | None:
    """Index the polygons near any step of a robot; None without any, or if they are traced."""
    walls = game.arena if game.scenario is None else game.scenario.arenas
    shapes = game.arena.polygons if game.scenario is None else game.scenario.bounds
    numbers = (shapes, walls.x_min, walls.x_max, walls.y_min, walls.y_max, list(bodies), game.dt)
    if not shapes or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(numbers)):
        return None
    edges = game.scenario.edges if game.scenario else stacked_edges([game.arena], LENGTHS)
    reach = max(body.radius + body.v_max * game.dt / 2 for body in bodies) + 2 * MARGIN
    return edges and near_edges(edges, walls, float(reach))


def with_shield(policy: AbstractPolicy, game: Game, role: Role) -> Shielded:
    """Put a player behind a shield, which replaces actions after which it could not brake in time.

    Raises:
        InvalidInput: if a robot of the side cannot brake to rest.
    """
    return Shielded(policy, brakes(game, role))
