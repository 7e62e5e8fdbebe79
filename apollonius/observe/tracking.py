"""What a side knows of its opponents from step to step: last sightings, their ages, and a belief."""

import functools
import operator
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, UInt32

from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.sensing import MOST_DELAY, Percept, Sensors, sense
from apollonius.game.types import GameState, Real, RobotState, Role, Scalar, Sight
from apollonius.observe import belief

NEVER = 1e3
"""Age of the sighting of an opponent that was never seen [s]."""


class Track(eqx.Module):
    """What the robots of one side know, which have sensors.

    Attributes:
        own: their own states, with the errors of their sensors.
        opponents: last sightings; of those never seen the middle of the arena, at rest.
        ages: times since then [s].
        late: what they saw in the latest steps and do not know yet, the newest first; None without a delay.
        credit: their belief (`apollonius.observe.belief`), as old as what they know; None without a chart.
    """

    own: tuple[RobotState, ...]
    opponents: tuple[RobotState, ...]
    ages: tuple[Scalar, ...]
    late: Percept | None
    credit: belief.Credit | None


def begin(game: Game, state: GameState, role: Role) -> Track | None:
    """Return what one side knows before it has looked; None without sensors."""
    here = game.at(state)
    if (sensors := here.sensors and here.sensors[role]) is None:
        return None
    arena, zero = here.arena, jnp.zeros(())
    middle = (
        jnp.asarray((arena.x_min + arena.x_max) / 2, jnp.float32),
        jnp.asarray((arena.y_min + arena.y_max) / 2, jnp.float32),
    )
    unseen = tuple(RobotState(*middle, zero, zero) for _ in state.robots[role.other])
    own, no = state.robots[role], jnp.zeros((), bool)
    late = None
    if sensors.delay is not None:
        nothing = Percept(own, unseen, (no,) * len(unseen), no)
        late = jax.tree.map(lambda leaf: jnp.repeat(leaf[None], MOST_DELAY + 1, axis=0), nothing)
    credit = None if arena.chart is None else belief.anywhere(arena.chart)
    return Track(own, unseen, (jnp.asarray(NEVER),) * len(unseen), late, credit)


def follow(game: Game, track: Track | None, state: GameState, role: Role, bits: UInt32[Array, ""]) -> Track | None:
    """Return what one side knows after it has looked at a state.

    Args:
        bits: random bits of this side in this step.
    """
    here = game.at(state)
    if (sensors := here.sensors and here.sensors[role]) is None or track is None:
        return None
    ours, theirs = (list(zip(state.robots[one], state.active[one], strict=True)) for one in (role, role.other))
    percept = sense(sensors, here.arena, ours, theirs, bits)
    own, late, age = percept.own, None, jnp.zeros(())
    if sensors.delay is not None:
        late = jax.tree.map(lambda new, old: jnp.concatenate([new[None], old[:-1]]), percept, track.late)
        delay = jnp.asarray(sensors.delay, jnp.float32)
        percept, age = jax.tree.map(lambda leaf: leaf[delay.astype(jnp.int32)], late), delay * here.dt
    opponents = tuple(
        jax.tree.map(lambda new, old, seen=seen: jnp.where(seen, new, old), new, old)
        for new, old, seen in zip(percept.opponents, track.opponents, percept.seen, strict=True)
    )
    ages = tuple(
        jnp.where(seen, age, jnp.minimum(old + here.dt, NEVER))
        for old, seen in zip(track.ages, percept.seen, strict=True)
    )
    credit = track.credit if track.credit is None else _believed(here, sensors, track.credit, percept, state, role)
    return Track(own, opponents, ages, late, credit)


def _believed(
    game: Game, sensors: Sensors, credit: belief.Credit, percept: Percept, state: GameState, role: Role
) -> belief.Credit:
    """Return the belief after a step in which opponents moved, and after what was seen."""
    chart, active = game.arena.chart, state.active
    assert chart is not None, "a belief has a chart"
    after = belief.looked(chart, sensors, belief.moved(chart, credit, _reach(game, role)), percept, active[role])
    bound = sensors.noise.reach if sensors.noise else jnp.zeros(())
    there = [
        (seen, belief.at(chart, robot, bound)) for robot, seen in zip(percept.opponents, percept.seen, strict=True)
    ]
    unseen = functools.reduce(
        operator.or_, [alive & ~seen for alive, seen in zip(active[role.other], percept.seen, strict=True)]
    )
    after = jnp.where(unseen, after, -jnp.ones_like(after))
    return functools.reduce(jnp.maximum, [jnp.where(seen, cells, after) for seen, cells in there], after)


def _reach(game: Game, role: Role, steps: Real = 1.0) -> Scalar:
    """Return how far the fastest opponent moves in some steps [m]."""
    speeds = [belief.top_speed(body.v_min, body.v_max) for body in game.bodies[role.other]]
    return functools.reduce(jnp.maximum, speeds) * game.dt * steps


def believed(game: Game, track: Track | None, state: GameState, role: Role) -> GameState:
    """Return a state as one side knows it: itself where that sees everything."""
    if track is None:
        return state
    here = game.at(state)
    cells, chart = None, here.arena.chart
    if track.credit is not None and chart is not None:
        credit, sensors = track.credit, here.sensors and here.sensors[role]
        if sensors is not None and sensors.delay is not None:  # what opponents may have done since
            credit = belief.moved(chart, credit, _reach(here, role, jnp.asarray(sensors.delay, jnp.float32)))
        cells = belief.where(credit)
    return replace(state, robots=BySide.of(role, track.own, track.opponents), sight=Sight(track.ages, cells))
