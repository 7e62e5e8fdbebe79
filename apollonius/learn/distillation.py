"""Distillation: a network learns what a solved game knows, from the states that its own games come to (DAgger).

The student plays, at its best but for some random actions, against several opponents; among them some that know it and
look ahead (`solve.foresight`). In these states and in some others the teacher is asked what each action is worth, and
the network is fitted to the answers (Ross, Gordon, Bagnell, "A reduction of imitation learning and structured
prediction to no-regret online learning", 2011; Rusu et al., "Policy distillation", 2016).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from apollonius.agents.holding import Holding
from apollonius.agents.network import Network, QNetwork
from apollonius.agents.pool import Apart, PersistentNoise, solo
from apollonius.agents.trained import exploring, greedy
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle, wrap_angle
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import NUM_ACTIONS, GameState, Outcome, Real, RobotState, Scalar
from apollonius.learn import dqn
from apollonius.learn.algorithm import linear
from apollonius.learn.replay_buffer import ReplayBuffer, add
from apollonius.learn.stage_config import DistillationConfig
from apollonius.learn.teacher import Setting
from apollonius.learn.train_state import LearnerState, Plan, TrainState, first_learner
from apollonius.learn.train_step import Metrics
from apollonius.observe.observation import perceive
from apollonius.play.rollout import Games, Players, begin, collect
from apollonius.solve.foresight import ResponsePolicy

ORDER = 10.0
"""How much more the differences between a state's actions count than their mean: they are what is chosen by."""
SPREAD = (0.25, 0.25, 0.15, 0.3)
"""Standard deviation of what is asked around a state: of x, y [m], v [m/s] and heading [rad]."""
NEARBY = 3.0
"""How much farther than a capture from one another two robots are, at most, that are put close together [m]."""
_EDGE = 0.02
"""How near to the walls a robot is put, at most [m]."""
_PLANS = ((10, 1, NUM_ACTIONS), (10, 2, 3))
"""Of near-sighted and far-sighted attackers: steps for which an action is held, how many holds they look ahead, and how
many plans they go on from: a second and two, in a game with steps of 0.1 s."""


class Answers(eqx.Module):
    """What the nine actions are worth where something is seen."""

    observation: Float[Array, "rows size"]
    worths: Float[Array, "rows 9"]


