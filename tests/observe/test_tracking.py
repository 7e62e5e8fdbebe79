"""What a side remembers of opponents that it does not see, and the belief, which never loses the truth."""

import functools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import uniform_action
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import single_player
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.game.chart import COARSE
from apollonius.game.game import reset_batch
from apollonius.game.presets import in_teams
from apollonius.game.sensing import Noise, Sensing, Sensors
from apollonius.game.types import ROLES, BySide, Role, tree_where
from apollonius.observe import belief, tracking
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.observation import RAW_VIEW, observation_rows
from apollonius.play.rollout import collect, init_games, step_games
from tests.acting import identical, robot

LIDAR = Sensors(line_of_sight=True, range=4.0)
ROUGH = Sensors(
    line_of_sight=True, range=6.0, field_of_view=2.5, noise=Noise(0.1, 0.1, 0.05), own_noise=Noise(0.1, 0.1, 0.05),
    drop_out=0.2, delay=3,
)  # fmt: skip

update, believed = (jax.jit(one, static_argnames="role") for one in (tracking.sense_and_update, tracking.knowledge_of))


def sensing(name, sensors, pursuers=1, evaders=1):
    return with_chart(replace(in_teams(find_game(name), pursuers, evaders), sensors=Sensing(sensors, sensors)))


def cell(x, y):
    """The cell of a place in an arena of 10 by 10 m."""
    return int(y / 10 * COARSE), int(x / 10 * COARSE)


class Wanders(AbstractPolicy):
    """One that draws its actions and reads the whole view, so that its side has a belief."""

    def __call__(self, seen, memory, bits):
        return uniform_action(bits), memory


@functools.partial(jax.jit, static_argnames=("games", "steps"))
def play_beliefs(game, players, key, games, steps):
    """Games that begin again when they end: by step whether the beliefs hold the truth in all, and their shares."""
    start_key, key = jax.random.split(key)
    holds = jax.vmap(lambda cells, place: cells.ravel()[game.chart.nearest_cell(place.x, place.y)] >= 0)
    starts = reset_batch(game, start_key, games)
    first = init_games(game, starts, players, jnp.zeros((2, games), jnp.uint32))

    def one(games_, key):
        bits = jax.random.bits(key, (2, games))
        after, transition = step_games(game, players, games_, bits, with_obs=False)
        truths, shares = [], []
        for role in ROLES:
            believed = jax.vmap(lambda track, state, role=role: tracking.knowledge_of(game, track, state, role))
            held = believed(after.sides[role].track, games_.state).belief
            for opponent, active in zip(games_.state.robots[role.other], games_.state.active[role.other], strict=True):
                truths.append(jnp.all(holds(held, opponent) | ~active))
            shares.append(jnp.mean((held >= 0).astype(jnp.float32)))
        fresh = init_games(game, starts, players, bits)
        return jax.vmap(tree_where)(transition.ended, fresh, after), (truths, shares)

    return jax.lax.scan(one, first, jax.random.split(key, steps))[1]


@pytest.mark.parametrize(
    ("name", "sensors", "evader", "size", "games", "steps"),
    [
        ("blocks", LIDAR, "random", (2, 1), 8, 80),
        pytest.param("office", LIDAR, "flee-aware", (1, 1), 1000, 200, marks=pytest.mark.slow),
        pytest.param("maze", ROUGH, "flee-aware", (1, 1), 1000, 200, marks=pytest.mark.slow),
        pytest.param("examples/dodecahedron.toml", LIDAR, "random", (1, 1), 500, 200, marks=pytest.mark.slow),
    ],
)
def test_belief_always_contains_the_true_position(name, sensors, evader, size, games, steps):
    """Every opponent in play is in a cell of the belief, in every state; and the belief is worth having."""
    game = sensing(name, sensors, *size)
    flees = Wanders() if evader == "random" else find_player(evader, Role.EVADER, game).policy
    players = BySide(single_player(find_player("intercept", Role.PURSUER, game).policy), single_player(flees))
    truths, shares = play_beliefs(game, players, jax.random.key(0), games, steps)
    assert all(bool(jnp.all(truth)) for truth in truths)
    assert max(float(jnp.mean(share)) for share in shares) < 0.95 * float(jnp.mean(game.chart.links > 0))


