"""What a side remembers of opponents that it does not see, and the belief, which never loses the truth."""

import functools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.pool import solo
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.game.by_side import BySide
from apollonius.game.chart import COARSE
from apollonius.game.game import reset_batch
from apollonius.game.presets import in_teams
from apollonius.game.sensing import Noise, Sensing, Sensors
from apollonius.game.types import ROLES, Role
from apollonius.observe import belief, tracking
from apollonius.observe.observation import WHOLE, perceive
from apollonius.play.rollout import begin, collect, reset_where_done, step_games
from tests.acting import robot

LIDAR = Sensors(line_of_sight=True, range=4.0)
ROUGH = Sensors(
    line_of_sight=True, range=6.0, field_of_view=2.5, noise=Noise(0.1, 0.1, 0.05), own_noise=Noise(0.1, 0.1, 0.05),
    drop_out=0.2, delay=3,
)  # fmt: skip


def sensing(name, sensors, pursuers=1, evaders=1):
    return charted(replace(in_teams(find_game(name), pursuers, evaders), sensors=Sensing(sensors, sensors)))


def holds(chart, cells, place):
    """Whether a belief holds the cell of a place."""
    return cells.ravel()[chart.nearest_cell(place.x, place.y)]


@functools.partial(jax.jit, static_argnames=("games", "steps"))
def played(game, players, key, games, steps):
    """Games that begin again when they end: by step whether the beliefs hold the truth in all, and their shares."""
    start_key, key = jax.random.split(key)
    starts = reset_batch(game, start_key, games)
    first = begin(game, starts, players, jnp.zeros((2, games), jnp.uint32))

    def one(games_, key):
        bits = jax.random.bits(key, (2, games))
        after, transition = step_games(game, players, games_, bits, observes=False)
        known = ROLES.map(
            lambda role: jax.vmap(lambda track, state: tracking.believed(game, track, state, role))(
                after.sides[role].track, games_.state
            )
        )
        fresh = begin(game, starts, players, bits)
        held = known.map(lambda state: state.sight.belief)
        truths = ROLES.map(
            lambda role: [
                jnp.all(jax.vmap(functools.partial(holds, game.arena.chart))(held[role], opponent) | ~active)
                for opponent, active in zip(
                    games_.state.robots[role.other], games_.state.active[role.other], strict=True
                )
            ]
        )
        return jax.vmap(reset_where_done)(transition.ended, fresh, after), (truths, held.map(jnp.mean))

    return jax.lax.scan(one, first, jax.random.split(key, steps))[1]


@pytest.mark.parametrize(
    ("name", "sensors", "evader", "size", "games"),
    [
        ("blocks", LIDAR, "random", (2, 2), 20),
        pytest.param("office", LIDAR, "flee-aware", (1, 1), 1000, marks=pytest.mark.slow),
        pytest.param("maze", ROUGH, "flee-aware", (1, 1), 1000, marks=pytest.mark.slow),
        pytest.param("examples/dodecahedron.toml", LIDAR, "random", (1, 1), 500, marks=pytest.mark.slow),
    ],
)
def test_a_belief_never_loses_the_truth(name, sensors, evader, size, games):
    """Every opponent in play is in a cell of the belief, in every state; and the belief is worth having."""
    game = sensing(name, sensors, *size)
    players = BySide(
        solo(find_player("intercept", Role.PURSUER, game).policy), solo(find_player(evader, Role.EVADER, game).policy)
    )
    truths, shares = played(game, players, jax.random.key(0), games, 200)
    assert all(bool(jnp.all(truth)) for side in truths for truth in side)
    assert max(float(jnp.mean(share)) for share in shares) < 0.95 * float(jnp.mean(game.arena.chart.links > 0))


def test_a_belief_spreads_as_fast_as_an_opponent_at_most_by_a_cell():
    """In the open: cells within reach are in it after a time, and none that is further than cells and slack allow."""
    chart = charted(find_game("one-large")).arena.chart
    cell, reach = 10 / COARSE, 0.12
    credit = belief.at(chart, robot(1.5, 1.5), jnp.float32(0.0))
    for _ in range(20):
        credit = belief.moved(chart, credit, jnp.float32(reach))
    middles = (np.arange(COARSE) + 0.5) * cell
    away = np.hypot(middles[None, :] - 1.5, middles[:, None] - 1.5)
    found, near = np.asarray(belief.where(credit)), (np.hypot(*np.meshgrid(middles - 5, middles - 5)) < 1.6)
    assert np.all(found[(away <= 20 * reach - cell) & ~near])
    assert not np.any(found[away > 20 * reach / 0.8 + 4 * cell])
    faster = belief.moved(chart, belief.at(chart, robot(1.5, 1.5), jnp.float32(0.0)), jnp.float32(20 * reach))
    assert np.all(np.asarray(belief.where(faster))[(away <= 20 * reach - cell) & ~near])


