"""Given starts played to their ends, once each, by a loop that can be watched and stopped.

A compiled function plays some steps of the games under way, in slots; the next start takes the slot
of a finished game. Between two calls, a few times in a second, progress is reported. One
compilation serves all numbers of games.
"""

import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, PRNGKeyArray

from apollonius.agents.pool import AbstractPlayers
from apollonius.game.game import Game
from apollonius.game.types import BySide, Flag, GameState, tree_where
from apollonius.io.workers import available_cores
from apollonius.observe.tracking import Sightings
from apollonius.play.random_bits import random_bits_of
from apollonius.play.rollout import Games, Transition, init_games, step_games

Report = Callable[[int, int], None]
"""A callback that gets the number of games that have ended and that of all games."""


def no_report(done: int, total: int) -> None:
    """Report nothing."""


_MOST_STEPS = 2**20
"""Most steps in a call of the compiled function."""
_CHUNK_SECONDS = 0.2
"""About the time of a call [s]."""
_WINDOW = 8
"""Starts given to the compiled function at a time, for each slot."""
_NOBODY = -1
"""The number of the game in an empty slot."""
_Mask = Bool[Array, " slots"]


class AbstractWatcher(eqx.Module):
    """A statistic of a game beyond its outcome, updated after every step. Unbatched; the caller
    uses `vmap`.
    """

    @abstractmethod
    def init(self) -> Any:
        """Return the statistic before the first step: arrays."""

    @abstractmethod
    def update(self, statistic: Any, transition: Transition) -> Any:
        """Return the statistic after a step."""


class Results(eqx.Module):
    """Outcome and length [steps] of games, the `RobotStatus` of each robot, a watcher's statistic,
    and what sides with sensors sighted; leaves `[games, ...]`."""

    outcome: Int[Array, " games"]
    steps: Int[Array, " games"]
    status: BySide[tuple[Int[Array, " games"], ...]]
    watched: Any = None
    sightings: BySide[Sightings | None] | None = None


class _Play(eqx.Module):
    """The rules, players, key and watcher, as in `play_out`; the same for all games."""

    game: Game
    players: BySide[AbstractPlayers]
    key: PRNGKeyArray
    watcher: AbstractWatcher | None


class _Queue(eqx.Module):
    """Games that wait for an empty slot.

    Attributes:
        starts: their initial states, leaves `[rows]`.
        first: index of the first one.
        count: their number; rows beyond it are not played.
        more: whether others will wait when these have begun.
    """

    starts: GameState
    first: Int[Array, ""] | np.int32
    count: Int[Array, ""] | np.int32
    more: Flag | np.bool_


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

    def append(self, new: _Mask, index: Int[Array, " slots"], results: Results) -> "_Ended":
        """Return the record with the results of the slots whose games are new in it."""
        blank = len(self.index)
        row = jnp.where(new, self.count + jnp.cumsum(new.astype(jnp.int32)) - 1, blank)
        record, results = jax.tree.map(
            lambda column, values: column.at[row].set(values, mode="drop"),
            (self.index, self.results),
            (index, results),
        )
        return _Ended(record, results, self.count + jnp.sum(new, dtype=jnp.int32))


class _Progress(NamedTuple):
    """The carry of `_advance`: slots, games begun, games ended, and steps made."""

    under_way: _Slots
    num_started: Int[Array, ""]
    ended: _Ended
    step: Int[Array, ""]


