"""Distillation: a network learns what a solved game knows, from the states that its own games come to (DAgger).

The student plays, at its best but for some random actions, against several opponents; among them some that know it and
look ahead (`solve.foresight`). In the states that come about the teacher is asked what each action is worth, and the
network is fitted to the answers (Ross, Gordon, Bagnell, "A reduction of imitation learning and structured prediction to
no-regret online learning", 2011; Rusu et al., "Policy distillation", 2016).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, UInt32

from apollonius.agents.disturbance import NONE
from apollonius.agents.network import Network, QNetwork
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import act_in_rows
from apollonius.agents.trained import greedy
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, ROLES, Action, GameState, Outcome, Role, Scalar
from apollonius.learn import dqn
from apollonius.learn.algorithm import linear
from apollonius.learn.lessons import Lessons
from apollonius.learn.school import School
from apollonius.learn.situations import fresh_starts, situations
from apollonius.learn.stage_config import DistillationConfig
from apollonius.learn.train_state import LearnerState, Plan, TrainState, first_learner
from apollonius.learn.train_step import Metrics
from apollonius.observe.observation import perceive
from apollonius.rollout import Games, Player, fresh_player
from apollonius.solve.foresight import ResponsePolicy

ORDER = 10.0
"""How much more the differences between a state's actions count than their mean: they are what is chosen by."""


_PLANS = ((10, 1, NUM_ACTIONS), (10, 2, 3))
"""Of near-sighted and far-sighted attackers: steps for which an action is held, how many holds they look ahead, and how
many plans they go on from: a second and two, in a game with steps of 0.1 s."""


