"""Regret: a pursuer beside the table's player, on the same starts."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.policy import AbstractContinuous, AbstractPolicy
from apollonius.errors import InvalidInput
from apollonius.evaluate.regret import measure_regret
from apollonius.game.types import Role
from apollonius.observe.encoded import ENCODED
from apollonius.solve.grid import make_grid
from apollonius.solve.reach import make_chase
from apollonius.solve.reference import reference_grid
from tests.solve.small import BODY, SMALL


class Reckless(AbstractPolicy):
    """Speeds ahead at the target where it sees it, through everything."""

    observation = ENCODED

    def __call__(self, observation, bits):
        ahead, left = observation[10], observation[11]
        turn = jnp.where(jnp.abs(left) < 0.1 * jnp.abs(ahead), 1, jnp.where(left > 0, 2, 0))
        return (jnp.where(ahead > 0, 6, 3) + turn).astype(jnp.int32)


class SmoothlyReckless(AbstractContinuous):
    """The same with gears: the further aside it sees the target, the harder it turns."""

    observation = ENCODED

    def __call__(self, observation, bits):
        ahead, left = observation[10], observation[11]
        return jnp.stack([jnp.where(ahead > 0, 1.0, 0.0), jnp.clip(4 * jnp.arctan2(left, ahead), -1.0, 1.0)])


@pytest.fixture(scope="module")
def chase():
    return make_chase(SMALL, make_grid(SMALL.arena, BODY, (31, 41, 5, 31)), reference_grid(SMALL, Role.PURSUER)[1])


@pytest.fixture(scope="module")
def reckless(chase):
    return measure_regret(chase, Reckless(), games=200, targets=2, seed=3)


def test_the_table_bounds_what_a_pursuer_can_do(reckless):
    assert (reckless.games, reckless.targets) == (200, 2)
    assert 0.2 < reckless.captured < reckless.ceiling
    assert reckless.ceiling >= 0.99
    assert reckless.captured_interval[0] < reckless.captured < reckless.captured_interval[1]
    assert reckless.mean_seconds > reckless.mean_seconds_table - SMALL.dt  # what a grid this coarse can lose
    assert -SMALL.dt <= reckless.median_regret < reckless.regret_99
    assert reckless.prediction_error < 0.05


@pytest.mark.slow
def test_a_pursuer_with_continuous_actions_is_held_to_the_same_table(chase, reckless):
    smooth = measure_regret(chase, SmoothlyReckless(), games=200, targets=2, seed=3)
    assert smooth.ceiling == reckless.ceiling
    assert 0.2 < smooth.captured < smooth.ceiling
    assert -SMALL.dt <= smooth.median_regret < smooth.regret_99


def test_the_worst_games_are_those_that_only_the_table_wins_then_the_slowest(reckless):
    lost = [game["outcome"] != "captured" for game in reckless.worst]
    assert lost == sorted(lost, reverse=True)
    assert any(lost)
    assert json.loads(json.dumps(reckless.to_dict()))["worst"] == reckless.worst
    x, y, v, _ = np.array([game["start"] for game in reckless.worst]).T
    assert np.all((x >= -1) & (x <= 2) & (y >= 0) & (y <= 4) & (v == 0))


@pytest.mark.slow
def test_who_never_captures_has_no_times(chase):
    regret = measure_regret(chase, Still(), games=20, targets=1, seed=0)
    assert regret.captured == 0
    assert regret.mean_seconds is regret.mean_seconds_table is regret.median_regret is regret.regret_99 is None


@pytest.mark.parametrize(
    ("games", "targets", "seed", "named"),
    [(10, 0, 0, "targets = 0"), (10, 3, 0, "games = 10"), (0, 1, 0, "games = 0"), (1, 1, -1, "seed = -1")],
)
def test_what_cannot_be_measured_is_refused(chase, games, targets, seed, named):
    with pytest.raises(InvalidInput, match=named):
        measure_regret(chase, Still(), games, targets, seed)
