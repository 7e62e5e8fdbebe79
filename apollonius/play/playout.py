"""Given starts played to their ends, once each, by a loop that can be watched and stopped.

A compiled function plays some steps of the games under way and gives the places of those that ended to the next ones;
between two calls of it, a few times in a second, the program is free to tell how far it is and to hear that it is to
stop. The function is one for all numbers of games.
"""

import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, PRNGKeyArray

from apollonius.agents.pool import Pool
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import GameState
from apollonius.play.rollout import Games, Transition, begin, random_bits_of, reset_where_done, step_games

Report = Callable[[int, int], None]
"""Told now and then how many games have ended, and how many there are."""
_MOST_STEPS = 2**20
"""Steps that the compiled function takes at most, however quick it is."""
_CHUNK_SECONDS = 0.2
"""How long the games go on before the program is asked again, about."""
_WINDOW = 8
"""Starts handed to the compiled function at a time, for each place."""
_NOBODY = -1
"""The number of the game in a place without one."""


class AbstractWatcher(eqx.Module):
    """What else is to be known of games than how they end. One game at a time; batching is the caller's `vmap`."""

    @abstractmethod
    def begin(self) -> Any:
        """What is known of a game before its first step: arrays."""

    @abstractmethod
    def follow(self, known: Any, transition: Transition) -> Any:
        """The same after a step."""


class Results(eqx.Module):
    """How games ended: outcome and length [steps] of each, what a watcher knows of it, and in games of teams the
    `RobotStatus` of each robot; leaves `[games, ...]`.
    """

    outcome: Int[Array, " games"]
    steps: Int[Array, " games"]
    watched: Any = None
    status: BySide[tuple[Int[Array, " games"], ...]] | None = None


class _Places(eqx.Module):
    """The games under way, what the watcher knows of each, and their numbers."""

    games: Games
    watched: Any
    index: Int[Array, " slots"]


class _Ended(eqx.Module):
    """The games that ended, in order: their numbers and results; only the first `count` rows are filled."""

    index: Int[Array, " rows"]
    results: Results
    count: Int[Array, ""]


