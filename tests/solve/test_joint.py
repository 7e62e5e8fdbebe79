"""The two-robot game on a grid and plans of several holds against brute force, events and payoffs as the twin says."""

from dataclasses import replace
from itertools import product

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.guidance import FleeAware, PurePursuit
from apollonius.agents.network import make_network
from apollonius.agents.trained import EpsilonGreedy, Greedy
from apollonius.game.arena import Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import reset_batch
from apollonius.game.types import NUM_ACTIONS, BySide, GameState, Outcome, RobotState, Role
from apollonius.io import limits
from apollonius.io.errors import InvalidInput
from apollonius.observe.view import look
from apollonius.solve.grid import lanes_of, make_grid
from apollonius.solve.joint import interpolate, make_duel, solve_duel, value_before_move
from apollonius.solve.motion import HORIZON, first_events, make_zero_sum_game, motion_of, payoff_of
from apollonius.solve.players import RolloutSearch, SaddlePolicy
from tests.acting import act
from tests.oracle import numpy_solver as oracle
from tests.oracle import numpy_teams
from tests.solve.small import BODY, CRAMPED, FEW, FEWER, HOLD, MOVING, SMALL, as_matrix


@pytest.fixture(scope="module")
def plain():
    """One of two alike robots in a cramped place, by plain loops; and captures, by both nodes and both actions."""
    robot = oracle.Robot(CRAMPED, FEWER, HOLD)
    steps = oracle.captures(CRAMPED, robot, robot)
    assert 0.01 < np.mean(np.isfinite(steps)) < 0.5
    return robot, steps


def zero_sum_game(game, role, counts, hold=HOLD):
    grids = (make_grid(game.arena, game.pursuer, counts), make_grid(game.arena, game.evader, counts))
    return make_zero_sum_game(game, grids, hold, role)


@pytest.mark.slow
@pytest.mark.parametrize("role", list(Role))
def test_joint_table_matches_brute_force(plain, role):
    """After its last sweep and one more; where nothing ends within a hold, a player has just that value."""
    (robot, captures), told, pursuing = plain, [], role == Role.PURSUER
    duel = make_duel(zero_sum_game(CRAMPED, role, FEWER))
    found = solve_duel(duel, told.append, tolerance=1e-2)
    assert found.residual <= 1e-2 < told[-2].residual
    steps = captures if pursuing else captures.transpose(1, 0, 3, 2)
    before, moved = oracle.value_before_move(robot, robot, pursuing, steps, found.sweeps, HORIZON)
    np.testing.assert_allclose(as_matrix(found.table).T, moved, atol=1e-6)
    np.testing.assert_allclose(as_matrix(value_before_move(duel, found.table)), before, atol=1e-6)
    assert np.ptp(moved) > 0.9
    assert len(np.unique(np.round(moved, 3))) > 20
    quiet = ~np.isfinite(steps).any(axis=(2, 3)) & robot.free.all(axis=0)[:, None] & robot.free.all(axis=0)
    pairs = tuple(nodes[:64] for nodes in np.nonzero(quiet))
    assert len(pairs[0]) > 20
    grid = duel.first.grid
    own, other = (jax.vmap(grid.node)(*map(jnp.asarray, np.unravel_index(nodes, grid.shape))) for nodes in pairs)
    states = jax.vmap(GameState.of_two)(*duel.zero_sum_game.pair(own, other), jnp.zeros(len(pairs[0]), jnp.int32))
    sure = SaddlePolicy(duel.zero_sum_game, found.table).best_value(states)
    np.testing.assert_allclose(sure, before[pairs], atol=1e-5)


def test_impossible_duels_are_refused(monkeypatch):
    with pytest.raises(InvalidInput, match=r"hold = 0.*at least 1"):
        zero_sum_game(SMALL, Role.PURSUER, FEW, hold=0)
    grids = make_grid(SMALL.arena, BODY, (4, 3, 2, 5)), make_grid(SMALL.arena, Unicycle(), (3, 4, 2, 5))
    with pytest.raises(InvalidInput, match=r"as many nodes along x and y as 3x4x2x5"):
        make_duel(make_zero_sum_game(SMALL, grids, HOLD, Role.PURSUER))
    monkeypatch.setattr(limits, "available_memory", lambda: 4096 * 1000)
    with pytest.raises(InvalidInput, match=r"grid = 5x7x3x6 needs .* GiB of memory and this machine has 0.0 GiB"):
        make_duel(zero_sum_game(SMALL, Role.PURSUER, (5, 7, 3, 6)))


