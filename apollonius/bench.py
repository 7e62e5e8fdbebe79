"""How fast it is: env steps and updates per second, on the machine at hand."""

import functools
import os
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.classical import Still
from apollonius.agents.network import QNetwork
from apollonius.agents.pool import solo
from apollonius.agents.uniform import Uniform
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, Role
from apollonius.learn import dqn
from apollonius.learn.fixed_target import start_fixed_target
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.replay_buffer import Batch
from apollonius.learn.self_play import start_self_play
from apollonius.learn.stage_config import SelfPlayConfig, StageConfig
from apollonius.learn.train_state import Plan
from apollonius.learn.train_step import play_and_learn
from apollonius.limits import BENCHED_GAMES
from apollonius.observe.registry import find_observation
from apollonius.playout import Report
from apollonius.random_bits import fold_in
from apollonius.rollout import Games, begin, collect

CLASSIC = DQNConfig(
    observation="paper",
    double=False,
    n_step=1,
    final_n_step=1,
    averaging=1.0,
    learning_rate=1e-4,
    final_learning_rate=1e-4,
    batch=128,
    env_steps_per_update=4,
    target_period=32_000,
    games=4,
    learning_starts=10_000,
)
"""Plain DQN on the 8 numbers, 4 games, batch 128, an update every 4 env steps: how published trainers are measured."""
_STEPS = 250
_START_ROWS = 16
_BARE_UPDATES = 200
_BARE_MOVES = 200
_BARE_BATCHES = 10


def bench_env(games: int, repeats: int = 20, report: Report = lambda done, total: None) -> dict[str, Any]:
    """Random play of the `paper` game with auto-reset; one env step moves both robots.

    Every step computes the states, outcomes, both rewards and both 8-number observations. `report` is told how many of
    the repeats are done.

    Raises:
        InvalidInput: unless `games` is at least 1.
    """
    BENCHED_GAMES.require("games", games)
    game = make_game("paper")
    start_key, word_key = jax.random.split(jax.random.key(0))
    starts = _draw(game, start_key, games)
    players = BySide(*[solo(Uniform())] * 2)
    first = jax.tree.map(lambda leaf: leaf[0], starts)
    games_at_start = begin(first, players, jax.random.bits(word_key, (2, games), jnp.uint32))
    row = jax.tree.map(lambda leaf: leaf[:1], starts)
    carry = _step(game, games_at_start, row, jax.random.key(0))

    def run(repeat: int) -> _Stepped:
        nonlocal carry
        carry = _random_play(game, carry, starts, jax.random.key(repeat))
        return carry

    seconds = _time(run, repeats, report)
    return {"what": "env", "games": games, **_machine(), **_rate("env_steps", games * _STEPS, seconds)}


def bench_train(
    config: DQNConfig,
    repeats: int = 9,
    report: Report = lambda done, total: None,
    stage: Literal["fixed-target", "self-play"] = "fixed-target",
) -> dict[str, Any]:
    """Training as configured, from the first update on, and its arithmetic beside it.

    `updates_per_second` counts those of all sides that learn, `share_of_bare_updates` compares them with updates alone.
    `share_of_arithmetic` compares the time with that of updates and of acting: of every learning side's network asked
    once in each step of every game.

    Args:
        config: how a side learns.
        repeats: of each thing that is timed.
        report: told how many of them are done.
        stage: the pursuer learns against an evader that stands still, or both learn against each other.

    Raises:
        InvalidInput: for an impossible configuration.
    """
    game, key = make_game("paper"), jax.random.key(0)
    if stage == "self-play":
        plan, fixed, sides = Plan(config, SelfPlayConfig(env_steps=10**9)), {}, 2
        state = start_self_play(plan, game, key, BySide(None, None))
    else:
        plan, fixed, sides = Plan(config, StageConfig(env_steps=10**9)), {Role.EVADER: solo(Still())}, 1
        state = start_fixed_target(plan, game, key, fixed[Role.EVADER])

    def run(repeat: int) -> Any:
        nonlocal state
        state, metrics = play_and_learn(plan, game, state, fixed)
        return metrics

    while int(state.env_steps) < config.learning_starts:
        run(0)
    seconds, *alone = _time_in_turns((run, _bare_updates(config), _bare_acting(config)), repeats, report)
    updates = sides * plan.iterations_per_chunk * config.updates_per_iteration
    moves = sides * plan.env_steps_per_chunk // config.games
    turns = [
        (one, updates * updating / _BARE_UPDATES, moves * acting / _BARE_MOVES)
        for one, updating, acting in zip(seconds, *alone, strict=True)
    ]
    return {
        "what": "train",
        "stage": stage,
        "games": config.games,
        "batch": config.batch,
        "env_steps_per_update": config.env_steps_per_update,
        **_machine(),
        **_rate("env_steps", plan.env_steps_per_chunk, seconds),
        **_rate("updates", updates, seconds),
        "bare_updates_per_second": _BARE_UPDATES / statistics.median(alone[0]),
        "share_of_bare_updates": statistics.median(updating / one for one, updating, _ in turns),
        "share_of_arithmetic": statistics.median((updating + acting) / one for one, updating, acting in turns),
    }


