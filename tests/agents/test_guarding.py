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

RATIOS = [0.5, 0.9, 1.0, 1.25]
aim = jax.jit(nearest_reach)


def place(evader, pursuer, ratio, goal):
    return np.array([float(number) for number in aim(*(tuple(map(jnp.float32, p)) for p in (evader, pursuer)),
                                                     jnp.float32(ratio), tuple(map(jnp.float32, goal)))])  # fmt: skip


def situations(seed, count):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        evader, pursuer, goal = rng.uniform(0, 10, (3, 2))
        if np.linalg.norm(evader - pursuer) > 0.5:
            yield evader, pursuer, goal


@pytest.mark.parametrize("ratio", RATIOS)
def test_it_is_the_nearest_of_all_places_that_the_evader_is_first_at(ratio):
    """By a search over a fine grid, far beyond the robots."""
    axis = np.linspace(-20, 30, 1001)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1)
    reached = []
    for evader, pursuer, goal in situations(0, 14):
        to_evader, to_pursuer, to_goal = (np.linalg.norm(grid - one, axis=-1) for one in (evader, pursuer, goal))
        first = to_evader < ratio * to_pursuer
        x, y = place(evader, pursuer, ratio, goal)
        assert np.hypot(x - goal[0], y - goal[1]) == pytest.approx(to_goal[first].min(), abs=0.06)
        late = np.hypot(x - evader[0], y - evader[1]) - ratio * np.hypot(x - pursuer[0], y - pursuer[1])
        reached.append(np.allclose([x, y], goal, atol=1e-4))
        assert late < 1e-3 if reached[-1] else abs(late) < 2e-3 * (1 + np.hypot(x, y))
    assert 1 < sum(reached) < len(reached)


@pytest.mark.parametrize("ratio", [0.5, 0.9, 1.0])
def test_a_pursuer_that_heads_for_it_lets_the_evader_come_no_nearer_wherever_it_goes(ratio):
    """Simple motion in small steps, to the capture: the evader at random, straight at the goal, or the best it can."""
    rng, dt = np.random.default_rng(1), 0.01
    for evader, pursuer, goal in situations(2, 5):
        promised = np.linalg.norm(place(evader, pursuer, ratio, goal) - goal)
        if promised < 0.5:
            continue
        for how in ("random", "straight", "best"):
            e, p, heading = evader.copy(), pursuer.copy(), rng.uniform(-np.pi, np.pi)
            nearest = np.linalg.norm(e - goal)
            for _ in range(1500):
                target = place(e, p, ratio, goal)
                heading += rng.normal(0, 0.2)
                ways = {
                    "random": np.array([np.cos(heading), np.sin(heading)]),
                    "straight": goal - e,
                    "best": target - e,
                }
                e = e + ratio * dt * ways[how] / max(np.linalg.norm(ways[how]), 1e-9)
                way = target - p
                p = p + dt * way / max(np.linalg.norm(way), 1e-9)
                nearest = min(nearest, np.linalg.norm(e - goal))
                if np.linalg.norm(e - p) < 0.05:
                    break
            assert nearest > promised - 0.1, how
            if how == "best":
                assert np.linalg.norm(e - p) < 0.05
                assert nearest == pytest.approx(promised, abs=0.15)


def test_who_aims_there_guards_better_than_who_heads_for_the_evader():
    game = make_game("territory")
    evader = find_player("territory", Role.EVADER, game).policy
    lost = {}
    for name in ("territory", "pure-pursuit"):
        result = play_match(a_match(game, find_player(name, Role.PURSUER, game).policy, evader, 400, seed=0))
        lost[name] = result.outcomes["territory_reached"] / 400
        own = result.outcomes["pursuer_hit_obstacle"] + result.outcomes["pursuer_out_of_range"]
        assert result.evader_win_rate == pytest.approx(lost[name] + own / 400)
    assert 0.05 < lost["territory"] < lost["pure-pursuit"] - 0.05


def test_the_evader_begins_outside():
    game = make_game("territory")
    starts = jax.vmap(game.reset)(jax.random.split(jax.random.key(0), 200))
    away = np.hypot(starts.evader.x - 5.0, starts.evader.y - 5.0)
    assert away.min() >= 1.0 + game.starts.separation
    assert np.hypot(starts.pursuer.x - 5.0, starts.pursuer.y - 5.0).min() < 1
