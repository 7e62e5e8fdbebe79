"""Env steps, updates and backups per second on this machine: `python benchmarks/speed.py WHAT
[OPTIONS]`.

`env` plays at random with auto-reset, in any game; one env step moves the robots of both sides.
`starts` draws starts of any game, `--games` at a time.
`loops` plays as `env` by the public functions, one loop after another, in seconds of the processor.
`train` trains in the `paper` game from the first update on.
`solve` sweeps over one robot's grid and over a grid of two; a backup is one action at one node.
Medians; of wall seconds except of `loops`; pin it to a core (`taskset -c 0`).
"""

import argparse
import functools
import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.accelerate.threefry import threefry_bits
from apollonius.agents.classical import Uniform
from apollonius.agents.pool import Pool, single_player
from apollonius.arenas.file import find_game
from apollonius.cli.values import nodes
from apollonius.game.game import Game, reset_batch
from apollonius.game.presets import make_game
from apollonius.game.types import NUM_ACTIONS, BySide, GameState, Role, Timestep, tree_where
from apollonius.learn.config import FIXED_TARGET, SELF_PLAY
from apollonius.learn.dqn import PROFILES, DQNConfig
from apollonius.learn.fixed_target import FixedTargetConfig
from apollonius.learn.self_play import SelfPlayConfig
from apollonius.observe.registry import find_observation
from apollonius.observe.view import look
from apollonius.play.autoreset import RunningBatch, autoreset
from apollonius.play.rollout import Games, collect, init_games
from apollonius.solve.grid import lanes_of
from apollonius.solve.joint import make_duel, value_before_move
from apollonius.solve.motion import make_zero_sum_game, motion_of
from apollonius.solve.solving import joint_grids, reference_grid
from apollonius.solve.transition_map import make_side

STEPS = 250
START_ROWS = 16
LOOP_STEPS = 100
Stepped = tuple[Games, tuple[Array, ...]]
"""Games under way, and what an environment returns of a step: observations, rewards, flags."""


def measure_env(game: Game, games: int) -> dict[str, Any]:
    """Time random play; every step computes the states, outcomes, rewards and observations of both
    sides.
    """
    start_key, word_key = jax.random.split(jax.random.key(0))
    all_starts = jax.jit(reset_batch, static_argnums=2)(game, start_key, START_ROWS * games)
    starts = jax.tree.map(lambda leaf: leaf.reshape(START_ROWS, games, *leaf.shape[1:]), all_starts)
    players = BySide(*[single_player(Uniform())] * 2)
    first, row = (
        jax.tree.map(lambda leaf, rows=rows: leaf[rows], starts) for rows in (0, slice(1))
    )
    first_games = init_games(
        game, first, players, jax.random.bits(word_key, (2, games), jnp.uint32)
    )
    carry = _step(game, players, first_games, row, jax.random.key(0))

    def run(repeat: int) -> Stepped:
        nonlocal carry
        carry = _random_play(game, players, carry, starts, jax.random.key(repeat))
        return carry

    return {"games": games, "env_steps_per_second": games * STEPS / timed(run, 20)}


def _step(
    game: Game, players: BySide[Pool], games: Games, starts: GameState, key: PRNGKeyArray
) -> Stepped:
    games, step = collect(game, players, games, starts, key, steps=1)
    returned = (
        *(side.next_observation for side in step.sides),
        *(side.reward for side in step.sides),
    )
    return games, (*returned, step.terminated, step.truncated)


@functools.partial(jax.jit, donate_argnames="carry")
def _random_play(
    game: Game, players: BySide[Pool], carry: Stepped, starts: GameState, key: PRNGKeyArray
) -> Stepped:
    def one_step(step: Int[Array, ""], carry: Stepped) -> Stepped:
        row = jax.tree.map(
            lambda leaf: jax.lax.dynamic_slice_in_dim(leaf, step % START_ROWS, 1), starts
        )
        return _step(game, players, carry[0], row, jax.random.fold_in(key, step))

    # What a step returns overwrites what the one before returned, so all of it is computed.
    return jax.lax.fori_loop(0, STEPS, one_step, carry)


