"""How much controls change: against sums over traced games, for either kind of action."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import make_actor
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import solo
from apollonius.agents.squashed import SquashedGaussian
from apollonius.agents.uniform import Uniform
from apollonius.evaluate.match import begin, count, play_games, play_match, replay_game
from apollonius.evaluate.smoothness import mean_change
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.observe.paper import PAPER
from apollonius.playout import play_out
from tests.matches import a_match

GAME = make_game("one-large")
WILD = SquashedGaussian(make_actor("paper", 8, 1, jax.random.key(0)), jnp.asarray(1.0))


class Always(AbstractPolicy):
    """One and the same action."""

    action: int = eqx.field(static=True)

    observation = PAPER

    def __call__(self, observation, memory, bits):
        return jnp.asarray(self.action, jnp.int32), memory


def as_gears(actions):
    """Gears of discrete actions; others are their own."""
    return actions if actions.ndim == 3 else np.stack([actions // 3 - 1, actions % 3 - 1], axis=-1)


@pytest.mark.parametrize("evader", [Uniform(), WILD], ids=["discrete", "continuous"])
def test_changes_are_those_of_the_games_step_by_step(evader):
    """More games than slots, so that a game takes the place of another and begins with no change."""
    games = 6
    match = a_match(GAME, Uniform(), evader, games, seed=2)
    results = play_games(match, slots=2)
    total, changes = np.zeros((2, 2)), 0
    for index in range(games):
        gears = as_gears(np.asarray(replay_game(match, index).actions))
        total += np.abs(np.diff(gears, axis=0)).sum(axis=0)
        changes += len(gears) - 1
    np.testing.assert_allclose(mean_change(results), total / changes, rtol=1e-4)


def test_random_actions_change_as_chance_would_have_it_and_constant_ones_never():
    """Two of the gears -1, 0, 1 are on average 8 / 9 apart."""
    match = play_match(a_match(GAME, Uniform(), Always(7), 200, seed=0))
    assert match.pursuer_change == pytest.approx((8 / 9, 8 / 9), abs=0.02)
    assert match.evader_change == (0.0, 0.0)


def test_the_spread_of_capture_times_is_that_of_the_captured_games():
    match = a_match(GAME, Uniform(), Always(4), 400)
    results = play_games(match)
    steps = np.asarray(results.steps)[np.asarray(results.outcome) == 1]
    assert len(steps) > 1
    assert count(match, results).capture_steps_deviation == pytest.approx(np.std(steps))


def test_a_match_is_the_same_whether_it_is_watched_or_not():
    match = a_match(GAME, Uniform(), WILD, 30)
    starts, key = begin(match)
    bare = play_out(GAME, BySide(solo(Uniform()), solo(WILD)), starts, key, slots=8)
    watched = play_games(match, slots=8)
    assert bare.watched is None
    np.testing.assert_array_equal(bare.outcome, watched.outcome)
    np.testing.assert_array_equal(bare.steps, watched.steps)
