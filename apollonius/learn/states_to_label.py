"""The states that a student and its teacher are asked about, and the starts of their games.

Lengths and speeds are on the scale of the paper's robots.
"""

import functools
from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, PRNGKeyArray

from apollonius.game.dynamics import Unicycle, wrap_angle
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import GameState, Real, RobotState, Role, Scalar, tree_where
from apollonius.learn.teacher import DistillationTask
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.tracking import sense_and_update
from apollonius.play.rollout import Games

SPREAD = (0.25, 0.25, 0.15, 0.3)
"""Standard deviation of queries around a state: of x, y [m], v [m/s] and heading [rad]."""
NEARBY = 3.0
"""Largest distance beyond a capture of two robots that are put close together [m]."""
_EDGE = 0.02
"""Least distance from the walls at which a robot is put [m]."""


def states_to_label(
    role: Role, informed: float, task: DistillationTask, games: Games, key: PRNGKeyArray
) -> tuple[Knowledge, GameState, Bool[Array, " rows"]]:
    """Return the student's knowledge of states to learn from, the states, and which of its robots
    learn there.

    A robot of a team learns while it is in play. Rows are those of `observation_rows`.

    The teacher sees everything (Chen et al., "Learning by cheating", 2019), which says nothing to a
    student that has not seen an opponent for long. In games with tables whose robots see everything
    the states are those of `states_near`, else those visited.
    """
    game = task.game
    track = games.sides[role].track
    if task.table is not None and track is None:
        states = states_near(game, games.state, key)
        return Knowledge.complete(states), states, jnp.ones(states.steps.shape, bool)

    bits = jax.random.bits(key, games.state.steps.shape, jnp.uint32)
    _, knowledge = jax.vmap(functools.partial(sense_and_update, game, role))(
        track, games.state, bits
    )
    ages = (
        jnp.zeros((1, *games.state.steps.shape))
        if knowledge.ages is None
        else jnp.stack(knowledge.ages)
    )
    fresh = jnp.min(ages, axis=0) < informed
    return (
        knowledge,
        games.state,
        jnp.concatenate([active & fresh for active in games.state.active[role]]),
    )


def starts_of(task: DistillationTask, games: int, key: PRNGKeyArray) -> GameState:
    """Return starts of games: with tables `fresh_starts`, else as the game draws them. The key is
    consumed.
    """
    return (
        reset_batch(task.game, key, games)
        if task.table is None
        else fresh_starts(task.game, games, key)
    )


def states_near(game: Game, visited: GameState, key: PRNGKeyArray) -> GameState:
    """Return states to learn from: those visited, as many around them, and a quarter as many each
    with the robots close together and anywhere, leaves `[games]`.

    An opponent that knows the student forces it into states that its own games do not visit. The
    key is consumed.
    """
    around_key, far_key, close_key, anywhere_key = jax.random.split(key, 4)
    games, some = len(visited.steps), len(visited.steps) // 4
    around = jax.vmap(_around, in_axes=(None, 0, 0))(
        game, visited, jax.random.split(around_key, games)
    )
    far = _anywhere(game, some, far_key)
    close = jax.vmap(_closer, in_axes=(None, 0, 0))(game, far, jax.random.split(close_key, some))
    parts = visited, around, close, _anywhere(game, some, anywhere_key)
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *parts)


def fresh_starts(game: Game, games: int, key: PRNGKeyArray) -> GameState:
    """Return starts of games: every second one as the game draws it, the rest anywhere."""
    rest_key, moving_key = jax.random.split(key)
    starts, moving = reset_batch(game, rest_key, games), _anywhere(game, games, moving_key)
    even = jnp.arange(games) % 2 == 0
    return tree_where(even, starts, moving)


def _anywhere(game: Game, games: int, key: PRNGKeyArray) -> GameState:
    """Return robots at all speeds, nearly up to the walls and nearly up to a capture."""
    starts = replace(
        game.starts, speed="moving", clearance=0.05, separation=game.capture_distance + 0.05
    )
    return jax.vmap(lambda key: starts.sample(key, game.arena, game.bodies))(
        jax.random.split(key, games)
    )


def _around(game: Game, state: GameState, key: PRNGKeyArray) -> GameState:
    """Return a state not far from this one."""
    pursuer, evader = jax.random.normal(key, (2, 4)) * jnp.array([SPREAD])
    robots = (
        _move(game, game.pursuer, state.pursuer, *pursuer),
        _move(game, game.evader, state.evader, *evader),
    )
    return GameState.of_two(*robots, state.steps)


def _closer(game: Game, state: GameState, key: PRNGKeyArray) -> GameState:
    """Return the state with the pursuer not far from the evader."""
    away, angle = jax.random.uniform(
        key, (2,), minval=jnp.array([0, -jnp.pi]), maxval=jnp.array([NEARBY, jnp.pi])
    )
    away = game.capture_distance + away
    colocated = replace(state.pursuer, x=state.evader.x, y=state.evader.y)
    pursuer = _move(game, game.pursuer, colocated, away * jnp.cos(angle), away * jnp.sin(angle))
    return GameState.of_two(pursuer, state.evader, state.steps)


def _move(
    game: Game,
    body: Unicycle,
    robot: RobotState,
    x: Scalar,
    y: Scalar,
    v: Real = 0.0,
    heading: Real = 0.0,
) -> RobotState:
    """Return a robot whose numbers differ by these, inside the walls and within its limits."""
    arena = game.arena
    return RobotState(
        jnp.clip(robot.x + x, arena.x_min + _EDGE, arena.x_max - _EDGE),
        jnp.clip(robot.y + y, arena.y_min + _EDGE, arena.y_max - _EDGE),
        jnp.clip(robot.v + v, body.v_min, body.v_max),
        wrap_angle(robot.heading + heading),
    )