def play_out(
    game: Game,
    players: BySide[AbstractPlayers],
    starts: GameState,
    key: PRNGKeyArray,
    slots: int | None = None,
    watcher: AbstractWatcher | None = None,
    report: Report = no_report,
    first: int = 0,
) -> Results:
    """Play each of the given starts to its end, once.

    On each core at most `slots` games are under way; the next start takes the place of a finished
    game. A game's course depends on the key, its index and its step only, up to the rounding of
    networks in fewer than 64 slots.

    Args:
        game: the rules.
        players: the players of both sides.
        starts: initial states, leaves `[games]`.
        key: draws the random bits of all games.
        slots: games under way on each core, rounded up to a power of 2; by default few on a CPU,
            where the longest games are left at the end, and many on an accelerator.
        watcher: a statistic of every game.
        report: gets the numbers of games ended and of all; an exception from it ends the play.
        first: index of the first game.
    """
    rows = jax.tree.map(np.asarray, starts)
    total = len(rows.steps)
    on_cpu = jax.default_backend() == "cpu"
    cores = len(available_cores()) if on_cpu else 1
    default_slots = 64 if on_cpu else 512
    width = 2 ** ((slots or default_slots) - 1).bit_length()
    play = _Play(game, players, key, watcher)
    under_way = _zeros(jax.eval_shape(jax.jit(_empty), play, _cut(rows, 0, width)))
    under_way.index[:] = _NOBODY
    results = _zeros(jax.eval_shape(lambda: _no_results(watcher, total, under_way.games)))
    shares = max(1, min(cores, total // width))
    ends = [total * share // shares for share in range(shares + 1)]
    plays = [
        _play_share(play, rows, begin_row, end_row, first, under_way, results)
        for begin_row, end_row in pairwise(ends)
    ]
    _play_shares(plays, total, report)
    return jax.device_put(results)


def _play_shares(plays: list[Iterator[int]], total: int, report: Report) -> None:
    """Run all shares, a thread each, and report the numbers of games ended and of all."""
    ended_games = sum(next(play) for play in plays)  # which traces the function, once

    def next_count(play: Iterator[int]) -> int | None:
        return next(play, None)

    # a call of a compiled function keeps its thread busy
    with ThreadPoolExecutor(len(plays)) as threads:
        while True:
            counts = list(threads.map(next_count, plays))
            new_counts = [count for count in counts if count is not None]
            if not new_counts:
                break
            ended_games += sum(new_counts)
            report(ended_games, total)


def _play_share(
    play: _Play,
    rows: GameState,
    start: int,
    end: int,
    first: int,
    under_way: _Slots,
    results: Results,
) -> Iterator[int]:
    """Play a share of the starts; yield how many games have ended since the last time.

    Args:
        play: the rules, players, key and watcher.
        rows: all starts, leaves `[games]`.
        start, end: the rows of this share.
        first: index of the game of row 0.
        under_way: empty slots.
        results: filled in, leaves `[games]`.
    """
    ended_games = start
    new_ended = 0
    steps = 1
    window = len(under_way.index) * _WINDOW
    while ended_games < end:
        call_time = time.perf_counter()
        count = min(window, end - start)
        queue = _Queue(
            _cut(rows, start, window),
            first=np.int32(first + start),
            count=np.int32(count),
            more=np.bool_(start + count < end),
        )
        under_way, begun_games, ended = _advance(play, under_way, queue, np.int32(steps))
        yield new_ended
        start += int(begun_games)
        new_ended = int(ended.count)
        index = np.asarray(ended.index)[:new_ended] - first
        for column, new_results in zip(
            jax.tree.leaves(results), jax.tree.leaves(ended.results), strict=True
        ):
            column[index] = np.asarray(new_results)[:new_ended]
        ended_games += new_ended
        # The first call compiles, so that the steps grow from the second one on.
        is_quick = time.perf_counter() - call_time < _CHUNK_SECONDS
        steps = min(steps * 2, _MOST_STEPS) if is_quick else max(steps // 2, 1)
    yield new_ended


def _empty(play: _Play, starts: GameState) -> _Slots:
    """Return empty slots, one for each of some starts."""
    no_index = jnp.full(starts.steps.shape, _NOBODY, jnp.int32)
    bits = random_bits_of(play.key, no_index, no_index)
    games = init_games(play.game, starts, play.players, bits)
    return _Slots(games, _no_results(play.watcher, len(no_index), games).watched, no_index)


def _no_results(watcher: AbstractWatcher | None, count: int, games: Games) -> Results:
    """Return blank results of a number of games such as these."""
    statistics = jax.tree.map(
        lambda leaf: jnp.repeat(leaf[None], count, axis=0), watcher and watcher.init()
    )
    zeros = jnp.zeros(count, jnp.int32)
    status, sightings = jax.tree.map(lambda _: zeros, (games.state.status, games.sightings))
    return Results(zeros, zeros, status, statistics, sightings)


@jax.jit
def _advance(
    play: _Play, under_way: _Slots, queue: _Queue, steps: Int[Array, ""]
) -> tuple[_Slots, Int[Array, ""], _Ended]:
    """Play some steps of the games under way; waiting games begin in empty slots.

    If more games wait than those of the queue, play ends when none of these is left for an empty
    slot.

    Args:
        play: the rules, players, key and watcher.
        under_way: the slots.
        queue: the waiting games.
        steps: most steps.

    Returns the games under way, the number of games that have begun, and the games that ended.
    """
    rows = len(under_way.index) + len(queue.starts.steps)  # no more games than these can end
    no_index = jnp.zeros(rows, jnp.int32)
    no_results = _no_results(play.watcher, rows, under_way.games)

    def should_continue(progress: _Progress) -> Array:
        is_playing = progress.under_way.index != _NOBODY
        some_wait = progress.num_started < queue.count
        some_play = jnp.where(queue.more, jnp.all(is_playing), jnp.any(is_playing))
        return (progress.step < steps) & (some_wait | some_play)

    def one_step(progress: _Progress) -> _Progress:
        slots, is_new, is_idle = _refill(play, progress.under_way, queue, progress.num_started)
        slots, results, has_ended = _step_slots(play, slots, is_idle)
        return _Progress(
            under_way=replace(slots, index=jnp.where(has_ended, _NOBODY, slots.index)),
            ended=progress.ended.append(has_ended, slots.index, results),
            num_started=progress.num_started + jnp.sum(is_new, dtype=jnp.int32),
            step=progress.step + 1,
        )

    start = _Progress(
        under_way=under_way,
        num_started=jnp.asarray(0),
        ended=_Ended(no_index, no_results, jnp.asarray(0)),
        step=jnp.asarray(0),
    )
    end = jax.lax.while_loop(should_continue, one_step, start)
    return end.under_way, end.num_started, end.ended


def _refill(
    play: _Play, slots: _Slots, queue: _Queue, num_started: Int[Array, ""]
) -> tuple[_Slots, _Mask, _Mask]:
    """Begin waiting games in empty slots; return which began, and which slots stay idle.

    Args:
        play: the rules, players, key and watcher.
        slots: the games under way.
        queue: the waiting games.
        num_started: number of games of the queue that have begun already.
    """
    is_empty = slots.index == _NOBODY
    upcoming = num_started + jnp.cumsum(is_empty.astype(jnp.int32)) - 1
    is_new = is_empty & (upcoming < queue.count)
    index = jnp.where(is_new, queue.first + upcoming, slots.index)
    last = len(queue.starts.steps) - 1
    state = jax.tree.map(lambda leaf: leaf[jnp.minimum(upcoming, last)], queue.starts)
    bits = random_bits_of(play.key, index, jnp.full(index.shape, -1))
    new_games = init_games(play.game, state, play.players, bits)
    # An empty slot stays at the first step of a game: there few players search or plan.
    is_idle = is_empty & ~is_new & (slots.games.state.steps == 1)
    games = jax.vmap(tree_where)(is_empty & ~is_idle, new_games, slots.games)
    unwatched = play.watcher and play.watcher.init()
    watched = jax.vmap(tree_where, in_axes=(0, None, 0))(is_new, unwatched, slots.watched)
    return _Slots(games, watched, index), is_new, is_idle


def _step_slots(play: _Play, slots: _Slots, is_idle: _Mask) -> tuple[_Slots, Results, _Mask]:
    """Play one step in all slots but the idle ones.

    Returns the slots, their results so far, and which games have ended.
    """
    bits = random_bits_of(play.key, slots.index, slots.games.state.steps)
    after, transition = step_games(play.game, play.players, slots.games, bits, with_obs=False)
    games = jax.vmap(tree_where)(is_idle, slots.games, after)
    watched = jax.vmap(play.watcher.update)(slots.watched, transition) if play.watcher else None
    has_ended = (slots.index != _NOBODY) & transition.ended
    results = Results(
        transition.outcome, games.state.steps, games.state.status, watched, games.sightings
    )
    return _Slots(games, watched, slots.index), results, has_ended


def _zeros(shapes: Any) -> Any:
    return jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), shapes)


def _cut(rows: GameState, first: int, count: int) -> GameState:
    """Return some of the starts, padded with the last one."""
    index = np.minimum(np.arange(first, first + count), len(rows.steps) - 1)
    return jax.tree.map(lambda leaf: leaf[index], rows)