def measure_starts(game: Game, games: int) -> dict[str, Any]:
    """Time the draw of starts."""
    draw_starts = jax.jit(reset_batch, static_argnums=2)
    seconds = timed(lambda repeat: draw_starts(game, jax.random.key(repeat), games), 9)
    return {"games": games, "starts_per_second": games / seconds}


def measure_loops(game: Game, games: int) -> dict[str, Any]:
    """Time loops that step all games at random; each keeps the rewards and ends of every step."""
    key, (batch, step) = jax.random.key(0), autoreset(game, jax.random.key(1), games)
    encode = find_observation("encoded")

    def step_alone(batch: RunningBatch, actions: Array) -> tuple[RunningBatch, Timestep]:
        after = jax.vmap(game.step)(batch.state, *actions)
        return replace(batch, state=after.state), after

    def drawing(batch: RunningBatch, actions: Array) -> tuple[RunningBatch, Timestep]:
        after = jax.vmap(game.step)(batch.state, *actions)
        fresh = reset_batch(game, jax.random.fold_in(key, batch.turn), games)
        is_over = after.terminated | after.truncated
        return RunningBatch(
            jax.vmap(tree_where)(is_over, fresh, after.state), batch.turn + 1
        ), after

    def observed(
        batch: RunningBatch, actions: Array
    ) -> tuple[RunningBatch, tuple[Timestep, Array]]:
        batch, after = step(batch, actions)
        return batch, (
            after,
            jax.vmap(lambda state: encode(look(game, state, Role.PURSUER)))(batch.state),
        )

    loops = {
        "step": step_alone,
        "autoreset": step,
        "autoreset, observation": observed,
        "step, reset_batch": drawing,
    }
    return {name: _speed_of(loop, batch, games) for name, loop in loops.items()}


def _speed_of(
    loop: Callable[[RunningBatch, Array], tuple[RunningBatch, Any]], batch: RunningBatch, games: int
) -> float:
    """Return env steps per second of the processor."""

    @jax.jit
    def play(batch: RunningBatch, key: PRNGKeyArray) -> tuple[RunningBatch, Any]:
        def one_step(
            carry: tuple[RunningBatch, Any], turn: Array
        ) -> tuple[tuple[RunningBatch, Any], None]:
            words = threefry_bits(jax.random.fold_in(key, turn), (2, games))
            batch, step_result = loop(
                carry[0], (((words >> 16) * NUM_ACTIONS) >> 16).astype(jnp.int32)
            )
            return (batch, jax.tree.map(jnp.add, carry[1], _stored_parts(step_result))), None

        nothing = jax.tree.map(
            lambda leaf: jnp.zeros(leaf.shape, leaf.dtype),
            jax.eval_shape(lambda: _stored_parts(loop(batch, jnp.zeros((2, games), jnp.int32))[1])),
        )
        return jax.lax.scan(one_step, (batch, nothing), jnp.arange(LOOP_STEPS))[0]

    last = batch

    def run(repeat: int) -> Any:
        nonlocal last
        last, totals = play(last, jax.random.key(repeat))
        return totals

    return games * LOOP_STEPS / timed(run, 9, time.process_time)


def _stored_parts(step_result: Any) -> tuple[Array, ...]:
    """Return the parts of a step that a learner stores, so that all of it is computed."""
    after, *observations = step_result if isinstance(step_result, tuple) else (step_result,)
    return (
        *after.reward,
        after.terminated.astype(jnp.int32),
        after.truncated.astype(jnp.int32),
        *observations,
    )