def start_distillation(
    plan: Plan, schools: Sequence[School], key: PRNGKeyArray, network: Network | None = None
) -> TrainState:
    """The state before the first step. The key is consumed.

    Args:
        schools: in each of the arenas; of one shape.
        network: the one to go on from; None starts from random weights.
    """
    network_key, start_key, train_key = jax.random.split(key, 3)
    game, games, role = schools[0].game, plan.learner.games, _config(plan).side
    learner = first_learner(plan, role, network_key, network)
    asked = jax.eval_shape(lambda states, key: situations(game, states, key), _starts(game, games, key), key)
    block = len(asked.steps)
    rows, size = max(1, plan.learner.replay_capacity // block) * block, learner.network.observation.size

    def nothing() -> Int[Array, ""]:
        return jnp.zeros((), jnp.int32)

    def player(role: Role) -> Player:
        return fresh_player(jnp.zeros(games, jnp.int32), jnp.zeros(games, jnp.uint32), NONE)

    lessons = Lessons(jnp.zeros((rows, size)), jnp.zeros((rows, NUM_ACTIONS)), nothing(), nothing())
    keys = [start_key, *(jax.random.fold_in(start_key, number) for number in range(1, len(schools)))]
    drawn = [_starts(school.game, games, key) for school, key in zip(schools, keys, strict=True)]
    states = jax.tree.map(lambda *leaves: jnp.stack(leaves), *drawn)
    begun = Games(states, ROLES.map(player))
    return TrainState(begun, {role: LearnerState(learner, lessons)}, train_key, nothing(), nothing(), nothing())


def distillation(
    plan: Plan, state: TrainState, schools: Sequence[School], done: int = 0
) -> Iterator[tuple[TrainState, Metrics]]:
    """The stage chunk by chunk; each state is consumed by the next one.

    Args:
        state: before the next chunk.
        schools: in each of the arenas, which take turns.
        done: chunks done before.
    """
    for chunk in range(done, plan.chunks):
        number = chunk % len(schools)
        state, metrics = _play_and_learn(plan, state, schools[number], np.int32(number))
        yield state, metrics


@partial(jax.jit, static_argnames="games")
def _starts(game: Game, games: int, key: PRNGKeyArray) -> GameState:
    return fresh_starts(game, games, key)


@partial(jax.jit, static_argnames="plan", donate_argnames="state")
def _play_and_learn(
    plan: Plan, state: TrainState, school: School, number: Int[Array, ""]
) -> tuple[TrainState, Metrics]:
    """One chunk of the stage, in the arena of this number: its games go on where they were."""

    def one_round(state: TrainState, _: None) -> tuple[TrainState, Metrics]:
        return _round(plan, state, school)

    every = state.games.state
    here = jax.tree.map(lambda leaf: leaf[number], every)
    state, metrics = jax.lax.scan(
        one_round, replace(state, games=replace(state.games, state=here)), None, plan.iterations_per_chunk
    )
    after = jax.tree.map(lambda leaf, new: leaf.at[number].set(new), every, state.games.state)
    state = replace(state, games=replace(state.games, state=after))
    return state, jax.tree.map(lambda leaf: jnp.sum(leaf, axis=0), metrics)


def _round(plan: Plan, state: TrainState, school: School) -> tuple[TrainState, Metrics]:
    """The teacher is asked, every game goes on for some steps, the student is fitted."""
    config, game = _config(plan), school.game
    role, side = config.side, state.learners[config.side]
    key = jax.random.fold_in(state.key, state.iterations)
    ask_key, play_key, start_key, learn_key = jax.random.split(key, 4)
    learner, lessons = side.learner, side.buffer
    assert isinstance(learner, dqn.DQNLearner)
    assert isinstance(lessons, Lessons)
    network = learner.network
    asked = situations(game, state.games.state, ask_key)
    _, seen = perceive(network.observation, game, asked, role)
    lessons = lessons.add(seen, school.teacher.worths(game, asked, role))

    after, outcome = _play(plan, network, state.games.state, school, play_key)
    ended = outcome != Outcome.ONGOING
    fresh = fresh_starts(game, plan.learner.games, start_key)
    states = jax.tree.map(lambda new, old: jnp.where(ended, new, old), fresh, after)

    env_steps = state.env_steps + plan.learner.env_steps_per_iteration
    learner, loss = _fit(plan, learner, lessons, env_steps, learn_key)
    after = TrainState(
        games=Games(states, state.games.sides),
        learners={role: LearnerState(learner, lessons)},
        key=state.key,
        iterations=state.iterations + 1,
        env_steps=env_steps,
        episodes=state.episodes + jnp.sum(ended, dtype=jnp.int32),
    )
    nothing = jnp.zeros(())
    return after, Metrics(
        outcomes=jnp.stack([jnp.sum(ended & (outcome == one), dtype=jnp.int32) for one in Outcome]),
        returns=BySide(nothing, nothing),
        losses=BySide.of(role, loss, nothing),
        updates=jnp.asarray(config.updates, jnp.int32),
    )


def _play(
    plan: Plan, network: QNetwork, states: GameState, school: School, key: PRNGKeyArray
) -> tuple[GameState, Int[Array, " games"]]:
    """All games some steps on; one that is over stays where it ended."""
    config, game, games = _config(plan), school.game, plan.learner.games
    role, steps = config.side, plan.learner.steps_per_iteration
    explore_key, action_key, plan_key, bits_key = jax.random.split(key, 4)
    student = greedy(network)
    explores = jax.random.bernoulli(explore_key, plan.stage.epsilon[role], (games,))
    at_random = jax.random.randint(action_key, (games,), 0, NUM_ACTIONS)
    shares = _shares(config, games, len(school.opponents))

    def acts(policy: AbstractPolicy, states: GameState, side: Role, bits: UInt32[Array, " games"]) -> Array:
        """Return a player's actions; those with a memory are asked as at the start of a game."""
        read, rows = perceive(policy.observation, game, states, side)
        memory = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (*bits.shape, *jnp.shape(leaf))), policy.memory)
        return act_in_rows(policy, read, rows, memory, bits)[0]

    def part(states: GameState, number: int) -> GameState:
        first = sum(shares[:number])
        return jax.tree.map(lambda leaf: leaf[first : first + shares[number]], states)

    # Those who look ahead decide once, and hold their action.
    held = []
    for number, foresight in enumerate(_PLANS, len(school.opponents)):
        attacker = ResponsePolicy(school.table.zero_sum_game, school.table.table, student, *foresight)
        mine = part(states, number)
        bits = jax.random.bits(jax.random.fold_in(plan_key, number), mine.steps.shape, jnp.uint32)
        held.append(acts(attacker, mine, role.other, bits))

    def one_step(
        carry: tuple[GameState, Int[Array, " games"]], bits: UInt32[Array, "2 games"]
    ) -> tuple[tuple[GameState, Int[Array, " games"]], None]:
        before, outcome = carry
        best = acts(student, before, role, bits[0])
        own = jnp.where(explores, at_random, best)
        theirs = []
        for number, opponent in enumerate(school.opponents):
            rows = part(before, number)
            first = sum(shares[:number])
            theirs.append(acts(opponent, rows, role.other, bits[1, first : first + shares[number]]))
        other = jnp.concatenate([*theirs, *held])

        def stepped(state: GameState, own: Action, other: Action) -> tuple[GameState, Int[Array, ""]]:
            step = game.step(state, *BySide.of(role, own, other).pair)
            return step.state, step.outcome

        after, now = jax.vmap(stepped)(before, own, other)
        ongoing: Bool[Array, " games"] = outcome == Outcome.ONGOING
        states = jax.tree.map(lambda new, old: jnp.where(ongoing, new, old), after, before)
        return (states, jnp.where(ongoing, now, outcome)), None

    bits = jax.random.bits(bits_key, (steps, 2, games), jnp.uint32)
    begun = states, jnp.full((games,), int(Outcome.ONGOING), jnp.int32)
    return jax.lax.scan(one_step, begun, bits)[0]


