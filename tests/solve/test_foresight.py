"""Plans of several holds against a known opponent: their worth is that of plain loops over the rules."""

from dataclasses import replace
from functools import partial
from itertools import product

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.chasing import PurePursuit
from apollonius.agents.fleeing import FleeAware
from apollonius.agents.greedy import EpsilonGreedy
from apollonius.agents.network import make_network
from apollonius.game.game import reset_batch
from apollonius.game.types import NUM_ACTIONS, Outcome, Role
from apollonius.observe.view import look
from apollonius.solve.foresight import ResponsePolicy
from apollonius.solve.grid import lanes_of, make_grid
from apollonius.solve.joint import interpolate
from apollonius.solve.motion import HORIZON
from apollonius.solve.zero_sum_game import make_zero_sum_game
from tests.acting import act
from tests.solve.small import BODY, MOVING, SMALL

GRID = make_grid(SMALL.arena, BODY, (3, 4, 2, 5))
HOLD, GAMES = 3, 6
TABLE = jax.random.uniform(jax.random.key(2), (GRID.size // lanes_of(GRID), GRID.size, lanes_of(GRID)), minval=-0.5)
VALUES = eqx.filter_jit(lambda player, *seen: player.action_values(*seen))
OPPONENTS = {
    Role.PURSUER: FleeAware.for_side(SMALL, Role.EVADER),
    Role.EVADER: PurePursuit.for_side(SMALL, Role.PURSUER),
}


def responder(role, holds, width=NUM_ACTIONS, opponent=None):
    zero_sum_game = make_zero_sum_game(SMALL, (GRID, GRID), 10, role, "win")
    return ResponsePolicy(zero_sum_game, TABLE, opponent or OPPONENTS[role], HOLD, holds, width)


@pytest.fixture(scope="module")
def starts():
    """Of moving robots close together, so that some plans end games."""
    close = replace(MOVING, starts=replace(MOVING.starts, separation=0.35))
    drawn = jax.jit(reset_batch, static_argnames="games")(close, jax.random.key(1), games=400)
    apart = np.hypot(drawn.pursuer.x - drawn.evader.x, drawn.pursuer.y - drawn.evader.y)
    nearest = np.argsort(apart)[:GAMES]
    return jax.tree.map(lambda leaf: leaf[nearest], drawn)


STEP = jax.jit(SMALL.step)
ANSWER = eqx.filter_jit(lambda player, state, role: act(player, look(SMALL, state, role), jnp.zeros((), jnp.uint32)))
BETWEEN = eqx.filter_jit(lambda own, other: interpolate(TABLE, (GRID, other), (GRID, own)))


def by_hand(role, holds, start):
    """What each first action is worth: every sequence of actions, step by step."""
    player = responder(role, holds)
    best = np.full(NUM_ACTIONS, -np.inf)
    for plan in product(range(NUM_ACTIONS), repeat=holds):
        state, outcome = start, Outcome.ONGOING
        for action in np.repeat(plan, HOLD):
            if outcome != Outcome.ONGOING:
                break
            answer = ANSWER(player.opponent, state, role.other)
            pair = (jnp.int32(action), answer) if role == Role.PURSUER else (answer, jnp.int32(action))
            after = STEP(state, *pair)
            state, outcome = after.state, Outcome(int(after.outcome))
        seconds = float(state.steps) * SMALL.dt
        own, other = (state.pursuer, state.evader) if role == Role.PURSUER else (state.evader, state.pursuer)
        if outcome == Outcome.ONGOING:
            here, there = jax.tree.map(lambda leaf: np.asarray(leaf)[None], (own, other))
            worth = float(BETWEEN(jax.tree.map(lambda leaf: leaf[None], here), there)[0, 0])
        else:
            worth = float(player.zero_sum_game.payoff_of(jnp.int32(outcome), jnp.float32(0)))
        best[plan[0]] = max(best[plan[0]], worth * np.exp(-seconds / HORIZON))
    return best


@pytest.mark.slow
@pytest.mark.parametrize("role", Role)
def test_two_holds_ahead_are_the_best_of_all_sequences(role, starts):
    own, other = responder(role, 2).zero_sum_game.pair(starts.pursuer, starts.evader)
    found = np.asarray(VALUES(responder(role, 2), own, other, jnp.zeros(GAMES, jnp.uint32)))
    expected = [by_hand(role, 2, jax.tree.map(lambda leaf, i=i: leaf[i], starts)) for i in range(GAMES)]
    np.testing.assert_allclose(found.T, expected, atol=1e-5)
    assert np.ptp(found) > 0.5, "some plans end the game"


def test_fewer_plans_are_worth_no_more_and_the_one_kept_is_worth_the_same(starts):
    own, other, bits = starts.pursuer, starts.evader, jnp.zeros(GAMES, jnp.uint32)
    every, few = (np.asarray(VALUES(responder(Role.PURSUER, 2, width), own, other, bits)) for width in (9, 2))
    kept = np.isfinite(few)
    assert (kept.sum(axis=0) == 2).all(), "two first actions were gone on from in every game"
    np.testing.assert_allclose(few[kept], every[kept], atol=1e-6)


def test_a_game_is_looked_at_as_if_it_were_alone(starts):
    """Also against chance, whose courses depend on the game's own bits and on nothing else."""
    chance = EpsilonGreedy(make_network("paper", 4, 1, jax.random.key(0)), jnp.asarray(0.5))
    player = responder(Role.PURSUER, 2, 3, chance)
    values = partial(VALUES, player)
    bits = jax.random.bits(jax.random.key(3), (GAMES,), jnp.uint32)
    together = np.asarray(values(starts.pursuer, starts.evader, bits))
    turned = jax.tree.map(lambda leaf: leaf[::-1], (starts.pursuer, starts.evader, bits))
    np.testing.assert_allclose(np.asarray(values(*turned))[:, ::-1], together, atol=1e-6)
    others = np.asarray(values(starts.pursuer, starts.evader, bits + 1))
    both = np.isfinite(others) & np.isfinite(together)
    assert np.abs(others[both] - together[both]).max() > 1e-4