def test_belief_spreads_at_the_speed_of_the_opponent_to_within_cells():
    """In the open: cells within reach are in it after a time, and none that is further than cells and slack allow."""
    chart = with_chart(find_game("one-large")).chart
    cell, reach = 10 / COARSE, 0.12
    start = belief.Belief(belief.localise(chart, robot(1.5, 1.5), jnp.float32(0.0)), jnp.zeros((COARSE, COARSE)))
    after, moved = start, jax.jit(belief.propagate)
    for _ in range(20):
        after = moved(chart, after, jnp.float32(reach), 0.1)
    middles = (np.arange(COARSE) + 0.5) * cell
    away = np.hypot(middles[None, :] - 1.5, middles[:, None] - 1.5)
    found, near = np.asarray(after.where) >= 0, (np.hypot(*np.meshgrid(middles - 5, middles - 5)) < 1.6)
    assert np.all(found[(away <= 20 * reach - cell) & ~near])
    assert not np.any(found[away > 20 * reach / 0.8 + 4 * cell])
    faster = moved(chart, start, jnp.float32(20 * reach), 2.0)
    for cells in map(np.asarray, (after.where, faster.where)):
        assert np.all(cells[(away <= 20 * reach - cell) & ~near] == pytest.approx(2.0))


def test_visible_cells_respect_range_field_of_view_and_obstacles():
    game = sensing("one-large", LIDAR)
    chart, here = game.chart, robot(3.0, 5.0, 0.0, 0.0)
    seen = np.asarray(belief.visible(chart, LIDAR, here))
    assert [seen[cell(*at)] for at in ((3.0, 5.0), (3.0, 8.5))] == [True, True]
    assert not seen[cell(3.0, 9.5)], "out of range"
    assert not seen[cell(6.5, 5.0)], "behind the disc"
    assert not np.asarray(belief.visible(chart, replace(LIDAR, range=0.0), here)).any()
    upwards = np.asarray(belief.visible(chart, replace(LIDAR, field_of_view=1.0), robot(3.0, 5.0, 0.0, np.pi / 2)))
    assert upwards[cell(3.0, 7.0)]
    assert not upwards[: int(0.5 * COARSE)].any()
    assert not np.any(upwards & ~seen)


def test_ray_of_a_direction_is_the_nearest_ray():
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, 500)
    place = np.arange(belief.RAYS) * (4 / belief.RAYS)
    rays = np.arctan2(1 - np.abs((place + 1) % 4 - 2), np.abs(place - 2) - 1)
    found = rays[np.asarray(belief._ray(*map(jnp.asarray, (3 * np.cos(angles), 3 * np.sin(angles)))))]
    apart = np.abs((found - angles + np.pi) % (2 * np.pi) - np.pi)
    assert np.max(apart) < 0.51 * np.max(np.diff(np.sort(rays)))


def test_track_keeps_the_last_sighting_with_its_age_and_delay():
    """An opponent that is hidden stays where it was seen last; with a delay all comes that much later."""
    for delay, late in ((None, 0), (2, 2)):
        game = replace(find_game("one-large"), sensors=Sensing(pursuer=Sensors(line_of_sight=True, delay=delay)))
        state = game.reset(jax.random.key(0))
        pursuer, ages, places = robot(2.0, 5.0), [], []
        track = tracking.init_track(game, state, Role.PURSUER)
        assert float(track.ages[0]) == tracking.NEVER
        for step in range(8):
            evader = robot(5.0, 7.5 - 0.05 * step) if step < 4 else robot(8.0, 5.0)
            state = replace(state, robots=BySide((pursuer,), (evader,)))
            track, known = update(game, Role.PURSUER, track, state, jnp.uint32(step))
            ages.append(float(known.ages[0]))
            places.append(float(known.robots.evader[0].y))
        seen = [step - late for step in range(8)]
        expected = [tracking.NEVER if at < 0 else 0.1 * max(at - 3, 0) for at in seen]
        assert ages == pytest.approx(expected, rel=1e-4)
        assert places == pytest.approx([5.0 if at < 0 else 7.5 - 0.05 * min(at, 3) for at in seen])
        assert tracking.init_track(game, state, Role.EVADER) is None
        _, known = update(game, Role.EVADER, None, state, jnp.uint32(0))
        assert identical(known, Knowledge.complete(state))


def test_delayed_sighting_is_extrapolated_to_the_present():
    game = replace(find_game("one-large"), sensors=Sensing(pursuer=Sensors(line_of_sight=True, delay=2)))
    state = game.reset(jax.random.key(0))
    track, places = tracking.init_track(game, state, Role.PURSUER), []
    for step in range(8):
        evader = robot(2.0 + 0.1 * step, 2.0, v=1.0) if step < 4 else robot(8.0, 5.0)
        state = replace(state, robots=BySide((robot(2.0, 5.0),), (evader,)))
        track, known = update(game, Role.PURSUER, track, state, jnp.uint32(step))
        places.append(float(known.robots.evader[0].x))
    assert places[2:] == pytest.approx([2.0 + 0.1 * min(step, 5) for step in range(2, 8)])