STEPS, GAMES = 8, 12
FAST = Unicycle(v_max=1.5, radius=0.1)
GAME = replace(
    SMALL, pursuer=FAST, evader=FAST, max_steps=10_000, arena=replace(SMALL.arena, territory=Disc(1.4, 3.0, 0.4))
)
ACTIONS = (0, 4, 7)


def robots():
    """Two robots in each of several games, close to each other, to the disc, to a wall, to the territory."""
    rng = np.random.default_rng(3)
    low, high = [-0.9, 0.1, 0.3, -np.pi], [1.9, 3.9, 1.5, np.pi]
    one, other = rng.uniform(low, high, (2, GAMES, 4))
    near, angle = rng.uniform([0.4, -np.pi], [0.9, np.pi], (GAMES, 2)).T
    other[:, :2] = one[:, :2] + near[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return [np.clip(numbers, low, high).astype(np.float32).T for numbers in (one, other)]


def courses(role, numbers):
    """Along three actions in all games: leaves `[steps + 1, actions, games]`."""
    hold = motion_of(GAME, role, STEPS).hold
    every = jax.vmap(jax.vmap(hold, (0, None), -1), (None, 0), 1)
    return jax.jit(every)(jax.vmap(RobotState)(*map(jnp.asarray, numbers)), jnp.array(ACTIONS))


def expected_event(pursuer, evader, first, second):
    """The outcome's name and the step in which the rules' twin ends the game; ongoing after all steps otherwise."""
    sides = [[{"body": FAST, "place": tuple(map(float, one)), "status": "ACTIVE"}] for one in (pursuer, evader)]
    margin = np.inf
    for number in range(1, STEPS + 1):
        step = numpy_teams.step(GAME, *sides, number - 1, [first], [second])
        margin = min(margin, step.margin)
        if step.outcome != "ONGOING":
            return step.outcome, number, margin
        sides = step.pursuers, step.evaders
    return "ONGOING", STEPS, margin


def test_first_events_match_the_rules():
    pursuers, evaders = robots()
    both = [courses(role, numbers) for role, numbers in zip(Role, (pursuers, evaders), strict=True)]
    outcome, seconds = jax.jit(first_events)(GAME, *both)
    seen = set()
    for (a, first), (b, second), game in product(enumerate(ACTIONS), enumerate(ACTIONS), range(GAMES)):
        name, steps, margin = expected_event(pursuers[:, game], evaders[:, game], first, second)
        if margin > 1e-5:
            assert Outcome(int(outcome[a, b, game])).name == name
            assert float(seconds[a, b, game]) == pytest.approx(steps * GAME.dt)
            seen.add(name)
    assert len(seen) >= 6, seen
    assert "TERRITORY_REACHED" in seen


@pytest.mark.parametrize("role", Role)
def test_payoff_is_the_discounted_gain_of_the_winner(role):
    won = {"CAPTURED": 1, "EVADER_HIT_OBSTACLE": 1, "EVADER_OUT_OF_RANGE": 1, "TERRITORY_REACHED": -1, "NO_RESULT": 0}
    won |= {"PURSUER_HIT_OBSTACLE": -1, "PURSUER_OUT_OF_RANGE": -1, "BOTH_FAILED": 0, "ONGOING": 0}
    sign = 1 if role == Role.PURSUER else -1
    for name, value in won.items():
        found = payoff_of(role, jnp.int32(Outcome[name]), jnp.float32(1.5))
        assert float(found) == pytest.approx(sign * value * np.exp(-1.5 / HORIZON), abs=1e-6)


GRID = make_grid(SMALL.arena, BODY, (3, 4, 2, 5))
HELD, STARTED = 3, 6
TABLE = jax.random.uniform(jax.random.key(2), (GRID.size // lanes_of(GRID), GRID.size, lanes_of(GRID)), minval=-0.5)
VALUES = eqx.filter_jit(lambda player, *seen: player.action_values(*seen))
OPPONENTS = PurePursuit.for_side(SMALL, Role.PURSUER), FleeAware.for_side(SMALL, Role.EVADER)


def search(role, holds, width=NUM_ACTIONS, opponent=None):
    rules = zero_sum_game(SMALL, role, GRID.counts, hold=10)
    return RolloutSearch(rules, TABLE, opponent or OPPONENTS[role.other], HELD, holds, width)


@pytest.fixture(scope="module")
def starts():
    """Of moving robots close together, so that some plans end games."""
    close = replace(MOVING, starts=replace(MOVING.starts, separation=0.35))
    drawn = jax.jit(reset_batch, static_argnames="games")(close, jax.random.key(1), games=400)
    nearest = np.argsort(np.hypot(drawn.pursuer.x - drawn.evader.x, drawn.pursuer.y - drawn.evader.y))[:STARTED]
    return jax.tree.map(lambda leaf: leaf[nearest], drawn)


STEP = jax.jit(SMALL.step)
ANSWER = eqx.filter_jit(lambda player, state, role: act(player, look(SMALL, state, role), jnp.zeros((), jnp.uint32)))
BETWEEN = eqx.filter_jit(lambda own, other: interpolate(TABLE, (GRID, other), (GRID, own)))


def by_hand(role, holds, start):
    """The value of each first action: every sequence of actions, step by step."""
    player = search(role, holds)
    best = np.full(NUM_ACTIONS, -np.inf)
    for plan in product(range(NUM_ACTIONS), repeat=holds):
        state, outcome = start, Outcome.ONGOING
        for action in np.repeat(plan, HELD):
            if outcome != Outcome.ONGOING:
                break
            answer = ANSWER(player.opponent, state, role.other)
            after = STEP(state, *BySide.of(role, jnp.int32(action), answer))
            state, outcome = after.state, Outcome(int(after.outcome))
        own, other = BySide.of(role, state.pursuer, state.evader)
        if outcome == Outcome.ONGOING:
            here, there = jax.tree.map(lambda leaf: np.asarray(leaf)[None], (own, other))
            value = float(BETWEEN(jax.tree.map(lambda leaf: leaf[None], here), there)[0, 0])
        else:
            value = float(payoff_of(role, jnp.int32(outcome), jnp.float32(0)))
        best[plan[0]] = max(best[plan[0]], value * np.exp(-float(state.steps) * SMALL.dt / HORIZON))
    return best


@pytest.mark.slow
@pytest.mark.parametrize("role", Role)
def test_search_of_two_holds_matches_all_sequences(role, starts):
    own, other = search(role, 2).zero_sum_game.pair(starts.pursuer, starts.evader)
    found = np.asarray(VALUES(search(role, 2), own, other, jnp.zeros(STARTED, jnp.uint32)))
    expected = [by_hand(role, 2, jax.tree.map(lambda leaf, i=i: leaf[i], starts)) for i in range(STARTED)]
    np.testing.assert_allclose(found.T, expected, atol=1e-5)
    assert np.ptp(found) > 0.5, "some plans end the game"


@pytest.mark.slow
def test_narrow_search_keeps_the_values_and_games_do_not_mix(starts):
    """Against chance too, whose course depends on the game's own bits and on nothing else."""
    chance = EpsilonGreedy(Greedy(make_network("paper", 4, 1, jax.random.key(0))), jnp.asarray(0.5))
    bits = jax.random.bits(jax.random.key(3), (STARTED,), jnp.uint32)
    every, few = (search(Role.PURSUER, 2, width, chance) for width in (9, 2))
    own, other = starts.pursuer, starts.evader
    values, kept_values = (np.asarray(VALUES(player, own, other, bits)) for player in (every, few))
    kept = np.isfinite(kept_values)
    assert (kept.sum(axis=0) == 2).all(), "two first actions were extended in every game"
    np.testing.assert_allclose(kept_values[kept], values[kept], atol=1e-6)
    turned = jax.tree.map(lambda leaf: leaf[::-1], (own, other, bits))
    np.testing.assert_allclose(np.asarray(VALUES(few, *turned))[:, ::-1], kept_values, atol=1e-6)
    assert np.abs(np.asarray(VALUES(every, own, other, bits + 1)) - values).max() > 1e-4
