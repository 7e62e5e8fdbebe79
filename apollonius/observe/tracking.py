"""What a side knows of its opponents from step to step: last sightings, their ages, and a belief."""

import functools
import operator
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, UInt32

from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.sensing import MOST_DELAY, Percept, Sensors, sense
from apollonius.game.types import GameState, Real, RobotState, Role, Scalar, Sight
from apollonius.observe import belief
from apollonius.observe.belief import NEVER, Belief


class Sightings(eqx.Module):
    """Sightings of its opponents by one side in a game.

    Attributes:
        first: steps until the first sighting; -1 before it.
        steps: those in which it saw one of its opponents.
    """

    first: Int[Array, ""]
    steps: Int[Array, ""]


class Track(eqx.Module):
    """What the robots of one side know, which have sensors.

    Attributes:
        own: their own states, with the errors of their sensors.
        opponents: last sightings; of those never seen the middle of the arena, at rest.
        ages: times since then [s].
        late: what they saw in the latest steps and do not know yet, the newest first; None without a delay.
        belief: as old as what they know; None without a chart.
        sightings: in the game so far.
    """

    own: tuple[RobotState, ...]
    opponents: tuple[RobotState, ...]
    ages: tuple[Scalar, ...]
    late: Percept | None
    belief: Belief | None
    sightings: Sightings


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
    anywhere = None if arena.chart is None else belief.anywhere(arena.chart)
    sightings = Sightings(jnp.full((), -1, jnp.int32), jnp.zeros((), jnp.int32))
    return Track(own, unseen, (jnp.float32(NEVER),) * len(unseen), late, anywhere, sightings)


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
    in_sight, before = functools.reduce(operator.or_, percept.seen), track.sightings
    first = jnp.where((before.first < 0) & in_sight, state.steps, before.first)
    sightings = Sightings(first, before.steps + in_sight.astype(jnp.int32))
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
    after = track.belief and _believed(here, sensors, track.belief, percept, state, role)
    return Track(own, opponents, ages, late, after, sightings)


def _believed(game: Game, sensors: Sensors, before: Belief, percept: Percept, state: GameState, role: Role) -> Belief:
    """Return the belief after a step in which opponents moved, and after what was seen."""
    chart, active = game.arena.chart, state.active
    assert chart is not None, "a belief has a chart"
    after = belief.looked(
        chart, sensors, belief.moved(chart, before, _reach(game, role), game.dt), percept, active[role]
    )
    bound = sensors.noise.reach if sensors.noise else jnp.zeros(())
    there = [
        (seen, belief.at(chart, robot, bound)) for robot, seen in zip(percept.opponents, percept.seen, strict=True)
    ]
    unseen = functools.reduce(
        operator.or_, [alive & ~seen for alive, seen in zip(active[role.other], percept.seen, strict=True)]
    )
    hidden = jnp.where(unseen, after.credit, -jnp.ones_like(after.credit))
    credit = functools.reduce(jnp.maximum, [jnp.where(seen, cells, hidden) for seen, cells in there], hidden)
    return replace(after, credit=credit)


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
    if (known := track.belief) is not None and chart is not None:
        sensors = here.sensors and here.sensors[role]
        if sensors is not None and sensors.delay is not None:  # what opponents may have done since
            late = jnp.asarray(sensors.delay, jnp.float32)
            known = belief.moved(chart, known, _reach(here, role, late), late * here.dt)
        cells = belief.unseen(known)
    return replace(state, robots=BySide.of(role, track.own, track.opponents), sight=Sight(track.ages, cells))
