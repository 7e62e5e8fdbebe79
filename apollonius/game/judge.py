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

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.outcome import EVADER_FAILS, PURSUER_FAILS, come_within, decide, is_one_of
from apollonius.game.teams import Teams
from apollonius.game.types import ROLES, BySide, Flag, GameState, Outcome, Real, RobotStatus, Role

Statuses = BySide[tuple[Int[Array, ""], ...]]
"""A `RobotStatus` for each robot."""


@runtime_checkable
class Judged(Protocol):
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


class Fate(eqx.Module):
    """The fate of one robot in a step: it was active before, and is captured or fails otherwise."""

    active: Flag | bool
    captured: Flag | bool
    failed: Flag


class _Events(eqx.Module):
    """The events of one robot in a step; none if it is not active before it.

    A capture excludes all others: that it touches an obstacle, leaves the walls, or touches a mate and does neither.
    """

    active: Flag
    captured: Flag
    hit: Flag
    out: Flag
    collided: Flag

    @property
    def stays(self) -> Flag:
        return self.active & ~(self.captured | self.hit | self.out | self.collided)

    def status(self, before: Int[Array, ""]) -> Int[Array, ""]:
        """Return the status after the step; a robot that hits an obstacle and leaves the walls has hit the obstacle."""
        status = jnp.where(self.collided, RobotStatus.HIT_MATE, before)
        status = jnp.where(self.out, RobotStatus.OUT_OF_RANGE, status)
        status = jnp.where(self.hit, RobotStatus.HIT_OBSTACLE, status)
        return jnp.where(self.captured, RobotStatus.CAPTURED, status)


@fusion_barrier
def judge(game: Judged, before: GameState, after: GameState) -> tuple[Int[Array, ""], Statuses | None]:
    """Return the outcome of a step by the states at its two ends, and the status of each robot; None in a game of two.

    A side is beaten when no robot of it is active any more. The game then has the outcome of the last one, by the order
    of `decide`: so the pursuers win by capturing the last evader, even if no pursuer is active any more.
    """
    events = ROLES.map(lambda role: _events(game, before, after, role))
    beaten = events.map(lambda side: ~_any(robot.stays for robot in side))

    def last(role: Role, *failures: str) -> Flag:
        return beaten[role] & _any(getattr(robot, failure) for robot in events[role] for failure in failures)

    reached = None
    if game.arena.territory:
        moves = zip(before.robots.evader, after.robots.evader, events.evader, strict=True)
        reached = _any(robot.stays & game.arena.reaches_territory(start, end) for start, end, robot in moves)
    outcome = decide(
        captured=beaten.evader & _any(robot.captured for robot in events.evader),
        pursuer_hit=last(Role.PURSUER, "hit", "collided"),
        pursuer_out=last(Role.PURSUER, "out"),
        evader_hit=last(Role.EVADER, "hit", "collided"),
        evader_out=last(Role.EVADER, "out"),
        out_of_time=after.steps >= game.max_steps,
        territory_reached=reached,
    )
    if (status := before.status) is None:
        return outcome, None
    return outcome, ROLES.map(
        lambda role: tuple(robot.status(was) for robot, was in zip(events[role], status[role], strict=True))
    )


@jax.jit
def statuses_along(game: Judged, states: GameState) -> Statuses | None:
    """Return the statuses of all robots along states that follow each other, whatever moved the robots."""

    def one(status: Statuses | None, step: tuple[GameState, GameState]) -> tuple[Statuses | None, Statuses | None]:
        before, after = (replace(state, status=status) for state in step)
        found = judge(game, before, after)[1]
        return found, found

    first = jax.tree.map(lambda leaf: leaf[0], states.status)
    pairs = jax.tree.map(lambda leaf: leaf[:-1], states), jax.tree.map(lambda leaf: leaf[1:], states)
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, jax.lax.scan(one, first, pairs)[1])


def fates(outcome: Int[Array, ""], before: Statuses | None, after: Statuses | None) -> BySide[tuple[Fate, ...]]:
    """Return the fate of each robot in a step with this outcome, from the statuses before and after it, if any."""
    if before is None or after is None:
        caught, both = outcome == Outcome.CAPTURED, Outcome.BOTH_FAILED
        pursuer = Fate(active=True, captured=False, failed=is_one_of((both, *PURSUER_FAILS), outcome))
        evader = Fate(active=True, captured=caught, failed=is_one_of((both, *EVADER_FAILS), outcome))
        return BySide((pursuer,), (evader,))

    def fate(was: Int[Array, ""], now: Int[Array, ""]) -> Fate:
        active = was == RobotStatus.ACTIVE
        captured = active & (now == RobotStatus.CAPTURED)
        return Fate(active, captured, active & ~captured & (now != RobotStatus.ACTIVE))

    return ROLES.map(lambda role: tuple(map(fate, before[role], after[role])))


def _events(game: Judged, before: GameState, after: GameState, role: Role) -> tuple[_Events, ...]:
    active, bodies = before.active, game.bodies[role]
    moves = ROLES.map(lambda side: list(zip(before.robots[side], after.robots[side], strict=True)))
    hunters = list(zip(moves.pursuer, active.pursuer, strict=True)) if role == Role.EVADER else []
    collide = bool(game.teams and game.teams.mates_collide)

    def events(number: int) -> _Events:
        move, body, there = moves[role][number], bodies[number], active[role][number]
        catches = [hunts & come_within(other, move, game.capture_distance) for other, hunts in hunters]
        captured = there & _any(catches)
        fails = there & ~captured
        hit = fails & game.arena.hits_obstacle(*move, body.radius)
        out = fails & game.arena.is_out_of_range(move[1], body.radius)
        mates = [other for other in range(len(bodies)) if collide and other != number]
        touched = [
            active[role][other] & come_within(moves[role][other], move, body.radius + bodies[other].radius)
            for other in mates
        ]
        return _Events(there, captured, hit, out, collided=fails & _any(touched) & ~hit & ~out)

    return tuple(events(number) for number in range(len(bodies)))


def _any(flags: Iterable[Flag]) -> Flag:
    return functools.reduce(operator.or_, flags, jnp.zeros((), bool))
