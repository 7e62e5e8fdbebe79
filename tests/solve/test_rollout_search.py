"""Plans of several holds against a known opponent: values of plain loops over the rules, and games apart."""

from dataclasses import replace
from itertools import product

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.chasing import FleeAware, PurePursuit
from apollonius.agents.greedy import EpsilonGreedy
from apollonius.agents.network import make_network
from apollonius.game.game import reset_batch
from apollonius.game.types import NUM_ACTIONS, Outcome, Role
from apollonius.observe.view import look
from apollonius.solve.grid import lanes_of, make_grid
from apollonius.solve.joint import interpolate
from apollonius.solve.motion import HORIZON
from apollonius.solve.players import RolloutSearch
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


def search(role, holds, width=NUM_ACTIONS, opponent=None, hold=HOLD, game=SMALL):
    zero_sum_game = make_zero_sum_game(game, (GRID, GRID), 10, role)
    return RolloutSearch(zero_sum_game, TABLE, opponent or OPPONENTS[role], hold, holds, width)


@pytest.fixture(scope="module")
def starts():
    """Of moving robots close together, so that some plans end games."""
    close = replace(MOVING, starts=replace(MOVING.starts, separation=0.35))
    drawn = jax.jit(reset_batch, static_argnames="games")(close, jax.random.key(1), games=400)
    nearest = np.argsort(np.hypot(drawn.pursuer.x - drawn.evader.x, drawn.pursuer.y - drawn.evader.y))[:GAMES]
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
        for action in np.repeat(plan, HOLD):
            if outcome != Outcome.ONGOING:
                break
            answer = ANSWER(player.opponent, state, role.other)
            pair = (jnp.int32(action), answer) if role == Role.PURSUER else (answer, jnp.int32(action))
            after = STEP(state, *pair)
            state, outcome = after.state, Outcome(int(after.outcome))
        own, other = (state.pursuer, state.evader) if role == Role.PURSUER else (state.evader, state.pursuer)
        if outcome == Outcome.ONGOING:
            here, there = jax.tree.map(lambda leaf: np.asarray(leaf)[None], (own, other))
            value = float(BETWEEN(jax.tree.map(lambda leaf: leaf[None], here), there)[0, 0])
        else:
            value = float(player.zero_sum_game.payoff_of(jnp.int32(outcome), jnp.float32(0)))
        best[plan[0]] = max(best[plan[0]], value * np.exp(-float(state.steps) * SMALL.dt / HORIZON))
    return best


@pytest.mark.slow
@pytest.mark.parametrize("role", Role)
def test_two_holds_ahead_are_the_best_of_all_sequences(role, starts):
    own, other = search(role, 2).zero_sum_game.pair(starts.pursuer, starts.evader)
    found = np.asarray(VALUES(search(role, 2), own, other, jnp.zeros(GAMES, jnp.uint32)))
    expected = [by_hand(role, 2, jax.tree.map(lambda leaf, i=i: leaf[i], starts)) for i in range(GAMES)]
    np.testing.assert_allclose(found.T, expected, atol=1e-5)
    assert np.ptp(found) > 0.5, "some plans end the game"


def test_fewer_plans_have_the_same_values_and_games_do_not_mix(starts):
    """Against chance too, whose course depends on the game's own bits and on nothing else."""
    chance = EpsilonGreedy(make_network("paper", 4, 1, jax.random.key(0)), jnp.asarray(0.5))
    bits = jax.random.bits(jax.random.key(3), (GAMES,), jnp.uint32)
    every, few = (search(Role.PURSUER, 2, width, chance) for width in (9, 2))
    own, other = starts.pursuer, starts.evader
    values, kept_values = (np.asarray(VALUES(player, own, other, bits)) for player in (every, few))
    kept = np.isfinite(kept_values)
    assert (kept.sum(axis=0) == 2).all(), "two first actions were extended in every game"
    np.testing.assert_allclose(kept_values[kept], values[kept], atol=1e-6)
    turned = jax.tree.map(lambda leaf: leaf[::-1], (own, other, bits))
    np.testing.assert_allclose(np.asarray(VALUES(few, *turned))[:, ::-1], kept_values, atol=1e-6)
    assert np.abs(np.asarray(VALUES(every, own, other, bits + 1)) - values).max() > 1e-4