def _fit(
    plan: Plan, learner: dqn.DQNLearner, lessons: Lessons, env_steps: Int[Array, ""], key: PRNGKeyArray
) -> tuple[dqn.DQNLearner, Scalar]:
    """Some updates from what the teacher has said; their losses, added up."""
    config, learning = _config(plan), plan.learner
    rate = linear(learning.learning_rate, learning.final_learning_rate, config.env_steps, env_steps)

    def update(learner: dqn.DQNLearner, key: PRNGKeyArray) -> tuple[dqn.DQNLearner, Scalar]:
        rows = jax.random.randint(key, (learning.batch,), 0, lessons.filled)
        asked = lessons.observation[rows], lessons.worths[rows]
        value, gradient = eqx.filter_value_and_grad(_error)(learner.network, *asked)
        return dqn.step(learner, gradient, rate, learning.averaging), value

    learner, losses = jax.lax.scan(update, learner, jax.random.split(key, config.updates))
    return learner, jnp.sum(losses)


def _error(network: QNetwork, observation: Float[Array, "batch size"], worths: Float[Array, "batch 9"]) -> Scalar:
    """Mean squared error of the differences between a state's actions, and of their mean."""
    wrong = network.batch(observation) - worths
    mean = jnp.mean(wrong, axis=1)
    return ORDER * jnp.mean(jnp.sum((wrong - mean[:, None]) ** 2, axis=1)) + jnp.mean(mean**2)


def _shares(config: DistillationConfig, games: int, opponents: int) -> list[int]:
    """How many games each opponent plays, and each kind of attacker."""
    left = games - config.near_sighted - config.far_sighted
    equal = [left // opponents + (number < left % opponents) for number in range(opponents)]
    return [*equal, config.near_sighted, config.far_sighted]


def _config(plan: Plan) -> DistillationConfig:
    assert isinstance(plan.stage, DistillationConfig)
    return plan.stage
