"""Events of a step for every robot of a game in one arena, and the outcome of the game."""

import functools
import operator
from collections.abc import Iterable
from dataclasses import replace
from typing import Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.movers import Movers
from apollonius.game.outcome import come_within, decide
from apollonius.game.teams import Teams
from apollonius.game.types import (
    ROLES,
    BySide,
    Flag,
    GameState,
    Real,
    RobotStatus,
    Role,
    active_flags,
)

Statuses = BySide[tuple[Int[Array, ""], ...]]
"""A `RobotStatus` for each robot."""


@runtime_checkable
class JudgedGame(Protocol):
    """A game in one arena, as far as judging a step needs it."""

    @property
    def arena(self) -> Arena: ...
    @property
    def bodies(self) -> BySide[tuple[Unicycle, ...]]: ...
    @property
    def capture_distance(self) -> Real: ...
    @property
    def max_steps(self) -> int | Array: ...
    @property
    def teams(self) -> Teams | None: ...
    @property
    def movers(self) -> Movers | None: ...


class RobotEvents(eqx.Module):
    """The fate of one robot in a step: it was active before, and is captured or fails otherwise."""

    active: Flag | bool
    captured: Flag | bool
    failed: Flag


class _Contacts(eqx.Module):
    """The events of one robot in a step; none unless it was active before the step.

    A captured robot has no other event. `hit`: it touched an obstacle or a mover; `out`: it left
    the walls; `collided`: it touched a mate, and neither hit an obstacle nor left the walls.
    """

    active: Flag
    captured: Flag
    hit: Flag
    out: Flag
    collided: Flag

    def status(self, before: Int[Array, ""]) -> Int[Array, ""]:
        """Return the status after the step; hitting an obstacle goes before leaving the walls."""
        status = jnp.where(self.active, RobotStatus.ACTIVE, before)
        status = jnp.where(self.collided, RobotStatus.HIT_MATE, status)
        status = jnp.where(self.out, RobotStatus.OUT_OF_RANGE, status)
        status = jnp.where(self.hit, RobotStatus.HIT_OBSTACLE, status)
        return jnp.where(self.captured, RobotStatus.CAPTURED, status)


@fusion_barrier
def judge(game: JudgedGame, before: GameState, after: GameState) -> tuple[Int[Array, ""], Statuses]:
    """Return the outcome of a step and the status of each robot.

    A side is beaten when its last robot stops being active. The game then ends with the outcome of
    that robot, in the order of `decide`: pursuers win by capturing the last evader even if no
    pursuer is active any more.
    """
    statuses = _statuses_after(game, before, after)
    active = active_flags(statuses)

    def last(role: Role, *ends: RobotStatus) -> Flag:
        """Check whether the side is beaten, and one of its robots ended so in this step."""
        robots = zip(before.in_play[role], statuses[role], strict=True)
        flags = (moved & (status == end) for moved, status in robots for end in ends)
        return ~_any(active[role]) & _any(flags)

    territory_reached = None
    if game.arena.territory:
        moves = zip(before.robots.evader, after.robots.evader, active.evader, strict=True)
        reaches = game.arena.reaches_territory
        territory_reached = _any(stays & reaches(start, end) for start, end, stays in moves)
    outcome = decide(
        captured=last(Role.EVADER, RobotStatus.CAPTURED),
        pursuer_hit=last(Role.PURSUER, RobotStatus.HIT_OBSTACLE, RobotStatus.HIT_MATE),
        pursuer_out=last(Role.PURSUER, RobotStatus.OUT_OF_RANGE),
        evader_hit=last(Role.EVADER, RobotStatus.HIT_OBSTACLE, RobotStatus.HIT_MATE),
        evader_out=last(Role.EVADER, RobotStatus.OUT_OF_RANGE),
        out_of_time=after.steps >= game.max_steps,
        territory_reached=territory_reached,
    )
    return outcome, statuses


@fusion_barrier
def _statuses_after(game: JudgedGame, before: GameState, after: GameState) -> Statuses:
    """Return the status of each robot after a step; computed once, as the outcome and the rewards
    follow from it.
    """

    def of_side(role: Role) -> tuple[Int[Array, ""], ...]:
        robots = zip(_contacts(game, before, after, role), before.status[role], strict=True)
        return tuple(contacts.status(status) for contacts, status in robots)

    return ROLES.map(of_side)


@jax.jit
def statuses_along(game: JudgedGame, states: GameState) -> Statuses:
    """Return the statuses of all robots along consecutive states, whatever moved the robots."""

    def one_step(status: Statuses, step: tuple[GameState, GameState]) -> tuple[Statuses, Statuses]:
        before, after = (replace(state, status=status) for state in step)
        statuses = judge(game, before, after)[1]
        return statuses, statuses

    first = jax.tree.map(lambda leaf: leaf[0], states.status)
    befores = jax.tree.map(lambda leaf: leaf[:-1], states)
    afters = jax.tree.map(lambda leaf: leaf[1:], states)
    _, later = jax.lax.scan(one_step, first, (befores, afters))
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, later)


def robot_events(before: GameState, after: GameState) -> BySide[tuple[RobotEvents, ...]]:
    """Return the fate of each robot in a step by the states before and after it."""

    def fate(active: Flag, status: Int[Array, ""]) -> RobotEvents:
        captured = active & (status == RobotStatus.CAPTURED)
        failed = active & ~captured & (status != RobotStatus.ACTIVE)
        return RobotEvents(active, captured, failed)

    return ROLES.map(lambda role: tuple(map(fate, before.in_play[role], after.status[role])))


def _contacts(
    game: JudgedGame, before: GameState, after: GameState, role: Role
) -> tuple[_Contacts, ...]:
    active, bodies = before.in_play, game.bodies[role]
    moves = ROLES.map(lambda side: list(zip(before.robots[side], after.robots[side], strict=True)))
    hunters = list(zip(moves.pursuer, active.pursuer, strict=True)) if role == Role.EVADER else []
    mates_collide = bool(game.teams and game.teams.mates_collide)

    def touches_mate(number: int) -> Flag:
        own_moves = moves[role]
        contacts: list[Flag] = []
        for mate in range(len(bodies)):
            if mates_collide and mate != number:
                distance = bodies[number].radius + bodies[mate].radius
                touches = come_within(own_moves[mate], own_moves[number], distance)
                contacts.append(active[role][mate] & touches)
        return _any(contacts)

    def hits_obstacle(number: int) -> Flag:
        move, radius = moves[role][number], bodies[number].radius
        is_hit = game.arena.hits_obstacle(*move, radius)
        if game.movers is None or before.movers is None or after.movers is None:
            return is_hit
        return is_hit | game.movers.is_hit(before.movers, after.movers, move, radius)

    def events(number: int) -> _Contacts:
        move = moves[role][number]
        body = bodies[number]
        is_active = active[role][number]
        distance = game.capture_distance
        captures = [hunts & come_within(hunter, move, distance) for hunter, hunts in hunters]
        captured = is_active & _any(captures)
        uncaught = is_active & ~captured
        hit = uncaught & hits_obstacle(number)
        out = uncaught & game.arena.is_out_of_range(move[1], body.radius)
        collided = uncaught & touches_mate(number) & ~hit & ~out
        return _Contacts(is_active, captured, hit, out, collided)

    return tuple(events(number) for number in range(len(bodies)))


def _any(flags: Iterable[Flag]) -> Flag:
    return functools.reduce(operator.or_, flags, jnp.zeros((), bool))
