"""Given starts played to their ends, once each, by a loop that can be watched and stopped.

A compiled function plays some steps of the games under way, in slots; the next start takes the slot of a finished game.
Between two calls, a few times in a second, progress is reported. One compilation serves all numbers of games.
"""

import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.pool import Pool
from apollonius.game.game import Game
from apollonius.game.types import BySide, Flag, GameState, choose
from apollonius.io.kept import Kept
from apollonius.io.workers import available_cores
from apollonius.observe.tracking import Sightings
from apollonius.play.random_bits import random_bits_of
from apollonius.play.rollout import Games, Transition, begin, step_games

Report = Callable[[int, int], None]
"""A callback that gets the number of games that have ended and that of all games."""


def silent(done: int, total: int) -> None:
    """Report nothing."""


_MOST_STEPS = 2**20
"""Most steps in a call of the compiled function."""
_CHUNK_SECONDS = 0.2
"""About the time of a call [s]."""
_WINDOW = 8
"""Starts given to the compiled function at a time, for each slot."""
_NOBODY = -1
"""The number of the game in an empty slot."""


class AbstractWatcher(eqx.Module):
    """A statistic of a game beyond its outcome, updated after every step. Unbatched; the caller uses `vmap`."""

    @abstractmethod
    def begin(self) -> Any:
        """Return the statistic before the first step: arrays."""

    @abstractmethod
    def follow(self, known: Any, transition: Transition) -> Any:
        """Return the statistic after a step."""


class Results(eqx.Module):
    """Outcome and length [steps] of games, a watcher's statistic, in teams the `RobotStatus` of each robot, and what
    sides with sensors sighted; leaves `[games, ...]`."""

    outcome: Int[Array, " games"]
    steps: Int[Array, " games"]
    watched: Any = None
    status: BySide[tuple[Int[Array, " games"], ...]] | None = None
    sightings: BySide[Sightings | None] | None = None


class _Slots(eqx.Module):
    """The games under way, the watcher's statistics, and the numbers of the games."""

    games: Games
    watched: Any
    index: Int[Array, " slots"]


