"""How fast training is, and its arithmetic beside it."""

import statistics
from collections.abc import Callable
from typing import Any, Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.agents.classical import Still
from apollonius.agents.network import QNetwork
from apollonius.agents.pool import solo
from apollonius.bench.timing import in_turns, machine, rate
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.learn import dqn
from apollonius.learn.fixed_target import start_fixed_target
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.replay_buffer import Batch
from apollonius.learn.self_play import start_self_play
from apollonius.learn.stage_config import SelfPlayConfig, StageConfig
from apollonius.learn.train_state import Plan
from apollonius.learn.train_step import play_and_learn
from apollonius.observe.registry import find_observation
from apollonius.playout import Report

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
_BARE_UPDATES = 200
_BARE_MOVES = 200
_BARE_BATCHES = 10


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
    seconds, *alone = in_turns((run, _bare_updates(config), _bare_acting(config)), repeats, report)
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
        **machine(),
        **rate("env_steps", plan.env_steps_per_chunk, seconds),
        **rate("updates", updates, seconds),
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