def measure_training(config: DQNConfig, stage: str) -> dict[str, Any]:
    """Time training; updates are those of all sides that learn."""
    stages = {FIXED_TARGET: FixedTargetConfig, SELF_PLAY: SelfPlayConfig}
    trained = stages[stage](env_steps=10**9).make(config, make_game("paper"))
    state = trained.init(jax.random.key(0))

    def run(repeat: int) -> Any:
        nonlocal state
        state, metrics = trained.step(state)
        return metrics

    while int(state.env_steps) < config.learning_starts:
        run(0)
    seconds = timed(run, 9)
    updates = len(state.learners) * config.iterations_per_chunk * config.updates_per_iteration
    return {
        "games": config.games,
        "env_steps_per_second": config.env_steps_per_chunk / seconds,
        "updates_per_second": updates / seconds,
    }


def measure_solver(counts: Sequence[int], hold: int) -> dict[str, Any]:
    """Time a sweep of one robot's safety, and one side's backups of a game of two on a grid of
    `counts` nodes.
    """
    game = make_game("paper")
    grid, alone_hold = reference_grid(game, Role.PURSUER)
    side = make_side(motion_of(game, Role.PURSUER, alone_hold), grid)
    free = jnp.zeros(grid.shape, jnp.float32)

    def value(index: Array, action: int, later: Array) -> Array:
        return jnp.where(side.free[index, action], later, 0.0)

    sweep = jax.jit(lambda table: side.transitions.backup(table, value))
    sweep_seconds = timed(lambda _: sweep(free), 5)
    duel = make_duel(make_zero_sum_game(game, joint_grids(game, list(counts)), hold, Role.PURSUER))
    lanes = lanes_of(duel.first.grid)
    pairs = jnp.zeros((duel.first.grid.size // lanes, duel.second.grid.size, lanes), jnp.float32)
    pair_seconds = timed(lambda _: value_before_move(duel, pairs), 5)
    return {
        "nodes": grid.size,
        "million_backups_per_second": grid.size * NUM_ACTIONS / sweep_seconds / 1e6,
        "million_pairs": pairs.size / 1e6,
        "million_backups_per_second_of_pairs": pairs.size * NUM_ACTIONS / pair_seconds / 1e6,
    }


def timed(
    run: Callable[[int], Any], repeats: int, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Return the median seconds of a repeat; one that compiles and warms up goes before."""
    seconds: list[float] = []
    for repeat in range(repeats + 1):
        start_time = clock()
        jax.block_until_ready(run(repeat))
        seconds.append(clock() - start_time)
    return statistics.median(seconds[1:])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("env", "starts", "loops", "train", "solve"))
    parser.add_argument(
        "--games",
        type=int,
        default=4096,
        help="of env, starts, loops: at a time (default: %(default)s)",
    )
    parser.add_argument(
        "--game", default="paper", help="of env, starts, loops: name or file (default: %(default)s)"
    )
    parser.add_argument(
        "--profile", choices=PROFILES, default="fast", help="of train (default: %(default)s)"
    )
    parser.add_argument(
        "--stage", choices=(FIXED_TARGET, SELF_PLAY), default="fixed-target", help="of train"
    )
    parser.add_argument(
        "--grid", type=nodes, default="11x11x5x8", help="of solve, of two (default: %(default)s)"
    )
    options = parser.parse_args()
    if options.what == "env":
        result = measure_env(find_game(options.game).packed(), options.games)
    elif options.what == "starts":
        result = measure_starts(find_game(options.game).packed(), options.games)
    elif options.what == "loops":
        result = measure_loops(find_game(options.game).packed(), options.games)
    elif options.what == "solve":
        result = measure_solver(options.grid, hold=10)
    else:
        result = measure_training(PROFILES[options.profile], options.stage)
    print(
        f"{jax.devices()[0].device_kind}, {len(os.sched_getaffinity(0))} cores, jax "
        f"{jax.__version__}"
    )
    for name, value in result.items():
        print(f"{name:<36} {value:,.{0 if value >= 100 else 2}f}")


if __name__ == "__main__":
    main()
