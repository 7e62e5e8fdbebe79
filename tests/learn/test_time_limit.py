"""A time limit is not a loss where the rules truncate there, and is one where they say that the evader has won."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.pool import solo
from apollonius.game.by_side import BySide
from apollonius.game.game import reset_batch
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.learn import replay_buffer
from apollonius.play.rollout import begin, collect

GAMES, LIMIT, GAMMA = 8, 5, 0.9


def targets(profile, role):
    """Transitions of games in which nobody moves until the time limit, as Q-learning is given them."""
    game = replace(make_game(profile), max_steps=LIMIT)
    still, bits = BySide(solo(Still()), solo(Still())), jnp.zeros((2, GAMES), jnp.uint32)
    starts = reset_batch(game, jax.random.key(0), GAMES)
    rows = jax.tree.map(lambda leaf: leaf[None], starts)
    _, played = collect(game, still, begin(starts, still, bits), rows, jax.random.key(1), 4 * LIMIT)
    part = played.sides[role]
    assert set(np.unique(played.outcome[LIMIT - 1 :: LIMIT])) == {Outcome.NO_RESULT}
    memory = replay_buffer.add(
        replay_buffer.init(4 * LIMIT, GAMES, part.observation.shape[-1], replay_buffer.DISCRETE),
        replay_buffer.Row(
            part.observation, part.action, part.reward, part.next_observation, played.terminated, played.truncated
        ),
    )
    return replay_buffer.sample(memory, jax.random.key(2), 200, LIMIT, LIMIT, GAMMA)


@pytest.mark.parametrize("role", Role)
def test_in_a_truncated_game_the_value_goes_on_at_the_time_limit(role):
    batch = targets("paper", role)
    assert batch.discount.min() >= GAMMA**LIMIT * 0.999
    assert len(np.unique(batch.discount.round(5))) == LIMIT, "windows of one to five steps"
    np.testing.assert_allclose(batch.reward, 0, atol=1e-4)  # nobody came nearer, nobody is paid or punished


@pytest.mark.parametrize(("role", "paid"), [(Role.PURSUER, -1), (Role.EVADER, 1)])
def test_where_the_time_limit_wins_for_the_evader_the_game_is_over_there(role, paid):
    batch = targets("zero-sum", role)
    assert batch.discount.tolist() == [0] * 200
    steps = np.log(np.abs(batch.reward)) / np.log(GAMMA)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-3)
    assert set(np.sign(batch.reward)) == {paid}