def look_around(game, places, evader):
    """What the pursuer knows after it has looked from several places: the track and its knowledge."""
    state = game.reset(jax.random.key(0))
    track = tracking.init_track(game, state, Role.PURSUER)
    for step, place in enumerate(places):
        state = replace(state, robots=BySide((place,), (evader,)), steps=jnp.int32(step))
        track, _ = update(game, Role.PURSUER, track, state, jnp.uint32(step))
    return track, believed(game, track, state, Role.PURSUER)


def test_track_counts_sightings_and_times_since_cells_were_seen():
    game = sensing("one-large", LIDAR)
    left, right = robot(2.0, 5.0), robot(8.0, 5.0)
    track, known = look_around(game, [left] * 3 + [right] * 4, robot(8.0, 7.0))
    times = np.asarray(track.belief.unseen)
    expected = {(2.0, 6.0): 0.4, (8.0, 6.0): 0.0, (5.0, 9.8): belief.NEVER}  # first: in the third of seven steps
    assert [times[cell(*at)] for at in expected] == pytest.approx(list(expected.values()))
    assert (int(track.sightings.first), int(track.sightings.steps)) == (3, 4)
    possible = np.asarray(known.belief) >= 0
    assert possible.sum() == 1, "of an evader in sight the place is known"
    never, _ = look_around(game, [left] * 3, robot(8.0, 7.0))
    assert (int(never.sightings.first), int(never.sightings.steps)) == (-1, 0)


def test_search_priority_grows_with_time_unseen_and_nearness():
    """By hand, and nothing where no opponent can be; the best is that of all cells."""
    chart = with_chart(find_game("one-large")).chart
    here = robot(1.1, 1.1)
    unseen = np.full((COARSE, COARSE), -1.0, np.float32)
    near, far, recent = (8, 8), (30, 30), (8, 9)
    unseen[near], unseen[far], unseen[recent] = 20.0, 40.0, 1.0
    worth = np.asarray(belief.search_priority(chart, jnp.asarray(unseen), here))
    lengths = np.asarray(chart.lengths_from(here.x, here.y))
    assert worth[near] == pytest.approx(20.0 / (lengths[near] + belief.NEAR))
    assert lengths[far] > np.hypot(30 - 4, 30 - 4) * 0.25
    assert np.all(worth[unseen < 0] < 0)
    assert np.argmax(worth) == 30 * COARSE + 30
    for near_age, far_age in ((20.0, 21.0), (1e3, 150.0)):  # of two long ago the nearer one
        unseen[near], unseen[far] = near_age, far_age
        assert np.argmax(belief.search_priority(chart, jnp.asarray(unseen), here)) == 8 * COARSE + 8


def test_view_is_independent_of_a_hidden_opponent():
    """Two states that differ only in where the hidden evader is give the pursuer the same view."""
    game = sensing("one-large", LIDAR)

    @jax.jit
    def seen(y):
        state = replace(game.reset(jax.random.key(0)), robots=BySide((robot(2.0, 5.0),), (robot(8.0, y, 0.3, 1.0),)))
        track = tracking.init_track(game, state, Role.PURSUER)
        _, known = tracking.sense_and_update(game, Role.PURSUER, track, state, jnp.uint32(0))
        view, rows = observation_rows(RAW_VIEW, game, jax.tree.map(lambda leaf: leaf[None], known), Role.PURSUER)
        return jax.vmap(view)(rows)

    assert identical(seen(4.8), seen(5.2))


def test_unlimited_sensors_leave_games_unchanged():
    """All players see, and do, what they do in the game without them; only a robot that the last step put out of play
    is not seen there any more.
    """
    game = find_game("one-large")
    limitless = replace(game, sensors=Sensing(Sensors(), Sensors(line_of_sight=False, range=50.0, delay=0)))
    first, results = reset_batch(game, jax.random.key(1), 16), []
    starts = jax.tree.map(lambda leaf: leaf[None], first)
    for rules in (game, limitless):
        named = zip(("pure-pursuit", "random"), ROLES, strict=True)
        players = BySide(*(single_player(find_player(name, role, rules).policy) for name, role in named))
        games = init_games(rules, first, players, jnp.zeros((2, 16), jnp.uint32))
        results.append(jax.jit(collect, static_argnums=5)(rules, players, games, starts, jax.random.key(2), 60)[1])
    goes_on = ~results[0].terminated[..., None]

    def until_the_end(transition):
        def hide(side):
            return replace(side, next_observation=jnp.where(goes_on, side.next_observation, 0.0))

        return replace(transition, sides=transition.sides.map(hide))

    assert identical(*map(until_the_end, results))
