"""The end of a game while actions are held, and its value, step by step as the rules' twin says."""

from dataclasses import replace
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.arena import Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Outcome, RobotState, Role
from apollonius.solve.grid import make_grid
from apollonius.solve.motion import HORIZON, motion_of
from apollonius.solve.zero_sum_game import first_events, make_zero_sum_game
from tests.oracle import numpy_teams
from tests.solve.small import SMALL

STEPS, GAMES = 8, 12
FAST = Unicycle(v_max=1.5, radius=0.1)
GAME = replace(
    SMALL, pursuer=FAST, evader=FAST, max_steps=10_000, arena=replace(SMALL.arena, territory=Disc(1.4, 3.0, 0.4))
)
ACTIONS = (0, 4, 7)


def robots():
    """Two robots in each of several games, close to each other, to the disc, to a wall, to the territory."""
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-0.9, 1.9, GAMES), rng.uniform(0.1, 3.9, GAMES)
    near = rng.uniform(0.4, 0.9, GAMES), rng.uniform(-np.pi, np.pi, GAMES)
    other = np.clip(x + near[0] * np.cos(near[1]), -0.9, 1.9), np.clip(y + near[0] * np.sin(near[1]), 0.1, 3.9)
    kinematics = [(rng.uniform(0.3, 1.5, GAMES), rng.uniform(-np.pi, np.pi, GAMES)) for _ in range(2)]
    places = (x, y), other
    return [np.stack([*place, *rest]).astype(np.float32) for place, rest in zip(places, kinematics, strict=True)]


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


def test_of_many_courses_the_first_event_of_each_pair_is_that_of_the_rules():
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
def test_the_value_of_an_outcome_is_the_winners_gain_discounted(role):
    grid = make_grid(GAME.arena, FAST, (3, 3, 2, 5))
    zero_sum_game = make_zero_sum_game(GAME, (grid, grid), STEPS, role)
    won = {"CAPTURED": 1, "EVADER_HIT_OBSTACLE": 1, "EVADER_OUT_OF_RANGE": 1, "TERRITORY_REACHED": -1, "NO_RESULT": 0}
    won |= {"PURSUER_HIT_OBSTACLE": -1, "PURSUER_OUT_OF_RANGE": -1, "BOTH_FAILED": 0, "ONGOING": 0}
    sign = 1 if role == Role.PURSUER else -1
    for name, value in won.items():
        found = zero_sum_game.payoff_of(jnp.int32(Outcome[name]), jnp.float32(1.5))
        assert float(found) == pytest.approx(sign * value * np.exp(-1.5 / HORIZON), abs=1e-6)
