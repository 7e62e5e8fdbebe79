"""The rules composed: against their NumPy twin, and what must hold in every game."""

import itertools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.presets import make_game, paper
from apollonius.game.reward import Reward
from apollonius.game.types import NUM_ACTIONS, GameState, Outcome, RobotState
from tests.oracle import numpy_game

CLEAR_CUT = 1e-4
"""Contacts closer to their threshold than this [m] may be decided either way in float32."""

step = jax.jit(Game.step)
step_each = jax.jit(jax.vmap(jax.vmap(Game.step, in_axes=(None, 0, 0, 0))))
reset_many = jax.jit(reset_batch, static_argnames="games")


def to_state(pursuer, evader, steps):
    robots = [RobotState(*jnp.asarray(robot, jnp.float32)) for robot in (pursuer, evader)]
    return GameState.of_two(*robots, jnp.asarray(steps))


def random_game(rng, profile):
    """A small, crowded game, so that every outcome is common. Its numbers are ones that float32 can hold."""

    def sample(low, high):
        return float(np.float32(rng.uniform(low, high)))

    def body():
        return Unicycle(sample(-0.5, 0.5), sample(0.6, 3.0), sample(0.1, 3.0), sample(0.1, 3.0), sample(0.0, 0.3))

    return Game(
        pursuer=body(),
        evader=body(),
        arena=Arena(
            sample(-3, -2), sample(2, 3), sample(-4, -2), sample(2, 4),
            discs=tuple(Disc(sample(-2, 2), sample(-2, 2), sample(0.01, 0.2)) for _ in range(3)),
            territory=Disc(sample(-2, 2), sample(-2, 2), sample(0.1, 0.4)) if profile == "zero-sum" else None,
        ),
        capture_distance=sample(0.1, 1.0),
        dt=sample(0.05, 0.3),
        max_steps=int(rng.integers(1, 20)),
        reward=Reward(profile, sample(1, 10), sample(1, 10), sample(1, 10)),
    )  # fmt: skip


def random_robots(rng, arena, body, count):
    """Robots [x, y, v, heading], one in three at either speed limit."""
    x, y = rng.uniform((arena.x_min, arena.y_min), (arena.x_max, arena.y_max), (count, 2)).T
    v = np.clip(rng.uniform(2 * body.v_min - body.v_max, 2 * body.v_max - body.v_min, count), body.v_min, body.v_max)
    return np.stack([x, y, v, rng.uniform(-np.pi, np.pi, count)], axis=-1).astype(np.float32)


@pytest.mark.parametrize("profile", ["paper", "zero-sum"])
def test_a_step_is_what_the_numpy_twin_says(profile):
    """100 random games, in each of them 40 random states and actions."""
    rng = np.random.default_rng(0)
    games = [random_game(rng, profile) for _ in range(100)]
    pursuers = np.array([random_robots(rng, game.arena, game.pursuer, 40) for game in games])
    evaders = np.array([random_robots(rng, game.arena, game.evader, 40) for game in games])
    steps, *actions = rng.integers([[[18]], [[NUM_ACTIONS]], [[NUM_ACTIONS]]], size=(3, 100, 40))

    states = jax.vmap(jax.vmap(to_state))(pursuers, evaders, steps)
    ours = step_each(jax.tree.map(lambda *leaves: jnp.stack(leaves), *games), states, *map(jnp.asarray, actions))

    twins = [
        numpy_game.step(game, (pursuer, evader, step), *pair)
        for game, *columns in zip(games, *(side.tolist() for side in (pursuers, evaders, steps, *actions)), strict=True)
        for pursuer, evader, step, *pair in zip(*columns, strict=True)
    ]
    clear_cut = np.array([twin.margin > CLEAR_CUT for twin in twins])
    outcomes = np.array([Outcome[twin.outcome] for twin in twins])
    assert clear_cut.mean() > 0.99
    possible = [outcome for outcome in Outcome if outcome != Outcome.TERRITORY_REACHED or profile == "zero-sum"]
    assert np.bincount(outcomes[clear_cut], minlength=len(Outcome))[possible].min() > 10

    def same(values, expected, atol=0.0):
        np.testing.assert_allclose(np.ravel(values)[clear_cut], np.array(expected)[clear_cut], rtol=0, atol=atol)

    same(ours.outcome, outcomes)
    same(ours.terminated, [twin.terminated for twin in twins])
    same(ours.truncated, [twin.truncated for twin in twins])
    same(ours.reward.pursuer, [twin.pursuer_reward for twin in twins], atol=2e-5)
    same(ours.reward.evader, [twin.evader_reward for twin in twins], atol=2e-5)
    same(ours.state.steps, [twin.steps for twin in twins])
    for role in ("pursuer", "evader"):
        robot, expected = getattr(ours.state, role), np.array([getattr(twin, role) for twin in twins])
        same(robot.x, expected[:, 0], atol=2e-6)
        same(robot.y, expected[:, 1], atol=2e-6)
        same(robot.v, expected[:, 2], atol=1e-6)
        same(np.exp(1j * np.asarray(robot.heading)), np.exp(1j * expected[:, 3]), atol=1e-6)