def play_out(
    game: Game,
    players: BySide[Pool],
    starts: GameState,
    key: PRNGKeyArray,
    slots: int | None = None,
    watcher: AbstractWatcher | None = None,
    report: Report = lambda done, total: None,
) -> Results:
    """Play each of the given starts to its end, once.

    At most `slots` games are under way at a time; the next start takes the place of a finished game. The random bits
    of a game depend on the key, its index and its step alone, so neither `slots` nor other games change its course.

    Args:
        players: who plays either side.
        starts: initial states, leaves `[games]`.
        key: consumed.
        slots: rounded up to a power of 2. By default as many as are quickest: few for a CPU, since in the end only the
            longest games are left, many for an accelerator.
        watcher: follows every game.
        report: called several times in a second; an exception that it raises ends the play.
    """
    rows = jax.tree.map(np.asarray, starts)
    total = len(rows.steps)
    side_by_side = 2 ** ((slots or _default_slots()) - 1).bit_length()
    window = side_by_side * _WINDOW
    places = _zeros(lambda: _empty(game, players, key, watcher, _cut(rows, 0, side_by_side)))
    places.index[:] = _NOBODY
    results = _zeros(lambda: _no_results(watcher, total, starts))
    begun, done, steps = 0, 0, 1
    while done < total:
        asked = time.perf_counter()
        count = min(window, total - begun)
        upcoming = _cut(rows, begun, window)
        numbers = (*map(np.int32, (begun, count, steps)), np.bool_(begun + count < total))
        places, taken, ended = _advance(game, players, key, watcher, places, upcoming, *numbers)
        begun += int(taken)
        new = int(ended.count)
        index = np.asarray(ended.index)[:new]
        for column, fresh in zip(jax.tree.leaves(results), jax.tree.leaves(ended.results), strict=True):
            column[index] = np.asarray(fresh)[:new]
        done += new
        # The first call compiles, so that the steps grow from the second one on.
        quick = time.perf_counter() - asked < _CHUNK_SECONDS
        steps = min(steps * 2, _MOST_STEPS) if quick else max(steps // 2, 1)
        report(done, total)
    return jax.device_put(results)


def _empty(
    game: Game, players: BySide[Pool], key: PRNGKeyArray, watcher: AbstractWatcher | None, starts: GameState
) -> _Places:
    """Places without a game, one for each of some starts."""
    nobody = jnp.full(starts.steps.shape, _NOBODY, jnp.int32)
    games = begin(starts, players, random_bits_of(key, nobody, nobody))
    return _Places(games, _no_results(watcher, len(nobody), starts).watched, nobody)


def _no_results(watcher: AbstractWatcher | None, games: int, starts: GameState) -> Results:
    """Results of so many games that nobody has played, of the kind that these are starts of."""
    unwatched = jax.tree.map(lambda leaf: jnp.repeat(leaf[None], games, axis=0), watcher and watcher.begin())
    nothing = jnp.zeros(games, jnp.int32)
    return Results(nothing, nothing, unwatched, jax.tree.map(lambda _: nothing, starts.status))


@jax.jit
def _advance(
    game: Game,
    players: BySide[Pool],
    key: PRNGKeyArray,
    watcher: AbstractWatcher | None,
    places: _Places,
    starts: GameState,
    first: Int[Array, ""],
    count: Int[Array, ""],
    steps: Int[Array, ""],
    more: Bool[Array, ""],
) -> tuple[_Places, Int[Array, ""], _Ended]:
    """Some steps of the games in their places; games that wait begin where a place is free.

    Args:
        starts: of games that wait.
        first: the number of the first of them.
        count: how many they are; the other rows are padding.
        steps: how many at most.
        more: whether other games will wait when these have begun; then it ends early rather than leave places empty.

    Returns:
        The places, how many of the games that waited have begun, and the games that ended.
    """
    slots, window = places.index.shape[0], starts.steps.shape[0]
    rows = slots + window  # no more games can end
    unwatched = watcher.begin() if watcher else None
    nothing = _Ended(jnp.zeros(rows, jnp.int32), _no_results(watcher, rows, starts), jnp.asarray(0))
    carry = places, jnp.asarray(0), nothing, jnp.asarray(0)

    def goes_on(carry: tuple[_Places, Array, _Ended, Array]) -> Array:
        places, taken, _, step = carry
        playing, left = places.index != _NOBODY, taken < count
        return (step < steps) & (left | jnp.where(more, jnp.all(playing), jnp.any(playing)))

    def one_step(carry: tuple[_Places, Array, _Ended, Array]) -> tuple[_Places, Array, _Ended, Array]:
        places, taken, ended, step = carry
        free = places.index == _NOBODY
        upcoming = taken + jnp.cumsum(free.astype(jnp.int32)) - 1
        fresh = free & (upcoming < count)
        index = jnp.where(fresh, first + upcoming, places.index)
        state = jax.tree.map(lambda leaf: leaf[jnp.minimum(upcoming, window - 1)], starts)
        begun = begin(state, players, random_bits_of(key, index, jnp.full(index.shape, -1)))
        games = jax.vmap(reset_where_done)(fresh, begun, places.games)
        watched = jax.vmap(reset_where_done, in_axes=(0, None, 0))(fresh, unwatched, places.watched)

        games, transition = step_games(game, players, games, random_bits_of(key, index, games.state.steps))
        watched = jax.vmap(watcher.follow)(watched, transition) if watcher else None
        over = (index != _NOBODY) & (transition.terminated | transition.truncated)
        row = jnp.where(over, ended.count + jnp.cumsum(over.astype(jnp.int32)) - 1, rows)
        results = Results(transition.outcome, games.state.steps, watched, games.state.status)
        log = jax.tree.map(
            lambda all_, new: all_.at[row].set(new, mode="drop"), (ended.index, ended.results), (index, results)
        )
        ended = _Ended(log[0], log[1], ended.count + jnp.sum(over, dtype=jnp.int32))
        places = _Places(games, watched, jnp.where(over, _NOBODY, index))
        return places, taken + jnp.sum(fresh, dtype=jnp.int32), ended, step + 1

    return jax.lax.while_loop(goes_on, one_step, carry)[:3]


def _default_slots() -> int:
    return 64 if jax.default_backend() == "cpu" else 512


def _zeros(make: Callable[[], Any]) -> Any:
    """What a function makes, with zeros for numbers; nothing is computed."""
    return jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), jax.eval_shape(make))


def _cut(rows: GameState, first: int, count: int) -> GameState:
    """Some of the starts, the last one repeated where they come to an end."""
    total = len(rows.steps)
    index = np.minimum(np.arange(first, first + count), total - 1)
    return jax.tree.map(lambda leaf: leaf[index], rows)
