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

from apollonius.agents.policy import Pool
from apollonius.game.game import Game
from apollonius.game.types import GameState
from apollonius.rollout import Games, Transition, anew, begin, random_words, step_games

Report = Callable[[int, int], None]
"""Told now and then how many games have ended, and how many there are."""
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
    """How games ended: outcome and length [steps] of each, and what a watcher knows of it, leaves `[games, ...]`."""

    outcome: Int[Array, " games"]
    steps: Int[Array, " games"]
    watched: Any = None


class _Waiting(eqx.Module):
    """Starts of games to come, the number of the first one, and how many they are; the rest is padding."""

    starts: GameState
    first: Int[Array, ""]
    count: Int[Array, ""]


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
    pursuer: Pool,
    evader: Pool,
    starts: GameState,
    key: PRNGKeyArray,
    slots: int = 256,
    watcher: AbstractWatcher | None = None,
    report: Report = lambda done, total: None,
) -> Results:
    """Play each of the given starts to its end, once.

    At most `slots` games are under way at a time; the next start takes the place of a finished game. The random words
    of a game depend on the key, its index and its step alone, so neither `slots` nor other games change its course.

    Args:
        starts: initial states, leaves `[games]`.
        key: consumed.
        slots: rounded up to a power of 2, and cut down to that of the number of games.
        watcher: follows every game.
        report: called several times in a second; an exception that it raises ends the play.
    """
    rows = jax.tree.map(np.asarray, starts)
    total = len(rows.steps)
    slots = 2 ** (min(slots, total) - 1).bit_length()
    window = slots * _WINDOW
    places = _zeros(lambda: _empty(game, pursuer, evader, key, watcher, _cut(rows, 0, slots)))
    places = eqx.tree_at(lambda places: places.index, places, jnp.asarray(np.full(slots, _NOBODY, np.int32)))
    results = _zeros(lambda: _no_results(watcher, total))
    begun, done, steps = 0, 0, 1
    while done < total:
        asked = time.perf_counter()
        count = min(window, total - begun)
        waiting = _Waiting(_cut(rows, begun, window), *(jnp.asarray(number, jnp.int32) for number in (begun, count)))
        more, steps_now = jnp.asarray(begun + count < total), jnp.asarray(steps, jnp.int32)
        places, taken, ended = _advance(game, pursuer, evader, key, watcher, places, waiting, more, steps_now)
        begun += int(taken)
        new = int(ended.count)
        index = np.asarray(ended.index)[:new]
        for column, fresh in zip(jax.tree.leaves(results), jax.tree.leaves(ended.results), strict=True):
            column[index] = np.asarray(fresh)[:new]
        done += new
        # The first call compiles, so that the steps grow from the second one on.
        steps = max(1, steps * 2 if time.perf_counter() - asked < _CHUNK_SECONDS else steps // 2)
        report(done, total)
    return jax.tree.map(jnp.asarray, results)


def play_at_once(game: Game, pursuer: Pool, evader: Pool, starts: GameState, key: PRNGKeyArray) -> Results:
    """The same for a few games, all of them side by side, as a part of what is compiled.

    Args:
        starts: initial states, leaves `[games]`.
        key: consumed.
    """
    games = starts.steps.shape[0]
    places = _empty(game, pursuer, evader, key, None, starts)
    waiting = _Waiting(starts, jnp.asarray(0), jnp.asarray(games))
    longest = jnp.asarray(jnp.iinfo(jnp.int32).max)
    ended = _play(game, pursuer, evader, key, None, places, waiting, jnp.asarray(False), longest)[2]
    order = jnp.argsort(ended.index[:games])
    return jax.tree.map(lambda leaf: leaf[order], ended.results)


def _empty(
    game: Game, pursuer: Pool, evader: Pool, key: PRNGKeyArray, watcher: AbstractWatcher | None, starts: GameState
) -> _Places:
    """Places without a game, one for each of some starts."""
    nobody = jnp.full(starts.steps.shape, _NOBODY, jnp.int32)
    games = begin(starts, pursuer, evader, random_words(key, nobody, nobody))
    return _Places(games, _no_results(watcher, len(nobody)).watched, nobody)


def _no_results(watcher: AbstractWatcher | None, games: int) -> Results:
    """Results of games that nobody has played."""
    unwatched = jax.tree.map(lambda leaf: jnp.repeat(leaf[None], games, axis=0), watcher and watcher.begin())
    return Results(jnp.zeros(games, jnp.int32), jnp.zeros(games, jnp.int32), unwatched)


def _play(
    game: Game,
    pursuer: Pool,
    evader: Pool,
    key: PRNGKeyArray,
    watcher: AbstractWatcher | None,
    places: _Places,
    waiting: _Waiting,
    more: Bool[Array, ""],
    steps: Int[Array, ""],
) -> tuple[_Places, Int[Array, ""], _Ended]:
    """Some steps of the games in their places; games that wait begin where a place is free.

    Args:
        more: whether other games will wait when these have begun; then it ends early rather than leave places empty.
        steps: how many at most.

    Returns:
        The places, how many of the games that waited have begun, and the games that ended.
    """
    slots, window = places.index.shape[0], waiting.starts.steps.shape[0]
    rows = slots + window  # no more games can end
    unwatched = watcher.begin() if watcher else None
    nothing = _Ended(jnp.zeros(rows, jnp.int32), _no_results(watcher, rows), jnp.asarray(0))
    carry = places, jnp.asarray(0), nothing, jnp.asarray(0)

    def goes_on(carry: tuple[_Places, Array, _Ended, Array]) -> Array:
        places, taken, _, step = carry
        playing, left = places.index != _NOBODY, taken < waiting.count
        return (step < steps) & (left | jnp.where(more, jnp.all(playing), jnp.any(playing)))

    def one_step(carry: tuple[_Places, Array, _Ended, Array]) -> tuple[_Places, Array, _Ended, Array]:
        places, taken, ended, step = carry
        free = places.index == _NOBODY
        upcoming = taken + jnp.cumsum(free.astype(jnp.int32)) - 1
        fresh = free & (upcoming < waiting.count)
        index = jnp.where(fresh, waiting.first + upcoming, places.index)
        state = jax.tree.map(lambda leaf: leaf[jnp.minimum(upcoming, window - 1)], waiting.starts)
        begun = begin(state, pursuer, evader, random_words(key, index, jnp.full(index.shape, -1)))
        games = jax.vmap(anew)(fresh, begun, places.games)
        watched = jax.vmap(anew, in_axes=(0, None, 0))(fresh, unwatched, places.watched)

        games, transition = step_games(game, pursuer, evader, games, random_words(key, index, games.state.steps))
        watched = jax.vmap(watcher.follow)(watched, transition) if watcher else None
        over = (index != _NOBODY) & (transition.terminated | transition.truncated)
        row = jnp.where(over, ended.count + jnp.cumsum(over.astype(jnp.int32)) - 1, rows)
        results = Results(transition.outcome, games.state.steps, watched)
        log = jax.tree.map(
            lambda all_, new: all_.at[row].set(new, mode="drop"), (ended.index, ended.results), (index, results)
        )
        ended = _Ended(log[0], log[1], ended.count + jnp.sum(over, dtype=jnp.int32))
        places = _Places(games, watched, jnp.where(over, _NOBODY, index))
        return places, taken + jnp.sum(fresh, dtype=jnp.int32), ended, step + 1

    return jax.lax.while_loop(goes_on, one_step, carry)[:3]


_advance = jax.jit(_play)


def _zeros(make: Callable[[], Any]) -> Any:
    """What a function makes, with zeros for numbers; nothing is computed."""
    return jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), jax.eval_shape(make))


def _cut(rows: GameState, first: int, count: int) -> GameState:
    """Some of the starts, the last one repeated where they come to an end."""
    total = len(rows.steps)
    index = np.minimum(np.arange(first, first + count), total - 1)
    return jax.tree.map(lambda leaf: leaf[index], rows)