class _Ended(eqx.Module):
    """The numbers and results of the games that ended; only the first `count` rows are filled."""

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
    report: Report = silent,
    first: int = 0,
) -> Results:
    """Play each of the given starts to its end, once.

    On each core at most `slots` games are under way; the next start takes the place of a finished game. The random bits
    of a game depend on the key, its index and its step alone, so other games do not change its course, nor do `slots`,
    but for the last bits of networks, which round otherwise in fewer than 64.

    The slots are rounded up to a power of 2. By default they are as many as are quickest: few for a CPU, since in the
    end only the longest games are left, many for an accelerator. An exception that `report` raises ends the play.
    """
    rows = jax.tree.map(np.asarray, starts)
    total, on_cpu = len(rows.steps), jax.default_backend() == "cpu"
    slots, cores = slots or (64 if on_cpu else 512), len(available_cores()) if on_cpu else 1
    width = 2 ** (slots - 1).bit_length()
    under_way = _zeros(jax.eval_shape(jax.jit(_empty), game, players, key, watcher, _cut(rows, 0, width)))
    under_way.index[:] = _NOBODY
    results = _zeros(jax.eval_shape(lambda: _no_results(watcher, total, under_way.games)))
    advance = partial(_advance, game, players, key, watcher)
    shares = max(1, min(cores, total // width))
    ends = [total * share // shares for share in range(shares + 1)]
    plays = [_play_share(advance, rows, *pair, first, under_way, results) for pair in pairwise(ends)]
    done = sum(next(play) for play in plays)  # which traces the function, once
    with ThreadPoolExecutor(shares) as threads:  # a call of a compiled function keeps its thread busy
        while turn := [new for new in threads.map(lambda play: next(play, None), plays) if new is not None]:
            done += sum(turn)
            report(done, total)
    return jax.device_put(results)


def _play_share(
    advance: Callable[..., tuple[_Slots, Array, _Ended]],
    rows: GameState,
    begun: int,
    end: int,
    first: int,
    under_way: _Slots,
    results: Results,
) -> Iterator[int]:
    """Play the starts from row `begun` to `end` in empty slots, by `_advance` with its first arguments; fill in their
    results, and yield how many games have ended since the last time. The game of the first row has the index `first`.
    """
    done, new, steps, window = begun, 0, 1, len(under_way.index) * _WINDOW
    while done < end:
        asked = time.perf_counter()
        count = min(window, end - begun)
        numbers = (*map(np.int32, (first + begun, count, steps)), np.bool_(begun + count < end))
        under_way, taken, ended = advance(under_way, _cut(rows, begun, window), *numbers)
        yield new
        begun += int(taken)
        new = int(ended.count)
        index = np.asarray(ended.index)[:new] - first
        for column, fresh in zip(jax.tree.leaves(results), jax.tree.leaves(ended.results), strict=True):
            column[index] = np.asarray(fresh)[:new]
        done += new
        # The first call compiles, so that the steps grow from the second one on.
        quick = time.perf_counter() - asked < _CHUNK_SECONDS
        steps = min(steps * 2, _MOST_STEPS) if quick else max(steps // 2, 1)
    yield new


def _empty(
    game: Game, players: BySide[Pool], key: PRNGKeyArray, watcher: AbstractWatcher | None, starts: GameState
) -> _Slots:
    """Return empty slots, one for each of some starts."""
    nobody = jnp.full(starts.steps.shape, _NOBODY, jnp.int32)
    games = begin(game, starts, players, random_bits_of(key, nobody, nobody))
    return _Slots(games, _no_results(watcher, len(nobody), games).watched, nobody)


def _no_results(watcher: AbstractWatcher | None, count: int, games: Games) -> Results:
    """Return blank results of a number of games such as these."""
    unwatched = jax.tree.map(lambda leaf: jnp.repeat(leaf[None], count, axis=0), watcher and watcher.begin())
    nothing = jnp.zeros(count, jnp.int32)
    status, sightings = jax.tree.map(lambda _: nothing, (games.state.status, games.sightings))
    return Results(nothing, nothing, unwatched, status, sightings)


@Kept
def _advance(
    game: Game,
    players: BySide[Pool],
    key: PRNGKeyArray,
    watcher: AbstractWatcher | None,
    under_way: _Slots,
    starts: GameState,
    first: Int[Array, ""],
    count: Int[Array, ""],
    steps: Int[Array, ""],
    more: Flag,
) -> tuple[_Slots, Int[Array, ""], _Ended]:
    """Play some steps of the games under way, at most `steps`; `count` waiting games, from the number `first`, begin
    in empty slots. Where `more` will wait when these have begun, it ends early rather than leave slots empty.

    Returns the games under way, the number of games that have begun, and the games that ended.
    """
    # No more games than rows can end.
    rows, unwatched = len(under_way.index) + len(starts.steps), watcher and watcher.begin()
    nothing = _Ended(jnp.zeros(rows, jnp.int32), _no_results(watcher, rows, under_way.games), jnp.asarray(0))
    carry = under_way, jnp.asarray(0), nothing, jnp.asarray(0)

    def goes_on(carry: tuple[_Slots, Array, _Ended, Array]) -> Array:
        under_way, taken, _, step = carry
        playing, left = under_way.index != _NOBODY, taken < count
        return (step < steps) & (left | jnp.where(more, jnp.all(playing), jnp.any(playing)))

    def one_step(carry: tuple[_Slots, Array, _Ended, Array]) -> tuple[_Slots, Array, _Ended, Array]:
        under_way, taken, ended, step = carry
        free = under_way.index == _NOBODY
        upcoming = taken + jnp.cumsum(free.astype(jnp.int32)) - 1
        fresh = free & (upcoming < count)
        index = jnp.where(fresh, first + upcoming, under_way.index)
        state = jax.tree.map(lambda leaf: leaf[jnp.minimum(upcoming, len(starts.steps) - 1)], starts)
        begun = begin(game, state, players, random_bits_of(key, index, jnp.full(index.shape, -1)))
        # An empty slot stays at the first step of a game: there few players search or plan.
        idle = free & ~fresh & (under_way.games.state.steps == 1)
        games = jax.vmap(choose)(free & ~idle, begun, under_way.games)
        watched = jax.vmap(choose, in_axes=(0, None, 0))(fresh, unwatched, under_way.watched)

        bits = random_bits_of(key, index, games.state.steps)
        after, transition = step_games(game, players, games, bits, observes=False)
        games = jax.vmap(choose)(idle, games, after)
        watched = jax.vmap(watcher.follow)(watched, transition) if watcher else None
        over = (index != _NOBODY) & (transition.terminated | transition.truncated)
        row = jnp.where(over, ended.count + jnp.cumsum(over.astype(jnp.int32)) - 1, rows)
        results = Results(transition.outcome, games.state.steps, watched, games.state.status, games.sightings)
        log = jax.tree.map(
            lambda all_, new: all_.at[row].set(new, mode="drop"), (ended.index, ended.results), (index, results)
        )
        ended = _Ended(log[0], log[1], ended.count + jnp.sum(over, dtype=jnp.int32))
        under_way = _Slots(games, watched, jnp.where(over, _NOBODY, index))
        return under_way, taken + jnp.sum(fresh, dtype=jnp.int32), ended, step + 1

    return jax.lax.while_loop(goes_on, one_step, carry)[:3]


def _zeros(shapes: Any) -> Any:
    return jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), shapes)


def _cut(rows: GameState, first: int, count: int) -> GameState:
    """Return some of the starts, padded with the last one."""
    index = np.minimum(np.arange(first, first + count), len(rows.steps) - 1)
    return jax.tree.map(lambda leaf: leaf[index], rows)
