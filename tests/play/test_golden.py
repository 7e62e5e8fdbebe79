"""The rules are those that the golden games were recorded with; `python -m tests.golden.record` records them anew."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.types import Outcome
from apollonius.play.replay import as_rows, as_state, load_replay, play_actions

GOLDEN = sorted((Path(__file__).parents[1] / "golden").glob("*.json"))
LONGEST = 1000
"""All are played for as many steps, so that one compilation serves those of one game."""
TOLERANCE = 1e-5
"""Another processor may round a step otherwise [m, m/s, rad]."""


def play_again(replay, game):
    """States and outcomes of a replay's actions, as far as it goes."""
    actions = np.zeros((LONGEST, 2), np.int32)
    actions[: len(replay.actions)] = replay.actions
    states, outcomes = play_actions(game, as_state(jnp.asarray(replay.states[0]), jnp.asarray(0)), jnp.asarray(actions))
    return as_rows(states)[: len(replay.states)], np.asarray(outcomes)[: len(replay.actions)]


@pytest.mark.parametrize("path", GOLDEN, ids=lambda path: path.stem)
def test_golden_games_play_again(path):
    replay = load_replay(path)
    states, outcomes = play_again(replay, replay.game)
    np.testing.assert_allclose(states, replay.states, rtol=0, atol=TOLERANCE)
    assert outcomes.tolist() == [Outcome.ONGOING] * (len(outcomes) - 1) + [replay.outcome]
