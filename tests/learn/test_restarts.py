"""Which states are kept of lost games, and how many games begin in them."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.game import reset_batch
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.learn import restarts

GAME = make_game("paper")
LATE = jnp.arange(100, 106, dtype=jnp.int32)
STATES = eqx.tree_at(lambda states: states.steps, reset_batch(GAME, jax.random.key(0), 6), LATE)
ENDS = [(20, Outcome.CAPTURED), (14, Outcome.CAPTURED), (30, Outcome.PURSUER_HIT_OBSTACLE), (39, Outcome.NO_RESULT)]


def games_ending(*ends):
    """Games of 40 steps that end so, the others not; a game that begins again is captured in the last step."""
    outcome = np.full((40, 6), int(Outcome.ONGOING), np.int32)
    outcome[39] = int(Outcome.CAPTURED)
    outcome[39, len(ends) :] = int(Outcome.ONGOING)
    for column, (step, kind) in enumerate(ends):
        outcome[step, column] = int(kind)
    return jnp.asarray(outcome)


@pytest.mark.parametrize(
    ("game", "role", "expected"),
    [
        (GAME, Role.EVADER, [0]), (GAME, Role.PURSUER, [2]), (make_game("zero-sum"), Role.PURSUER, [2, 3]),
        (replace(GAME, dt=0.2), Role.EVADER, [0, 1]),
    ],
)  # fmt: skip
def test_states_of_games_lost_late_enough_are_kept(game, role, expected):
    lost = restarts.add_losses(restarts.empty_restarts(STATES), game, STATES, games_ending(*ENDS), role)
    assert int(lost.filled) == int(lost.head) == len(expected)
    np.testing.assert_array_equal(lost.rows.pursuer.x[: len(expected)], STATES.pursuer.x[jnp.array(expected)])
    assert (lost.rows.steps == 0).all(), "its time begins anew"


def test_latest_lost_states_replace_the_oldest(monkeypatch):
    monkeypatch.setattr(restarts, "_KEPT", 4)
    lost, captured = restarts.empty_restarts(STATES), [(20, Outcome.CAPTURED)] * 3
    for _ in range(2):
        lost = restarts.add_losses(lost, GAME, STATES, games_ending(*captured), Role.EVADER)
    assert (int(lost.filled), int(lost.head)) == (4, 2)
    np.testing.assert_array_equal(lost.rows.evader.y, STATES.evader.y[jnp.array([1, 2, 2, 0])])


@pytest.mark.parametrize(("filled", "share", "expected"), [(0, 1.0, 0.0), (2, 0.0, 0.0), (2, 0.3, 0.3), (2, 1.0, 1.0)])
def test_restart_fraction_of_games_begins_in_lost_states(filled, share, expected):
    captured = [(20, Outcome.CAPTURED)] * filled
    empty = restarts.empty_restarts(STATES)
    lost = restarts.add_losses(empty, GAME, STATES, games_ending(*captured), Role.EVADER)
    drawn = reset_batch(GAME, jax.random.key(1), 2000)
    starts = restarts.mix_in_restarts(share, drawn, lost, jax.random.key(2))
    again = np.isin(starts.pursuer.x, STATES.pursuer.x)
    assert again.mean() == pytest.approx(expected, abs=0.03)
    kept = eqx.filter(jax.tree.map(lambda new, old: new[~again] == old[~again], starts, drawn), eqx.is_array)
    assert all(np.all(leaf) for leaf in jax.tree.leaves(kept))
    if expected:
        assert set(np.asarray(starts.evader.y)[again]) == set(np.asarray(STATES.evader.y[:filled])), "each of them"
