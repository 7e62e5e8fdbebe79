"""The states that a teacher is asked about: those that games come to, those around them, and some from everywhere.

A student that only ever saw its own games would know nothing of those into which somebody who knows it forces it; and
one that saw states drawn at random would hardly ever see the few that matter.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from apollonius.game.dynamics import Unicycle, wrap_angle
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import GameState, RobotState, Role, Scalar

SPREAD = (0.25, 0.25, 0.15, 0.3)
"""Standard deviation of the places around a state: of x, y [m], v [m/s] and heading [rad]."""
NEARBY = 3.0
"""How much farther than a capture from one another two robots are, at most, that are put close together [m]."""
_EDGE = 0.02
"""How near to the walls a robot is put, at most [m]."""


def situations(game: Game, visited: GameState, key: PRNGKeyArray) -> GameState:
    """States of a game to learn from.

    Args:
        visited: leaves `[games]`.
        key: consumed.

    Returns:
        Those visited, as many around them, and a quarter as many each with the robots close together and anywhere.
    """
    around_key, close_key, anywhere_key = jax.random.split(key, 3)
    some = len(visited.steps) // 4
    around = jax.vmap(_around, in_axes=(None, 0, 0))(game, visited, jax.random.split(around_key, len(visited.steps)))
    together = _anywhere(game, some, close_key)
    close = jax.vmap(_closer, in_axes=(None, 0, 0))(game, together, jax.random.split(close_key, some))
    parts = visited, around, close, _anywhere(game, some, anywhere_key)
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *parts)


def fresh_starts(game: Game, games: int, key: PRNGKeyArray) -> GameState:
    """Starts of games to learn from: every other one as the game draws it, the rest moving and anywhere."""
    rest_key, moving_key = jax.random.split(key)
    starts, others = reset_batch(game, rest_key, games), _anywhere(game, games, moving_key)
    even = jnp.arange(games) % 2 == 0
    return jax.tree.map(lambda one, other: jnp.where(even, one, other), starts, others)


def _anywhere(game: Game, games: int, key: PRNGKeyArray) -> GameState:
    """Robots at all speeds, nearly up to the walls and nearly up to a capture."""
    starts = replace(game.starts, speed="moving", clearance=0.05, separation=game.capture_distance + 0.05)
    return jax.vmap(lambda key: starts.sample(key, game.arena, game.bodies))(jax.random.split(key, games))


def _around(game: Game, state: GameState, key: PRNGKeyArray) -> GameState:
    """A state not far from this one."""
    keys = jax.random.split(key)

    def moved(role: Role) -> RobotState:
        robot = state.robots[role][0]
        noise = jax.random.normal(keys[role], (4,)) * jnp.array(SPREAD)
        numbers = robot.x + noise[0], robot.y + noise[1], robot.v + noise[2], robot.heading + noise[3]
        return _within(game, game.body(role), *numbers)

    return GameState.of_two(moved(Role.PURSUER), moved(Role.EVADER), state.steps)


def _closer(game: Game, state: GameState, key: PRNGKeyArray) -> GameState:
    """The same with the pursuer not far from the evader."""
    distance_key, angle_key = jax.random.split(key)
    away = game.capture_distance + NEARBY * jax.random.uniform(distance_key)
    angle = jax.random.uniform(angle_key, minval=-jnp.pi, maxval=jnp.pi)
    evader, pursuer = state.evader, state.pursuer
    x, y = evader.x + away * jnp.cos(angle), evader.y + away * jnp.sin(angle)
    return GameState.of_two(_within(game, game.pursuer, x, y, pursuer.v, pursuer.heading), evader, state.steps)


def _within(game: Game, body: Unicycle, x: Scalar, y: Scalar, v: Scalar, heading: Scalar) -> RobotState:
    """A robot inside the walls and within its limits."""
    arena = game.arena
    return RobotState(
        jnp.clip(x, arena.x_min + _EDGE, arena.x_max - _EDGE),
        jnp.clip(y, arena.y_min + _EDGE, arena.y_max - _EDGE),
        jnp.clip(v, body.v_min, body.v_max),
        wrap_angle(heading),
    )
