"""The rules composed: against their NumPy twin, and what must hold in every game."""

import itertools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.presets import PRESETS, make_game, paper, zero_sum
from apollonius.game.reward import Reward
from apollonius.game.types import NUM_ACTIONS, GameState, Outcome, RobotState
from tests.oracle import numpy_game

CLEAR_CUT = 1e-4
"""Contacts closer to their threshold than this [m] may be decided either way in float32."""

step = jax.jit(Game.step)
step_each = jax.jit(jax.vmap(Game.step))
reset_many = jax.jit(reset_batch, static_argnames="games")


def float32(number):
    """The float64 that a float32 computation will see."""
    return float(np.float32(number))


def to_state(pursuer, evader, steps):
    robots = [RobotState(*jnp.asarray(robot, jnp.float32)) for robot in (pursuer, evader)]
    return GameState(*robots, jnp.asarray(steps))


def stacked(trees):
    return jax.tree.map(lambda *leaves: jnp.asarray(np.stack(leaves)), *trees)


def random_game(rng, profile):
    """A small, crowded game, so that every outcome is common."""

    def body():
        v_min, v_max = rng.uniform(-0.5, 0.5), rng.uniform(0.6, 3.0)
        return Unicycle(*map(float32, (v_min, v_max, rng.uniform(0.1, 3), rng.uniform(0.1, 3), rng.uniform(0, 0.3))))

    x_min, y_min = rng.uniform(-3, 3, 2)
    width, height = rng.uniform(3, 6, 2)
    places = zip(rng.uniform(x_min, x_min + width, 3), rng.uniform(y_min, y_min + height, 3), strict=True)
    game = Game(reward=Reward(profile, *map(float32, rng.uniform(1, 10, 3))))
    return replace(
        game,
        pursuer=body(),
        evader=body(),
        arena=Arena(
            *map(float32, (x_min, x_min + width, y_min, y_min + height)),
            discs=tuple(Disc(*map(float32, (x, y, rng.uniform(0.01, 0.2)))) for x, y in places),
        ),
        capture_distance=float32(rng.uniform(0.1, 1.0)),
        dt=float32(rng.uniform(0.05, 0.3)),
        max_steps=int(rng.integers(1, 20)),
    )


def random_robot(rng, game, body):
    arena = game.arena
    place = rng.uniform(arena.x_min, arena.x_max), rng.uniform(arena.y_min, arena.y_max)
    speed = rng.choice([body.v_min, body.v_max, rng.uniform(body.v_min, body.v_max)])
    return tuple(map(float32, (*place, np.clip(speed, body.v_min, body.v_max), rng.uniform(-np.pi, np.pi))))


@pytest.mark.parametrize("profile", ["paper", "zero-sum"])
def test_a_step_is_what_the_numpy_twin_says(profile):
    """4000 random arenas, robots, states and actions."""
    rng = np.random.default_rng(0)
    games = [random_game(rng, profile) for _ in range(4000)]
    states = [(random_robot(rng, g, g.pursuer), random_robot(rng, g, g.evader), int(rng.integers(18))) for g in games]
    actions = rng.integers(NUM_ACTIONS, size=(4000, 2))
    twins = [
        numpy_game.step(game, state, *pair) for game, state, pair in zip(games, states, actions.tolist(), strict=True)
    ]
    ours = step_each(stacked(games), stacked([to_state(*state) for state in states]), *jnp.asarray(actions).T)

    clear_cut = np.array([twin.margin > CLEAR_CUT for twin in twins])
    assert clear_cut.mean() > 0.99
    outcomes = np.array([Outcome[twin.outcome] for twin in twins])
    assert np.bincount(outcomes[clear_cut], minlength=len(Outcome)).min() > 10

    def same(values, name, where=clear_cut, atol=0.0):
        expected = np.array([getattr(twin, name) for twin in twins])
        np.testing.assert_allclose(np.asarray(values)[where], expected[where], rtol=0, atol=atol)

    np.testing.assert_array_equal(np.asarray(ours.outcome)[clear_cut], outcomes[clear_cut])
    same(ours.terminated, "terminated")
    same(ours.truncated, "truncated")
    same(ours.pursuer_reward, "pursuer_reward", atol=2e-5)
    same(ours.evader_reward, "evader_reward", atol=2e-5)
    same(ours.state.steps, "steps", where=...)
    for role in ("pursuer", "evader"):
        robot = getattr(ours.state, role)
        values = np.stack([robot.x, robot.y, robot.v, robot.heading], axis=-1)
        expected = np.array([getattr(twin, role) for twin in twins])
        difference = values - expected
        difference[:, 3] = (difference[:, 3] + np.pi) % (2 * np.pi) - np.pi
        np.testing.assert_allclose(difference, 0, atol=[2e-5, 2e-5, 2e-6, 2e-6] * np.ones_like(difference))


