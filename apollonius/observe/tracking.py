"""A side's knowledge of its opponents from step to step: last sightings, ages, and a belief."""

import functools
import operator
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.game.game import Game
from apollonius.game.sensing import MOST_DELAY, Percept, Sensors, sense
from apollonius.game.types import (
    BySide,
    DriveStates,
    GameState,
    RandomBits,
    Real,
    RobotState,
    Role,
    Scalar,
    tree_where,
)
from apollonius.observe import belief
from apollonius.observe.belief import NEVER, Belief
from apollonius.observe.knowledge import Knowledge


class Sightings(eqx.Module):
    """The steps of a game until one side's first sighting, -1 before it, and those in which it saw
    an opponent.
    """

    first: Int[Array, ""]
    steps: Int[Array, ""]


class Track(eqx.Module):
    """Knowledge of the robots of one side, which have sensors.

    Attributes:
        own: their own states, with the errors of their sensors.
        opponents: last sightings, dead-reckoned by the sensors' delay; for those never seen the
            middle of the arena, at rest.
        ages: for how long they have been hidden [s].
        pending: what they saw in the latest steps and do not know yet, the newest first; None
            without a delay.
        belief: as old as what they know; None without a chart.
        sightings: in the game so far; None where nobody counts them.
    """

    own: tuple[RobotState, ...]
    opponents: tuple[RobotState, ...]
    ages: tuple[Float[Array, "*batch"], ...]
    pending: Percept | None
    belief: Belief | None
    sightings: Sightings | None


def init_track(game: Game, state: GameState, role: Role, believes: bool = True) -> Track | None:
    """Return the track of one side before it has sensed anything; None without sensors.

    Args:
        game: the rules.
        state: the initial state.
        role: the side.
        believes: whether it has a belief, if the arena has a chart.
    """
    local_game = game.at(state)
    sensors = local_game.sensors and local_game.sensors[role]
    if sensors is None:
        return None
    arena = local_game.arena
    zero = jnp.zeros(())
    no_flag = jnp.zeros((), bool)
    x, y = (
        jnp.asarray((low + high) / 2, jnp.float32)
        for low, high in ((arena.x_min, arena.x_max), (arena.y_min, arena.y_max))
    )
    own = state.robots[role]
    opponents = tuple(RobotState(x, y, zero, zero) for _ in state.robots[role.other])
    late = None
    if sensors.delay is not None:
        blank = Percept(own, opponents, (no_flag,) * len(opponents), no_flag)
        late = jax.tree.map(lambda leaf: jnp.repeat(leaf[None], MOST_DELAY + 1, axis=0), blank)
    chart = local_game.chart
    anywhere = belief.uniform(chart) if believes and chart is not None else None
    sightings = Sightings(jnp.full((), -1, jnp.int32), jnp.zeros((), jnp.int32))
    return Track(own, opponents, (jnp.float32(NEVER),) * len(opponents), late, anywhere, sightings)


def sense_and_update(
    game: Game,
    role: Role,
    track: Track | None,
    state: GameState,
    bits: RandomBits,
    drives: DriveStates = (),
) -> tuple[Track | None, Knowledge]:
    """Let one side sense a state; return its track and its knowledge.

    Args:
        game: the rules.
        role: the side.
        track: its track before; None without sensors.
        state: the true state.
        bits: random bits of this side in this step.
        drives: those of its robots, as far as it knows them.
    """
    local_game = game.at(state)
    sensors = local_game.sensors and local_game.sensors[role]
    if sensors is None or track is None:
        return None, Knowledge.complete(state, drives)
    percept = sense(sensors, local_game.arena, state, role, bits)
    in_sight, before = functools.reduce(operator.or_, percept.in_sight), track.sightings
    assert before is not None, "it counts them from the start"
    first = jnp.where((before.first < 0) & in_sight, state.steps, before.first)
    sightings = Sightings(first, before.steps + in_sight.astype(jnp.int32))
    pending, past = apply_delay(sensors, track.pending, percept)
    after = update_track(
        local_game,
        replace(track, own=percept.own, pending=pending, sightings=sightings),
        past,
        state,
        role,
    )
    return after, knowledge_of(game, after, state, role, drives)


