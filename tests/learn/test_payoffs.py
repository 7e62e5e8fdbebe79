"""The empirical game between kept versions: who is played, how it is counted, what is drawn from it, who may stay."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from apollonius.game.game import reset_batch
from apollonius.game.types import Outcome, Role
from apollonius.learn import opponents, payoffs
from apollonius.learn.renewal import renew_opponents
from apollonius.learn.scheme import OpponentConfig
from apollonius.learn.self_play import start_self_play
from apollonius.observe.registry import observe
from tests.learn.test_opponents import archive_of, networks, plan_of
from tests.learn.tiny import CHUNK, GAME

GAMES = 24
CONFIG = OpponentConfig(scheme="psro", versions=4, seats=2, renewal=CHUNK, payoff_games=GAMES)
KEY = jax.random.key(5)


def by_hand(pursuer, evader):
    """The pursuer's share of wins, a step at a time, from the starts that all matches share."""
    state = reset_batch(GAME, jax.random.split(KEY)[0], GAMES)
    ended = np.full(GAMES, Outcome.ONGOING)

    @jax.jit
    @jax.vmap
    def step(state):
        players = ((pursuer, Role.PURSUER), (evader, Role.EVADER))
        values = [network(observe(GAME, state, role, "paper")) for network, role in players]
        return GAME.step(state, *[jnp.argmax(of_all).astype(jnp.int32) for of_all in values])

    for _ in range(GAME.max_steps):
        timestep = step(state)
        ended = np.where(ended == Outcome.ONGOING, timestep.outcome, ended)
        state = timestep.state
    return np.isin(ended, [Outcome.CAPTURED, Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE]).mean()


@pytest.fixture(scope="module")
def archives():
    """Of three pursuers and two evaders."""
    with jax.numpy_dtype_promotion("standard"):
        return archive_of(3, CONFIG), archive_of(2, CONFIG, seed=7)


play = jax.jit(lambda before, archives, key: payoffs.play_missing(before, GAME, *archives, GAMES, key))


@pytest.fixture(scope="module")
def table(archives):
    return play(payoffs.nothing_played(4), archives, KEY)


def test_a_payoff_is_the_share_of_games_that_the_pursuer_wins(archives, table):
    pairs = [(row, column) for row in range(3) for column in range(2)]
    expected = [
        by_hand(*(opponents.version(archive, jnp.asarray(at)) for archive, at in zip(archives, pair, strict=True)))
        for pair in pairs
    ]
    assert len(set(expected)) > 2
    np.testing.assert_allclose([table[pair] for pair in pairs], expected, rtol=1e-6)


def test_versions_that_are_not_there_do_not_play(table):
    assert np.isnan(table).tolist() == [[False, False, True, True]] * 3 + [[True] * 4]


def test_nobody_plays_twice(archives, table):
    known = table.at[1, 1].set(0.123)
    np.testing.assert_array_equal(play(known, archives, KEY), known)
    np.testing.assert_array_equal(play(known.at[2, 0].set(jnp.nan), archives, KEY), known)


@pytest.mark.parametrize("scheme", ["psro", "psro-hedge"])
def test_seats_follow_the_solution_of_the_empirical_game(scheme):
    """Three versions in rock, paper, scissors that pays more for rock; the fourth is not there."""
    config = replace(CONFIG, scheme=scheme)
    known = [[0.5, 0.0, 1.0], [1.0, 0.5, 0.25], [0.0, 0.75, 0.5]]
    known = payoffs.nothing_played(4).at[:3, :3].set(jnp.asarray(known))
    chasing, fleeing = payoffs.meta_strategies(config, known, 3, 3)
    exact = np.array([0.2, 0.4, 0.4])
    np.testing.assert_allclose(chasing[:3], exact, atol=1e-6 if scheme == "psro" else 0.05)
    assert (chasing[3], fleeing[3]) == (0, 0)
    archive = archive_of(3, config)
    drawn = jax.jit(jax.vmap(lambda key: opponents.renew(archive, config, key, jnp.asarray(fleeing)).seats))(
        jax.random.split(jax.random.key(3), 5000)
    )
    seen = np.bincount(np.asarray(drawn).ravel(), minlength=4)
    assert seen[3] == 0
    assert chisquare(seen[:3], 10_000 * fleeing[:3] / fleeing.sum()).pvalue > 0.001
    assert chisquare(seen[:3], 10_000 * fleeing[[1, 0, 2]] / fleeing.sum()).pvalue < 1e-6


@pytest.mark.parametrize("scheme", ["psro", "psro-hedge"])
def test_the_pursuer_raises_the_payoff_and_the_evader_lowers_it(scheme):
    known = payoffs.nothing_played(4).at[:2, :2].set(jnp.asarray([[0.9, 0.6], [0.5, 0.1]]))
    chasing, fleeing = payoffs.meta_strategies(replace(CONFIG, scheme=scheme), known, 2, 2)
    assert chasing[0] > 0.8
    assert fleeing[1] > 0.8


def test_a_version_is_compared_with_the_one_before_it_on_those_who_were_there():
    table = jnp.asarray([[0.2, 0.4, 0.9], [0.3, 0.7, 0.1], [9.0, 9.0, 9.0]])
    assert float(payoffs.improvement(table, jnp.asarray(1), jnp.asarray(2))) == pytest.approx(0.2)
    assert float(payoffs.improvement(-table.T, jnp.asarray(2), jnp.asarray(2))) == pytest.approx((-0.5 + 0.6) / 2)


def test_a_version_that_is_as_good_as_its_predecessor_does_not_pass_the_gate():
    """Nothing was learned yet."""
    plan = plan_of(replace(CONFIG, scheme="gated", margin=0.05))
    state = start_self_play(plan, GAME, jax.random.key(0), None)
    state = renew_opponents(plan, GAME, replace(state, env_steps=jnp.asarray(CHUNK)))
    assert (int(state.pursuer.archive.count), int(state.evader.archive.count)) == (1, 1)
    assert np.isfinite(state.payoffs).sum() == 1


def test_a_better_version_passes_the_gate_and_a_worse_one_does_not():
    plan = plan_of(replace(CONFIG, scheme="gated", margin=0.05))

    def state_of(first, second):
        """An archive of one pursuer and one evader, and an evader at the gate."""
        state = start_self_play(plan, GAME, jax.random.key(0), None)
        pursuer, evader = (
            replace(
                side, archive=opponents.init(kept, plan.opponents), learner=replace(side.learner, average=candidate)
            )
            for side, kept, candidate in ((state.pursuer, chaser, chaser), (state.evader, first, second))
        )
        state = replace(state, pursuer=pursuer, evader=evader, env_steps=jnp.asarray(CHUNK))
        return jax.tree.map(jnp.copy, state)  # a renewal consumes what it is given

    (chaser,), evaders = networks(1), networks(4, seed=7)
    state = state_of(evaders[0], evaders[1])
    every_one = (state.pursuer.archive, archive_of(4, CONFIG, seed=7))
    losses = play(payoffs.nothing_played(4), every_one, jax.random.fold_in(state.key, 3))[0]
    best, worst = (evaders[int(at)] for at in (jnp.argmin(losses), jnp.argmax(losses)))
    assert losses.max() - losses.min() > 0.05
    for first, second, kept in ((worst, best, 2), (best, worst, 1)):
        state = renew_opponents(plan, GAME, state_of(first, second))
        assert int(state.evader.archive.count) == kept
        assert np.isfinite(state.payoffs).tolist()[0] == [True, kept == 2, False, False]