@jax.jit
def held(game, states, actions):
    """How each game ends, and when [s], if both sides hold their first action for 10 s."""

    def play(state, pair):
        def one_step(carry, _):
            state, outcome = carry
            after = game.step(state, pair[0], pair[1])
            over = outcome != Outcome.ONGOING
            state = jax.tree.map(lambda old, new: jnp.where(over, old, new), state, after.state)
            return (state, jnp.where(over, outcome, after.outcome)), None

        (state, outcome), _ = jax.lax.scan(one_step, (state, jnp.asarray(Outcome.ONGOING)), length=200)
        return outcome, state.steps.astype(jnp.float32) * game.dt

    return jax.vmap(play)(states, actions)


def test_halving_dt_changes_neither_outcome_nor_time_when_the_controls_are_held():
    """Among the games that stay the same when bodies and capture distance are a centimetre larger or smaller."""
    body = Unicycle(radius=0.2)
    game = Game(body, body, paper().arena, capture_distance=0.6, max_steps=100)
    halved = replace(game, dt=game.dt / 2, max_steps=200)
    starts = reset_many(game, jax.random.key(0), 1000)
    pairs = jnp.asarray(np.random.default_rng(0).integers(NUM_ACTIONS, size=(1000, 2)))
    outcome, time = held(game, starts, pairs)
    outcome_halved, time_halved = held(halved, starts, pairs)

    clear_cut = np.full(1000, True)
    for radius, reach in itertools.product((0.19, 0.21), (0.59, 0.61)):
        body = Unicycle(radius=radius)
        changed, _ = held(replace(game, pursuer=body, evader=body, capture_distance=reach), starts, pairs)
        clear_cut &= np.asarray(changed == outcome)
    assert clear_cut.mean() > 0.95
    assert len(set(np.asarray(outcome)[clear_cut])) >= 6
    np.testing.assert_array_equal(np.asarray(outcome_halved)[clear_cut], np.asarray(outcome)[clear_cut])
    assert np.abs(time - time_halved)[clear_cut].max() < game.dt + 1e-3


def test_paper_is_table_1():
    game = paper()
    for robot in (game.pursuer, game.evader):
        assert (robot.v_min, robot.v_max, robot.u1_max, robot.u2_max, robot.radius) == (0, 1.2, 0.3, 0.8, 0)
    assert (game.arena.x_min, game.arena.x_max, game.arena.y_min, game.arena.y_max) == (0, 10, 0, 10)
    assert (game.capture_distance, game.dt, game.max_steps) == (0.3, 0.1, 1000)
    assert (game.reward.capture, game.reward.failure, game.reward.progress, game.reward.profile) == (10, 10, 3, "paper")


def test_the_robots_of_the_robot_game_have_bodies_that_do_not_meet_before_the_capture():
    game = make_game("robot")
    assert game.pursuer == game.evader == Unicycle(radius=0.2)
    assert game.capture_distance > game.pursuer.radius + game.evader.radius
    assert replace(game, pursuer=Unicycle(), evader=Unicycle(), capture_distance=0.3) == make_game("paper")