def start_distillation(
    plan: Plan, settings: Sequence[Setting], key: PRNGKeyArray, network: Network | None = None
) -> TrainState:
    """Return the state before the first step. The key is consumed.

    Args:
        settings: in each of the arenas; of one shape.
        network: the one to go on from; None starts from random weights.
    """
    network_key, start_key, train_key = jax.random.split(key, 3)
    role = _config(plan).side
    learner = first_learner(plan, role, network_key, network)
    keys = jax.random.split(start_key, len(settings))
    begun = [_first_games(plan, learner.network, *each) for each in zip(settings, keys, strict=True)]
    block = len(jax.eval_shape(asked_states, settings[0].game, begun[0].state, key).steps)
    rows, size = max(1, plan.learner.replay_capacity // block) * block, learner.network.observation.size
    head, filled, iterations, env_steps, episodes = (jnp.zeros((), jnp.int32) for _ in range(5))
    answers = ReplayBuffer(Answers(jnp.zeros((rows, size)), jnp.zeros((rows, NUM_ACTIONS))), head, filled)
    games, learners = jax.tree.map(lambda *leaves: jnp.stack(leaves), *begun), {role: LearnerState(learner, answers)}
    return TrainState(games, learners, train_key, iterations, env_steps, episodes)


def distillation(
    plan: Plan, state: TrainState, settings: Sequence[Setting], done: int = 0
) -> Iterator[tuple[TrainState, Metrics]]:
    """Train the stage chunk by chunk; each state is consumed by the next one.

    Args:
        settings: in each of the arenas, which take turns.
        done: chunks done before.
    """
    for chunk in range(done, plan.chunks):
        number = chunk % len(settings)
        state, metrics = _play_and_learn(plan, state, settings[number], np.int32(number))
        yield state, metrics


@partial(jax.jit, static_argnames="plan")
def _first_games(plan: Plan, network: QNetwork, setting: Setting, key: PRNGKeyArray) -> Games:
    starts, bits = fresh_starts(setting.game, plan.learner.games, key), jnp.zeros((2, plan.learner.games), jnp.uint32)
    return begin(starts, _players(plan, network, setting, key), bits)


@partial(jax.jit, static_argnames="plan", donate_argnames="state")
def _play_and_learn(
    plan: Plan, state: TrainState, setting: Setting, number: Int[Array, ""]
) -> tuple[TrainState, Metrics]:
    """Train one chunk, in the arena of this number: its games go on where they were."""
    here = replace(state, games=jax.tree.map(lambda leaf: leaf[number], state.games))
    after, metrics = jax.lax.scan(lambda state, _: _round(plan, state, setting), here, None, plan.iterations_per_chunk)
    games = jax.tree.map(lambda leaf, new: leaf.at[number].set(new), state.games, after.games)
    return replace(after, games=games), jax.tree.map(lambda leaf: jnp.sum(leaf, axis=0), metrics)


def _round(plan: Plan, state: TrainState, setting: Setting) -> tuple[TrainState, Metrics]:
    """Ask the teacher, play some steps of every game, and fit the student."""
    config, game = _config(plan), setting.game
    role, side = config.side, state.learners[config.side]
    key, learner = jax.random.fold_in(state.key, state.iterations), side.learner
    ask_key, player_key, play_key, start_key, learn_key = jax.random.split(key, 5)
    assert isinstance(learner, dqn.DQNLearner)
    asked = asked_states(game, state.games.state, ask_key)
    _, seen = perceive(learner.network.observation, game, asked, role)
    answers = add(side.buffer, Answers(seen, setting.teacher.worths(game, asked, role)))

    starts = jax.tree.map(lambda leaf: leaf[None], fresh_starts(game, plan.learner.games, start_key))
    players = _players(plan, learner.network, setting, player_key)
    games, moves = collect(game, players, state.games, starts, play_key, plan.learner.steps_per_iteration)
    ended = moves.terminated | moves.truncated

    env_steps = state.env_steps + plan.learner.env_steps_per_iteration
    learner, loss = _fit(plan, learner, answers, env_steps, learn_key)
    counts = state.iterations + 1, env_steps, state.episodes + jnp.sum(ended, dtype=jnp.int32)
    nothing = jnp.zeros(())
    return TrainState(games, {role: LearnerState(learner, answers)}, state.key, *counts), Metrics(
        outcomes=jnp.stack([jnp.sum(ended & (moves.outcome == one), dtype=jnp.int32) for one in Outcome]),
        returns=BySide(nothing, nothing),
        losses=BySide.of(role, loss, nothing),
        updates=jnp.asarray(config.updates, jnp.int32),
    )


def _players(plan: Plan, network: QNetwork, setting: Setting, key: PRNGKeyArray) -> BySide[Players]:
    """Return the student, which explores by one random action a round, and all whom it meets, each in own games."""
    config, table, games = _config(plan), setting.table, plan.learner.games
    explores = solo(exploring(network, jnp.float32(config.epsilon[config.side])))
    student = PersistentNoise(explores, jax.random.bits(key, (games,), jnp.uint32))
    attackers = [
        Holding(
            ResponsePolicy(table.zero_sum_game, table.table, greedy(network), *foresight),
            plan.learner.steps_per_iteration,
        )
        for foresight in _PLANS
    ]
    kinds, left = len(setting.opponents), games - config.near_sighted - config.far_sighted
    shares = [left // kinds + (number < left % kinds) for number in range(kinds)]
    shares += [config.near_sighted, config.far_sighted]
    they = [pair for pair in zip((*setting.opponents, *attackers), shares, strict=True) if pair[1]]
    return BySide.of(config.side, student, Apart(*map(tuple, zip(*they, strict=True))))


def _fit(
    plan: Plan, learner: dqn.DQNLearner, answers: ReplayBuffer[Answers], env_steps: Int[Array, ""], key: PRNGKeyArray
) -> tuple[dqn.DQNLearner, Scalar]:
    """Make some updates from what the teacher has said; return their losses, added up."""
    config, learning = _config(plan), plan.learner
    rate = linear(learning.learning_rate, learning.final_learning_rate, config.env_steps, env_steps)

    def update(learner: dqn.DQNLearner, key: PRNGKeyArray) -> tuple[dqn.DQNLearner, Scalar]:
        rows = jax.random.randint(key, (learning.batch,), 0, answers.filled)
        asked = jax.tree.map(lambda leaf: leaf[rows], answers.rows)
        value, gradient = eqx.filter_value_and_grad(_error)(learner.network, asked)
        return dqn.step(learner, gradient, rate, learning.averaging), value

    learner, losses = jax.lax.scan(update, learner, jax.random.split(key, config.updates))
    return learner, jnp.sum(losses)


def _error(network: QNetwork, answers: Answers) -> Scalar:
    """Return the mean squared error of the differences between a state's actions, and of their mean."""
    wrong = network.batch(answers.observation) - answers.worths
    mean = jnp.mean(wrong, axis=1)
    return ORDER * jnp.mean(jnp.sum((wrong - mean[:, None]) ** 2, axis=1)) + jnp.mean(mean**2)


def _config(plan: Plan) -> DistillationConfig:
    assert isinstance(plan.stage, DistillationConfig)
    return plan.stage


def asked_states(game: Game, visited: GameState, key: PRNGKeyArray) -> GameState:
    """Return states of a game to learn from: those visited, as many around them, and a quarter as many each with the
    robots close together and anywhere. One who knows the student forces it into others than those of its own games.

    Args:
        visited: leaves `[games]`.
        key: consumed.
    """
    around_key, close_key, anywhere_key = jax.random.split(key, 3)
    games, some = len(visited.steps), len(visited.steps) // 4
    around = jax.vmap(_around, in_axes=(None, 0, 0))(game, visited, jax.random.split(around_key, games))
    far = _anywhere(game, some, close_key)
    close = jax.vmap(_closer, in_axes=(None, 0, 0))(game, far, jax.random.split(close_key, some))
    parts = visited, around, close, _anywhere(game, some, anywhere_key)
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *parts)


def fresh_starts(game: Game, games: int, key: PRNGKeyArray) -> GameState:
    """Return starts of games to learn from: every other one as the game draws it, the rest moving and anywhere."""
    rest_key, moving_key = jax.random.split(key)
    starts, others = reset_batch(game, rest_key, games), _anywhere(game, games, moving_key)
    even = jnp.arange(games) % 2 == 0
    return jax.tree.map(lambda one, other: jnp.where(even, one, other), starts, others)


def _anywhere(game: Game, games: int, key: PRNGKeyArray) -> GameState:
    """Return robots at all speeds, nearly up to the walls and nearly up to a capture."""
    starts = replace(game.starts, speed="moving", clearance=0.05, separation=game.capture_distance + 0.05)
    return jax.vmap(lambda key: starts.sample(key, game.arena, game.bodies))(jax.random.split(key, games))


def _around(game: Game, state: GameState, key: PRNGKeyArray) -> GameState:
    """Return a state not far from this one."""
    pursuer, evader = jax.random.normal(key, (2, 4)) * jnp.array([SPREAD])
    robots = _moved(game, game.pursuer, state.pursuer, *pursuer), _moved(game, game.evader, state.evader, *evader)
    return GameState.of_two(*robots, state.steps)


def _closer(game: Game, state: GameState, key: PRNGKeyArray) -> GameState:
    """Return the state with the pursuer not far from the evader."""
    away, angle = jax.random.uniform(key, (2,), minval=jnp.array([0, -jnp.pi]), maxval=jnp.array([NEARBY, jnp.pi]))
    away = game.capture_distance + away
    there = replace(state.pursuer, x=state.evader.x, y=state.evader.y)
    pursuer = _moved(game, game.pursuer, there, away * jnp.cos(angle), away * jnp.sin(angle))
    return GameState.of_two(pursuer, state.evader, state.steps)


def _moved(
    game: Game, body: Unicycle, robot: RobotState, x: Scalar, y: Scalar, v: Real = 0.0, heading: Real = 0.0
) -> RobotState:
    """Return a robot whose numbers differ by these, inside the walls and within its limits."""
    arena = game.arena
    return RobotState(
        jnp.clip(robot.x + x, arena.x_min + _EDGE, arena.x_max - _EDGE),
        jnp.clip(robot.y + y, arena.y_min + _EDGE, arena.y_max - _EDGE),
        jnp.clip(robot.v + v, body.v_min, body.v_max),
        wrap_angle(robot.heading + heading),
    )
