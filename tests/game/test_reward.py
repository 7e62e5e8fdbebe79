"""Both sides' pay (Eq. 8, 9 and the zero-sum profile) against numbers worked out by hand."""

import jax.numpy as jnp
import pytest

from apollonius.game.judge import fates
from apollonius.game.reward import Reward
from apollonius.game.types import Outcome


def paid(reward, outcome, before=2.0, after=1.9):
    """In a game of two, whose outcome says what came of both."""
    found = jnp.asarray(outcome)
    (pursuer,), (evader,) = reward(found, fates(found, None, None), [(jnp.float32(before), jnp.float32(after))])
    return float(pursuer), float(evader)


@pytest.mark.parametrize(
    ("before", "after", "pursuer", "evader"),
    [(2.0, 2.5, -1.0, 1.0), (4.0, 3.5, 1.0, 1.0), (3.0, 3.5, -1.0, -1.0), (2.5, 3.25, -1.5, 0.5)],
)
def test_beyond_the_zero_sum_part_the_evader_too_is_paid_for_coming_closer(before, after, pursuer, evader):
    """Two per metre, zero-sum within 3 m; the last step goes half a metre up to there and a quarter beyond."""
    reward = Reward(progress=2.0, zero_sum_within=3.0)
    assert paid(reward, Outcome.ONGOING, before, after) == pytest.approx((pursuer, evader))
    assert paid(reward, Outcome.CAPTURED, before, after) == (10, -10)
    assert paid(reward, Outcome.EVADER_HIT_OBSTACLE, before, after) == pytest.approx((pursuer, -10))
