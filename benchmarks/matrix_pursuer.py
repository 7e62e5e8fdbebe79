"""A pursuer that compares many courses of both sides, and the evader's best answers to it."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from escape_room import Reach, drive, rooms
from half_seconds import (
    HALF_SECONDS,
    HOLD,
    STEPS,
    STRUCTURED,
    Played,
    filled,
    play_courses,
    repeated,
    rows_of,
    some_courses,
)
from jaxtyping import Array, Float, Int

from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS
from apollonius.game.types import Outcome, RobotState, Role

LEVELS = 40
"""Half seconds that answers last at most."""


class MatrixPursuer(NamedTuple):
    """A pursuer that holds, for half a second, the action for which the evader's best course lasts
    least, if the pursuer then knows that course.

    Attributes:
        own: its courses, as many after each of the nine actions.
        other: the evader's.
    """

    game: Game
    own: Int[Array, "courses steps"]
    other: Int[Array, "others steps"]

    def action(self, robots: tuple[RobotState, RobotState]) -> Int[Array, ""]:
        """Choose from the states of pursuer and evader."""
        game = self.game
        pursuer, pursuer_is_free = drive(game, Role.PURSUER, robots[0], self.own)
        evader, evader_is_free = drive(game, Role.EVADER, robots[1], self.other)
        steps = pursuer.x, pursuer.y, pursuer_is_free, evader.x, evader.y, evader_is_free

        def one_step(carry: tuple[Array, Array, Array], step: list[Array]) -> Any:
            capture, nearest, time = carry
            x, y, is_free, other_x, other_y, other_is_free = step
            squared = (x[:, None] - other_x) ** 2 + (y[:, None] - other_y) ** 2
            wins = (squared < game.capture_distance**2) | ~other_is_free
            capture = jnp.where(wins & is_free[:, None] & (capture > time), time, capture)
            nearest = jnp.where(is_free[:, None], jnp.minimum(nearest, squared), nearest)
            return (capture, nearest, time + 1), None

        shape = len(self.own), len(self.other)
        first = jnp.full(shape, STEPS + 1.0), jnp.full(shape, 100.0), jnp.float32(1)
        by_time = [jnp.moveaxis(leaf, 1, 0) for leaf in steps]
        (capture, nearest, _), _ = jax.lax.scan(one_step, first, by_time)
        lasts = capture + jnp.where(capture > STEPS, 10 * jnp.sqrt(nearest), 0)
        answered = jnp.min(lasts.reshape(9, -1, len(self.other)), axis=1)
        values = jnp.max(answered, axis=1) + jnp.mean(answered, axis=1)
        return jnp.argmin(values).astype(jnp.int32)

    @eqx.filter_jit
    def actions(self, robots: tuple[RobotState, RobotState]) -> Int[Array, " games"]:
        """Choose in several games."""
        return jax.lax.map(self.action, robots)


def make_matrix_pursuer(game: Game) -> MatrixPursuer:
    """Make the pursuer that compares 396 courses with 192."""
    other = some_courses(5, 60)
    subset = np.r_[np.arange(0, STRUCTURED, 3), np.arange(STRUCTURED, len(other))]
    return MatrixPursuer(game, some_courses(5, 0), other[subset])


@eqx.filter_jit
def best_rooms(
    game: Game,
    reach: Reach,
    courses: Int[Array, "courses steps"],
    robots: tuple[RobotState, RobotState],
) -> Float[Array, " games"]:
    """Return the room of the best course of several games, and the gap at its end."""

    def best_room(robots: tuple[RobotState, RobotState]) -> Float[Array, ""]:
        room, gap = rooms(game, reach, courses, *robots)
        return jnp.max(room + gap)

    return jax.lax.map(best_room, robots, batch_size=8)


class Answers(NamedTuple):
    """The best answers to the matrix pursuer: how the search ended, after how many half seconds."""

    result: str
    levels: int


def search_answers(
    pursuer: MatrixPursuer, reach: Reach, robots: tuple[RobotState, RobotState], width: int
) -> Answers:
    """Search courses of the evader that survive the matrix pursuer, by a beam of some width.

    The answers with most room are extended, half by chance, no two from one cell of states. The
    evader `escapes` once it has the room of a whole course after 8 s or more.
    """
    game, draw = pursuer.game, np.random.default_rng(0)
    courses = some_courses(3, 12)[::10]
    robots = repeated(robots, width)
    count, ways = 1, len(HALF_SECONDS)
    for level in range(LEVELS):
        actions = pursuer.actions(robots)
        parents = np.zeros(width * ways, int)
        parents[: count * ways] = np.repeat(np.arange(count), ways)
        repeated_actions = jnp.repeat(rows_of(actions, parents)[:, None], HOLD, axis=1)
        start = Played(rows_of(robots, parents), jnp.zeros(len(parents), jnp.int32), ())
        own = jnp.asarray(np.tile(HALF_SECONDS, (width, 1)))
        played = play_courses(game, start, repeated_actions, own)
        outcome = np.asarray(played.outcome)[: count * ways]
        if np.isin(outcome, PURSUER_FAILS).any():
            return Answers("pursuer fails", level + 1)
        ongoing = np.flatnonzero(outcome == Outcome.ONGOING)
        if len(ongoing) == 0:
            return Answers("caught", level + 1)
        first, second = rows_of(played.robots, ongoing)
        distance = np.hypot(np.asarray(first.x - second.x), np.asarray(first.y - second.y))
        by_distance = np.argsort(-distance + 0.3 * draw.gumbel(size=len(distance)))
        some = filled(ongoing[by_distance[: 8 * width]], 8 * width)
        candidates = rows_of(played.robots, some)
        room = np.asarray(best_rooms(game, reach, courses, candidates))
        if level >= 15 and room.max() >= STEPS:
            return Answers("escapes", level + 1)
        chosen = _beam(draw, candidates, room, width)
        count = len(chosen)
        robots = rows_of(candidates, filled(chosen, width))
    return Answers("survives", LEVELS)


def _beam(
    draw: np.random.Generator, robots: tuple[RobotState, RobotState], room: np.ndarray, width: int
) -> np.ndarray:
    """Choose rows with much room, of which no two are in one cell of states."""
    sides = 0.1, 0.1, 0.1, 0.25
    cells = [
        np.round(np.asarray(leaf) / side)
        for robot in robots
        for leaf, side in zip((robot.x, robot.y, robot.v, robot.heading), sides, strict=True)
    ]
    _, distinct = np.unique(np.stack(cells, 1), axis=0, return_index=True)
    best = distinct[np.argsort(-room[distinct])][: width // 2]
    rest = np.setdiff1d(distinct, best)
    by_chance = rest[np.argsort(-room[rest] + 4.0 * draw.gumbel(size=len(rest)))]
    return np.r_[best, by_chance[: width - len(best)]]


def survive_matrix(
    pursuer: MatrixPursuer,
    game: Game,
    evader: AbstractPolicy,
    robots: tuple[RobotState, RobotState],
    memories: Memory,
) -> int:
    """Count the policies that the matrix pursuer does not catch in `LEVELS` half seconds.

    Args:
        pursuer: the matrix pursuer.
        game: the rules, with the chart that the evader reads.
        evader: the policies, by their memories.
        robots: the start of all games.
        memories: of each policy.
    """
    games = len(memories["left"])
    played = Played(repeated(robots, games), jnp.zeros(games, jnp.int32), memories)
    for _ in range(LEVELS):
        repeated_actions = jnp.repeat(pursuer.actions(played.robots)[:, None], HOLD, axis=1)
        played = play_courses(game, played, repeated_actions, evader)
    return int(np.sum(~np.isin(played.outcome, PURSUER_WINS)))
