"""How fast random play is, with any game and observation."""

import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.pool import Pool, solo
from apollonius.agents.uniform import Uniform
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.bench.timing import machine, rate, seconds_of
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import GameState
from apollonius.limits import BENCHED_GAMES
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.registry import find_observation
from apollonius.playout import Report
from apollonius.random_bits import fold_in
from apollonius.rollout import Games, begin, collect

_STEPS = 250
_START_ROWS = 16


def bench_env(
    games: int,
    repeats: int = 20,
    report: Report = lambda done, total: None,
    game: str = "paper",
    observation: str = "paper",
) -> dict[str, Any]:
    """Random play with auto-reset; one env step moves both robots.

    Every step computes the states, outcomes, both rewards and both observations.

    Args:
        games: at a time.
        repeats: of what is timed.
        report: told how many of them are done.
        game: its name or file.
        observation: what both sides read.

    Raises:
        InvalidInput: unless `games` is at least 1; for an unknown game or observation.
    """
    BENCHED_GAMES.require("games", games)
    reads, rules = find_observation(observation), find_game(game)
    rules = charted(rules) if reads.charted else rules
    start_key, word_key = jax.random.split(jax.random.key(0))
    starts = _draw(rules, start_key, games)
    players = BySide(*[solo(_Reader(reads))] * 2)
    first = jax.tree.map(lambda leaf: leaf[0], starts)
    games_at_start = begin(first, players, jax.random.bits(word_key, (2, games), jnp.uint32))
    row = jax.tree.map(lambda leaf: leaf[:1], starts)
    carry = _step(rules, players, games_at_start, row, jax.random.key(0))

    def run(repeat: int) -> _Stepped:
        nonlocal carry
        carry = _random_play(rules, players, carry, starts, jax.random.key(repeat))
        return carry

    seconds = seconds_of(run, repeats, report)
    asked = {"what": "env", "game": game, "observation": observation, "games": games}
    return {**asked, **machine(), **rate("env_steps", games * _STEPS, seconds)}


class _Reader(Uniform):
    """A random player whose transitions have the observation that is measured."""

    reads: AbstractObservation = eqx.field(static=True)

    @property
    def observation(self) -> AbstractObservation:
        """What it is given, and does not look at."""
        return self.reads


class _Stepped(eqx.Module):
    """Games under way, and what an environment returns of a step: observations, rewards, flags."""

    games: Games
    returned: tuple[Array, ...]


def _step(game: Game, players: BySide[Pool], games: Games, starts: GameState, key: PRNGKeyArray) -> _Stepped:
    games, step = collect(game, players, games, starts, key, steps=1)
    returned = (*(side.next_observation for side in step.sides), *(side.reward for side in step.sides))
    return _Stepped(games, (*returned, step.terminated, step.truncated))


@functools.partial(jax.jit, static_argnames="games")
def _draw(game: Game, key: PRNGKeyArray, games: int) -> GameState:
    starts = reset_batch(game, key, _START_ROWS * games)
    return jax.tree.map(lambda leaf: leaf.reshape(_START_ROWS, games), starts)


@functools.partial(jax.jit, donate_argnames="carry")
def _random_play(game: Game, players: BySide[Pool], carry: _Stepped, starts: GameState, key: PRNGKeyArray) -> _Stepped:
    """Random play. What a step returns overwrites what the one before returned, so all of it is computed."""

    def one_step(step: Int[Array, ""], carry: _Stepped) -> _Stepped:
        row = jax.tree.map(lambda leaf: jax.lax.dynamic_slice_in_dim(leaf, step % _START_ROWS, 1), starts)
        return _step(game, players, carry.games, row, fold_in(key, step))

    return jax.lax.fori_loop(0, _STEPS, one_step, carry)