def apply_delay(
    sensors: Sensors, late: Percept | None, percept: Percept
) -> tuple[Percept | None, Percept]:
    """Add a percept to those of the latest steps; return them, and the one that is as old as the
    sensors' delay.
    """
    if sensors.delay is None:
        return None, percept
    late = jax.tree.map(lambda new, old: jnp.concatenate([new[None], old[:-1]]), percept, late)
    return late, jax.tree.map(lambda leaf: leaf[jnp.asarray(sensors.delay).astype(jnp.int32)], late)


def update_track(game: Game, track: Track, percept: Percept, state: GameState, role: Role) -> Track:
    """Update a track by a percept as old as the sensors' delay.

    Opponents in the percept are taken to have driven straight on since then (dead reckoning).

    Args:
        game: a game in one arena, with sensors of this side.
        track: the track before.
        percept: what was sensed.
        state: only `state.status` is read.
        role: the side.
    """
    sensors = game.sensors and game.sensors[role]
    assert sensors is not None, "a side without them knows everything"
    opponents_now, zero = percept.opponents, jnp.zeros(())
    if sensors.delay is not None:
        late, bodies = jnp.asarray(sensors.delay, jnp.float32) * game.dt, game.bodies[role.other]
        pairs = zip(bodies, opponents_now, strict=True)
        opponents_now = tuple(body.move(robot, zero, zero, late) for body, robot in pairs)
    opponents = tuple(map(tree_where, percept.in_sight, opponents_now, track.opponents))
    ages = tuple(
        jnp.where(is_seen, zero, jnp.minimum(age + game.dt, NEVER))
        for age, is_seen in zip(track.ages, percept.in_sight, strict=True)
    )
    after = track.belief and _update_belief(game, sensors, track.belief, percept, state, role)
    return replace(track, opponents=opponents, ages=ages, belief=after)


def _update_belief(
    game: Game, sensors: Sensors, before: Belief, percept: Percept, state: GameState, role: Role
) -> Belief:
    """Return the belief after a step in which opponents moved, and after what was seen."""
    chart, active = game.chart, state.active
    assert chart is not None, "a belief has a chart"
    spread_belief = belief.propagate(chart, before, _reach(game, role), game.dt)
    after = belief.observe_belief(chart, sensors, spread_belief, percept, active[role])
    bound = sensors.noise.reach if sensors.noise else jnp.zeros(())
    opponents = zip(active[role.other], percept.in_sight, strict=True)
    unseen = [is_active & ~is_seen for is_active, is_seen in opponents]
    budget = hidden = jnp.where(
        functools.reduce(operator.or_, unseen),
        after.travel_budget,
        -jnp.ones_like(after.travel_budget),
    )
    for robot, is_seen in zip(percept.opponents, percept.in_sight, strict=True):
        budget = jnp.maximum(
            budget, jnp.where(is_seen, belief.localise(chart, robot, bound), hidden)
        )
    return replace(after, travel_budget=budget)


def _reach(game: Game, role: Role, steps: Real = 1.0) -> Scalar:
    """Return the greatest distance that an opponent can move in some steps [m]."""
    bodies = game.bodies[role.other]
    speeds = [jnp.maximum(jnp.float32(body.v_max), -jnp.float32(body.v_min)) for body in bodies]
    return functools.reduce(jnp.maximum, speeds) * game.dt * steps


def knowledge_of(
    game: Game, track: Track, state: GameState, role: Role, drives: DriveStates = ()
) -> Knowledge:
    """Return the knowledge of a side with sensors.

    Args:
        game: the rules.
        track: the side's track.
        state: the true state, of which only status, variant and movers are read.
        role: the side.
        drives: those of its robots, as far as it knows them.
    """
    local_game = game.at(state)
    side_belief = track.belief
    chart = local_game.chart
    sensors = local_game.sensors and local_game.sensors[role]
    # what opponents may have done since
    if side_belief and chart and sensors and sensors.delay is not None:
        late = jnp.asarray(sensors.delay, jnp.float32)
        reach = _reach(local_game, role, late)
        side_belief = belief.propagate(chart, side_belief, reach, late * local_game.dt)
    robots = BySide.of(role, track.own, track.opponents)
    where = side_belief and side_belief.where
    movers = state.movers and state.movers.motion
    in_sight = sensors and sensors.movers_in_sight(local_game.arena, state, role)
    if movers is not None and in_sight is not None:
        movers = jax.tree.map(lambda leaf: jnp.where(in_sight, leaf, 0.0), movers)
    return Knowledge(
        robots, state.status, state.variant, drives, track.ages, where, movers, in_sight
    )