places = st.floats(0.0, 10.0, width=32)
robots = st.tuples(places, places, st.floats(0, 1.2, width=32).map(float), st.floats(-3.125, 3.125, width=32))
states = st.tuples(robots, robots, st.sampled_from([0, 998, 999]))
actions = st.integers(0, NUM_ACTIONS - 1)


@given(states, actions, actions, st.sampled_from([paper(), zero_sum()]))
def test_every_step_has_one_outcome_and_ends_at_most_once(state, pursuer_action, evader_action, game):
    after = step(game, to_state(*state), jnp.asarray(pursuer_action), jnp.asarray(evader_action))
    outcome = Outcome(int(after.outcome))
    assert not (after.terminated and after.truncated)
    assert (after.terminated or after.truncated) == (outcome != Outcome.ONGOING)
    assert after.truncated == (outcome == Outcome.NO_RESULT and game.reward.profile == "paper")
    assert after.state.steps == state[2] + 1


def mirrored_game(game):
    """East and west exchanged: x becomes 10 - x."""
    discs = tuple(replace(disc, x=10.0 - disc.x) for disc in game.arena.discs)
    return replace(game, arena=replace(game.arena, discs=discs))


def mirrored_robot(robot):
    x, y, v, heading = robot
    return 10.0 - x, y, v, np.pi - heading


