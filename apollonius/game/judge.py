"""What a step does to every robot of a game in one arena, and how the game stands after it."""

import functools
import operator
from collections.abc import Iterable
from typing import TYPE_CHECKING

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from apollonius.game.by_side import BySide
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.outcome import come_within, decide
from apollonius.game.types import ROLES, GameState, RobotStatus, Role

if TYPE_CHECKING:
    from apollonius.game.game import Game

Flag = Bool[Array, ""]


class Events(eqx.Module):
    """What happens to one robot in a step: nothing, if it is not active before it.

    Attributes:
        active: whether it is, before the step.
        captured: whether it is caught; what else would happen to it then does not.
        hit, out: whether it touches an obstacle, leaves the walls.
        collided: whether it touches a mate, and does neither.
    """

    active: Flag
    captured: Flag
    hit: Flag
    out: Flag
    collided: Flag

    @property
    def failed(self) -> Flag:
        """Whether it goes out of play, and not by a capture."""
        return self.hit | self.out | self.collided

    @property
    def stays(self) -> Flag:
        """Whether it is active after the step."""
        return self.active & ~(self.captured | self.failed)

    def status(self, before: Int[Array, ""]) -> Int[Array, ""]:
        """Its status after the step; one that hits an obstacle and leaves the walls has hit the obstacle."""
        status = jnp.where(self.collided, RobotStatus.HIT_MATE, before)
        status = jnp.where(self.out, RobotStatus.OUT_OF_RANGE, status)
        status = jnp.where(self.hit, RobotStatus.HIT_OBSTACLE, status)
        return jnp.where(self.captured, RobotStatus.CAPTURED, status)


def stand(game: "Game", before: GameState, after: GameState) -> tuple[Int[Array, ""], BySide[tuple[Events, ...]]]:
    """How the game stands after a step, and what happens to each robot, from the states at the step's two ends.

    A side is beaten when none of its robots is active any more. The game then has the outcome of the last of them, as
    `decide` says: so the pursuers win by capturing the last evader, even if no pursuer is active any more.
    """
    events = ROLES.map(lambda role: _events(game, before, after, role))
    beaten = events.map(lambda side: ~_any(robot.stays for robot in side))

    def last(role: Role, *failures: str) -> Flag:
        return beaten[role] & _any(getattr(robot, failure) for robot in events[role] for failure in failures)

    reached = None
    if game.arena.territory:
        ways = zip(before.robots.evader, after.robots.evader, events.evader, strict=True)
        reached = _any(robot.stays & game.arena.reaches_territory(start, end) for start, end, robot in ways)
    outcome = decide(
        captured=beaten.evader & _any(robot.captured for robot in events.evader),
        pursuer_hit=last(Role.PURSUER, "hit", "collided"),
        pursuer_out=last(Role.PURSUER, "out"),
        evader_hit=last(Role.EVADER, "hit", "collided"),
        evader_out=last(Role.EVADER, "out"),
        out_of_time=after.steps >= game.max_steps,
        territory_reached=reached,
    )
    return outcome, events


judge = fusion_barrier(stand)


@fusion_barrier
def outcome_after(game: "Game", before: GameState, after: GameState) -> Int[Array, ""]:
    """How a game in one arena stands after a step, from the states at its two ends."""
    return stand(game, before, after)[0]


def _events(game: "Game", before: GameState, after: GameState, role: Role) -> tuple[Events, ...]:
    """What happens to the robots of one side."""
    active, bodies = before.active, game.bodies[role]
    ways = ROLES.map(lambda side: list(zip(before.robots[side], after.robots[side], strict=True)))
    hunters = list(zip(ways.pursuer, active.pursuer, strict=True)) if role == Role.EVADER else []
    collide = bool(game.teams and game.teams.mates_collide)

    def events(number: int) -> Events:
        way, body, there = ways[role][number], bodies[number], active[role][number]
        catches = [hunts & come_within(other, way, game.capture_distance) for other, hunts in hunters]
        captured = there & _any(catches)
        fails = there & ~captured
        hit = fails & game.arena.hits_obstacle(*way, body.radius)
        out = fails & game.arena.is_out_of_range(way[1], body.radius)
        mates = [other for other in range(len(bodies)) if collide and other != number]
        touched = [
            active[role][other] & come_within(ways[role][other], way, body.radius + bodies[other].radius)
            for other in mates
        ]
        return Events(there, captured, hit, out, collided=fails & _any(touched) & ~hit & ~out)

    return tuple(events(number) for number in range(len(bodies)))


def _any(flags: Iterable[Flag]) -> Flag:
    return functools.reduce(operator.or_, flags, jnp.zeros((), bool))