def test_cells_that_are_seen_are_cleared_and_those_behind_a_disc_are_not():
    game = sensing("one-large", LIDAR)
    chart, here = game.arena.chart, robot(3.0, 5.0, 0.0, 0.0)
    seen = np.asarray(belief.visible(chart, LIDAR, here))
    look = lambda x, y: seen[int(y / 10 * COARSE), int(x / 10 * COARSE)]  # noqa: E731
    assert look(3.0, 5.0)
    assert look(3.0, 8.5)
    assert not look(3.0, 9.5)  # out of range
    assert not look(6.5, 5.0)  # behind the disc
    assert not np.asarray(belief.visible(chart, replace(LIDAR, range=0.0), here)).any()
    upwards = np.asarray(belief.visible(chart, replace(LIDAR, field_of_view=1.0), robot(3.0, 5.0, 0.0, np.pi / 2)))
    assert upwards[int(0.7 * COARSE), int(0.3 * COARSE)]
    assert not upwards[: int(0.5 * COARSE)].any()
    assert not np.any(upwards & ~seen)


def test_sightings_are_remembered_with_their_age_and_delay():
    """An opponent that is hidden stays where it was seen last; with a delay all comes that much later."""
    for delay in (None, 2):
        game = replace(find_game("one-large"), sensors=Sensing(pursuer=Sensors(line_of_sight=True, delay=delay)))
        late = delay or 0
        state = game.reset(jax.random.key(0))
        pursuer, ages, places = robot(2.0, 5.0), [], []
        track = tracking.begin(game, state, Role.PURSUER)
        assert float(track.ages[0]) == tracking.NEVER
        for step in range(8):
            evader = robot(5.0, 7.5 - 0.05 * step) if step < 4 else robot(8.0, 5.0)
            state = replace(state, robots=BySide((pursuer,), (evader,)))
            track = tracking.follow(game, track, state, Role.PURSUER, jnp.uint32(step))
            known = tracking.believed(game, track, state, Role.PURSUER)
            ages.append(float(known.sight.ages[0]))
            places.append(float(known.evader.y))
        seen = [step - late for step in range(8)]
        expected = [tracking.NEVER if at < 0 else (0.1 * late if at < 4 else 0.1 * (late + at - 3)) for at in seen]
        assert ages == pytest.approx(expected, rel=1e-4)
        assert places == pytest.approx([5.0 if at < 0 else 7.5 - 0.05 * min(at, 3) for at in seen])
        assert tracking.begin(game, state, Role.EVADER) is None
        assert tracking.believed(game, None, state, Role.EVADER) is state


def test_nothing_of_an_unseen_opponent_reaches_a_player():
    """Two states that differ only in where the hidden evader is give the pursuer the same view."""
    game = sensing("one-large", LIDAR)
    seen = []
    for y in (4.8, 5.2):
        state = replace(game.reset(jax.random.key(0)), robots=BySide((robot(2.0, 5.0),), (robot(8.0, y, 0.3, 1.0),)))
        track = tracking.begin(game, state, Role.PURSUER)
        track = tracking.follow(game, track, state, Role.PURSUER, jnp.uint32(0))
        known = tracking.believed(game, track, state, Role.PURSUER)
        known = jax.tree.map(lambda leaf: leaf[None], known)
        view, rows = perceive(WHOLE, game, known, Role.PURSUER)
        seen.append(jax.vmap(view)(rows))
    for one, other in zip(*map(jax.tree.leaves, seen), strict=True):
        np.testing.assert_array_equal(one, other)


def test_with_sensors_that_limit_nothing_games_are_the_same_to_the_bit():
    """All players see, and do, what they do in the game without them."""
    game = find_game("paper")
    limitless = replace(game, sensors=Sensing(Sensors(), Sensors(line_of_sight=False, range=50.0, delay=0)))
    results = []
    for rules in (game, limitless):
        players = BySide(
            *(
                solo(find_player(name, role, rules).policy)
                for name, role in zip(("P_scratch", "E_scratch"), ROLES, strict=True)
            )
        )
        starts = jax.tree.map(lambda leaf: leaf[None], reset_batch(game, jax.random.key(1), 16))
        games = begin(rules, jax.tree.map(lambda leaf: leaf[0], starts), players, jnp.zeros((2, 16), jnp.uint32))
        results.append(jax.jit(collect, static_argnums=5)(rules, players, games, starts, jax.random.key(2), 60)[1])
    for one, other in zip(*map(jax.tree.leaves, results), strict=True):
        np.testing.assert_array_equal(one, other)