def mirrored_action(action):
    """Left and right exchanged."""
    return 3 * (action // 3) + 2 - action % 3


@given(states, actions, actions)
def test_a_mirrored_arena_gives_the_mirrored_game(state, pursuer_action, evader_action):
    game = paper()
    twin = numpy_game.step(game, state, pursuer_action, evader_action)
    assume(twin.margin > CLEAR_CUT)
    mirrored = step(
        mirrored_game(game),
        to_state(*map(mirrored_robot, state[:2]), state[2]),
        *(jnp.asarray(mirrored_action(action)) for action in (pursuer_action, evader_action)),
    )
    assert Outcome(int(mirrored.outcome)).name == twin.outcome
    assert mirrored.pursuer_reward == pytest.approx(twin.pursuer_reward, abs=2e-5)
    for robot, original in ((mirrored.state.pursuer, twin.pursuer), (mirrored.state.evader, twin.evader)):
        x, y, v, heading = mirrored_robot(original)
        assert (robot.x, robot.y, robot.v) == pytest.approx((x, y, v), abs=2e-5)
        assert abs((robot.heading - heading + np.pi) % (2 * np.pi) - np.pi) < 2e-5


@jax.jit
def held(game, states, actions):
    """How each game ends, and when [s], if both sides hold their first action for 100 steps."""

    def play(state, pair):
        def one_step(carry, _):
            state, outcome = carry
            after = game.step(state, pair[0], pair[1])
            over = outcome != Outcome.ONGOING
            state = jax.tree.map(lambda old, new: jnp.where(over, old, new), state, after.state)
            return (state, jnp.where(over, outcome, after.outcome)), None

        (state, outcome), _ = jax.lax.scan(one_step, (state, jnp.asarray(Outcome.ONGOING)), length=200)
        return outcome, state.steps * game.dt

    return jax.vmap(play)(states, actions)


def test_halving_dt_changes_neither_outcome_nor_time_when_the_controls_are_held():
    """Among the games that stay the same when bodies and capture distance are a centimetre larger or smaller."""
    slow = Unicycle(radius=0.2)
    game = Game(slow, slow, paper().arena, capture_distance=0.6, max_steps=100)
    halved = replace(game, dt=game.dt / 2, max_steps=200)
    starts = reset_many(game, jax.random.key(0), 1000)
    pairs = jnp.asarray(np.random.default_rng(0).integers(NUM_ACTIONS, size=(1000, 2)))
    outcome, time = held(game, starts, pairs)
    outcome_halved, time_halved = held(halved, starts, pairs)

    clear_cut = np.full(1000, True)
    for body, reach in itertools.product((0.19, 0.21), (0.59, 0.61)):
        robot = Unicycle(radius=body)
        changed, _ = held(replace(game, pursuer=robot, evader=robot, capture_distance=reach), starts, pairs)
        clear_cut &= np.asarray(changed == outcome)
    assert clear_cut.mean() > 0.95
    assert len(set(np.asarray(outcome)[clear_cut])) >= 6
    np.testing.assert_array_equal(np.asarray(outcome_halved)[clear_cut], np.asarray(outcome)[clear_cut])
    assert np.abs(time - time_halved)[clear_cut].max() < game.dt + 1e-3


def test_other_physics_need_no_other_compilation():
    traces = []

    @jax.jit
    def counted(game, state):
        traces.append(game)
        return game.step(state, jnp.asarray(0), jnp.asarray(8)).outcome

    game, state = paper(), to_state((1, 1, 1, 0), (2, 2, 1, 0), 0)
    fast = Unicycle(v_max=3.0, u1_max=1.0, radius=0.1)
    moved = Arena(x_max=20.0, discs=(Disc(9.0, 9.0, 1.0), Disc(15.0, 4.0, 0.5), Disc(5.0, 7.5, 0.2)))
    for other in (
        game,
        replace(game, pursuer=fast, evader=fast),
        replace(game, arena=moved, dt=0.05, capture_distance=0.5, max_steps=50),
        replace(game, reward=Reward(capture=1.0, progress=0.5)),
    ):
        counted(other, state)
    assert len(traces) == 1


def test_a_sweep_over_speeds_is_a_vmap():
    game, speeds = Game(), jnp.asarray([0.4, 0.8, 1.2])
    state = to_state((1, 1, 0.4, 0), (9, 9, 0, 0), 0)

    def final_speed(v_max):
        swept = replace(game, pursuer=Unicycle(v_max=v_max, u1_max=10.0))
        return swept.step(state, jnp.asarray(7), jnp.asarray(4)).state.pursuer.v

    np.testing.assert_array_equal(jax.vmap(final_speed)(speeds), speeds)


@pytest.mark.parametrize(("profile", "terminated"), [("paper", False), ("zero-sum", True)])
def test_the_time_limit_truncates_unless_the_rules_score_it(profile, terminated):
    game = Game(reward=Reward(profile), max_steps=3)
    state, seen = to_state((1, 1, 0, 0), (9, 9, 0, 0), 0), []
    for _ in range(3):
        after = step(game, state, jnp.asarray(4), jnp.asarray(4))
        state = after.state
        seen.append((int(after.outcome), bool(after.terminated), bool(after.truncated)))
    ongoing = (Outcome.ONGOING, False, False)
    assert seen == [ongoing, ongoing, (Outcome.NO_RESULT, terminated, not terminated)]


def test_paper_is_table_1():
    game = paper()
    for robot in (game.pursuer, game.evader):
        assert (robot.v_min, robot.v_max, robot.u1_max, robot.u2_max, robot.radius) == (0, 1.2, 0.3, 0.8, 0)
    assert (game.arena.x_min, game.arena.x_max, game.arena.y_min, game.arena.y_max) == (0, 10, 0, 10)
    assert (game.capture_distance, game.dt, game.max_steps) == (0.3, 0.1, 1000)
    assert (game.reward.capture, game.reward.failure, game.reward.profile) == (10, 10, "paper")


@pytest.mark.parametrize(
    ("name", "discs"),
    [
        ("paper", [(3, 3, 0.5), (7, 4, 0.5), (5, 7.5, 0.5)]),
        ("four-small", [(2.5, 2.5, 0.3), (7.5, 2.5, 0.3), (2.5, 7.5, 0.3), (7.5, 7.5, 0.3)]),
        ("one-large", [(5, 5, 1)]),
        ("zero-sum", [(3, 3, 0.5), (7, 4, 0.5), (5, 7.5, 0.5)]),
    ],
)
def test_each_named_game_has_its_own_discs_and_is_otherwise_the_papers(name, discs):
    game = make_game(name)
    assert [(disc.x, disc.y, disc.radius) for disc in game.arena.discs] == discs
    assert game.reward.profile == ("zero-sum" if name == "zero-sum" else "paper")
    assert replace(game, arena=Arena(), reward=Reward()) == Game()


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ValueError, match="'chess'") as refusal:
        make_game("chess")
    assert all(name in str(refusal.value) for name in PRESETS)