def _bare_updates(config: DQNConfig) -> Callable[[int], Any]:
    """`_BARE_UPDATES` updates with no game and no replay: what the arithmetic of learning alone allows.

    The batches are fixed, but each differs from the one before and its next observations from its observations: what
    is the same, the compiler computes only once.
    """
    learner = dqn.init(config, jax.random.key(0))
    size = find_observation(config.observation).size
    observation, after = jax.random.normal(jax.random.key(1), (2, _BARE_BATCHES, config.batch, size))
    flat = observation[:, :, 0]
    batches = jax.vmap(Batch)(observation, jnp.zeros(flat.shape, jnp.int32), flat, after, flat)

    @jax.jit
    def run(learner: dqn.DQNLearner) -> dqn.DQNLearner:
        def update(learner: dqn.DQNLearner, step: Int[Array, ""]) -> tuple[dqn.DQNLearner, None]:
            batch = jax.tree.map(lambda leaf: leaf[step % _BARE_BATCHES], batches)
            return dqn.update(learner, batch, jnp.asarray(1e-4), config)[0], None

        return jax.lax.scan(update, learner, jnp.arange(_BARE_UPDATES))[0]

    return lambda repeat: run(learner)


def _bare_acting(config: DQNConfig) -> Callable[[int], Any]:
    """`_BARE_MOVES` times the best actions in all games, by a network that is given observations."""
    network = dqn.init(config, jax.random.key(0)).network
    size = find_observation(config.observation).size
    observations = jax.random.normal(jax.random.key(1), (_BARE_BATCHES, config.games, size))

    @jax.jit
    def run(network: QNetwork) -> Int[Array, " games"]:
        def act(chosen: Int[Array, " games"], step: Int[Array, ""]) -> tuple[Int[Array, " games"], None]:
            values = network.together(observations[step % _BARE_BATCHES])
            return chosen + jnp.argmax(values, axis=1), None

        return jax.lax.scan(act, jnp.zeros(config.games, jnp.int32), jnp.arange(_BARE_MOVES))[0]

    return lambda repeat: run(network)


class _Stepped(eqx.Module):
    """Games under way, and what an environment returns of a step: observations, rewards, flags."""

    games: Games
    returned: tuple[Array, ...]


def _step(game: Game, games: Games, starts: GameState, key: PRNGKeyArray) -> _Stepped:
    players = BySide(*[solo(Uniform())] * 2)
    games, step = collect(game, players, games, starts, key, steps=1)
    returned = (*(side.next_observation for side in step.sides), *(side.reward for side in step.sides))
    return _Stepped(games, (*returned, step.terminated, step.truncated))


@functools.partial(jax.jit, static_argnames="games")
def _draw(game: Game, key: PRNGKeyArray, games: int) -> GameState:
    starts = reset_batch(game, key, _START_ROWS * games)
    return jax.tree.map(lambda leaf: leaf.reshape(_START_ROWS, games), starts)


@functools.partial(jax.jit, donate_argnames="carry")
def _random_play(game: Game, carry: _Stepped, starts: GameState, key: PRNGKeyArray) -> _Stepped:
    """Random play. What a step returns overwrites what the one before returned, so all of it is computed."""

    def one_step(step: Int[Array, ""], carry: _Stepped) -> _Stepped:
        row = jax.tree.map(lambda leaf: jax.lax.dynamic_slice_in_dim(leaf, step % _START_ROWS, 1), starts)
        return _step(game, carry.games, row, fold_in(key, step))

    return jax.lax.fori_loop(0, _STEPS, one_step, carry)


def _time(run: Callable[[int], Any], repeats: int, report: Report) -> list[float]:
    """Wall seconds of each repeat; one that compiles and warms up goes before."""
    (seconds,) = _time_in_turns((run,), repeats, report)
    return seconds


def _time_in_turns(runs: Sequence[Callable[[int], Any]], repeats: int, report: Report) -> list[list[float]]:
    """Wall seconds of each repeat of each of several, side by side in time, so that a busy machine slows all alike."""
    seconds: list[list[float]] = [[] for _ in runs]
    for repeat in range(repeats + 1):
        for run, spent in zip(runs, seconds, strict=True):
            began = time.perf_counter()
            jax.block_until_ready(run(repeat))
            if repeat > 0:
                spent.append(time.perf_counter() - began)
        report(repeat, repeats)
    return seconds


def _rate(name: str, amount: int, seconds: list[float]) -> dict[str, float]:
    return {
        f"{name}_per_second": amount / statistics.median(seconds),
        f"{name}_per_second_best": amount / min(seconds),
        f"{name}_per_second_worst": amount / max(seconds),
    }


def _machine() -> dict[str, Any]:
    device = jax.devices()[0]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"device": device.device_kind, "cores": cores, "jax": jax.__version__}
