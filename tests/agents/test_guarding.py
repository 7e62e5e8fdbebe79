"""Guarding a territory: the solution in closed form against a search, and against every way that the evader may go."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.guarding import nearest_reach
from apollonius.catalogue import find_player
from apollonius.evaluate.match import play_match
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from tests.matches import a_match

RATIOS = [0.5, 1.0, 1.25]
aim = jax.jit(nearest_reach)


def place(evader, pursuer, ratio, goal):
    return np.array([float(number) for number in aim(*(tuple(map(jnp.float32, p)) for p in (evader, pursuer)),
                                                     jnp.float32(ratio), tuple(map(jnp.float32, goal)))])  # fmt: skip


def states(seed, count):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        evader, pursuer, goal = rng.uniform(0, 10, (3, 2))
        if np.linalg.norm(evader - pursuer) > 0.5:
            yield evader, pursuer, goal


@pytest.mark.parametrize("ratio", RATIOS)
def test_it_is_the_nearest_of_all_places_that_the_evader_is_first_at(ratio):
    """By a search over a fine grid, far beyond the robots."""
    axis = np.linspace(-20, 30, 501)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1)
    reached = []
    for evader, pursuer, goal in states(0, 14):
        to_evader, to_pursuer, to_goal = (np.linalg.norm(grid - one, axis=-1) for one in (evader, pursuer, goal))
        first = to_evader < ratio * to_pursuer
        x, y = place(evader, pursuer, ratio, goal)
        assert np.hypot(x - goal[0], y - goal[1]) == pytest.approx(to_goal[first].min(), abs=0.11)
        late = np.hypot(x - evader[0], y - evader[1]) - ratio * np.hypot(x - pursuer[0], y - pursuer[1])
        reached.append(np.allclose([x, y], goal, atol=1e-4))
        assert late < 1e-3 if reached[-1] else abs(late) < 2e-3 * (1 + np.hypot(x, y))
    assert 1 < sum(reached) < len(reached)


def test_who_aims_there_guards_better_than_who_heads_for_the_evader():
    game = make_game("territory")
    evader = find_player("territory", Role.EVADER, game).policy
    lost = {}
    for name in ("territory", "pure-pursuit"):
        result = play_match(a_match(game, find_player(name, Role.PURSUER, game).policy, evader, 100, seed=0))
        lost[name] = result.outcomes["territory_reached"] / 100
        own = result.outcomes["pursuer_hit_obstacle"] + result.outcomes["pursuer_out_of_range"]
        assert result.evader_win_rate == pytest.approx(lost[name] + own / 100)
    assert 0.05 < lost["territory"] < lost["pure-pursuit"] - 0.05
