"""Movers in what networks read: rays, clearances after braking, and what is hidden."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.charting import with_chart
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.movers import Movers
from apollonius.game.timetable import Shuttle
from apollonius.game.types import MoverMotion, MoverStates, Role
from apollonius.observe.egocentric import EGOCENTRIC, ROOM
from apollonius.observe.surroundings import FORESIGHT, MoversInView, distance_to_capsule
from apollonius.observe.view import look
from tests.acting import state

RAYS, BRAKING = slice(23, 55), slice(-9, None)
BODY = Unicycle(radius=0.2)
KEEP, FULL = 4, 7


def game_with(*shuttles):
    """An empty hall with discs; where they are and how they move is said by `seen`."""
    movers = Movers(tuple(Shuttle(((8.0, 8.0), (9.0, 8.0)), **shuttle) for shuttle in shuttles))
    return with_chart(Game(arena=Arena(), pursuer=BODY, movers=movers))


def seen(pursuer, *places, in_sight=None, **shuttle):
    """Return the pursuer's view of movers with x, y, vx, vy each; of one that is hidden without any."""
    if not places:
        return seen(pursuer, (9.0, 1.0, 0.0, 0.0), in_sight=[False], **shuttle)
    game = game_with(*[shuttle] * len(places))
    x, y, vx, vy = jnp.asarray(places, jnp.float32).reshape(-1, 4).T
    nothing = jnp.zeros(0)
    movers = MoverStates(MoverMotion(x, y, vx, vy), jnp.zeros(len(x)), nothing, nothing, jnp.zeros(0, jnp.uint32))
    now = replace(state(pursuer, (1.0, 9.0, 0.0, 0.0)), movers=movers)
    view = look(game, now, Role.PURSUER)
    if in_sight is None:
        return view
    return replace(view, movers=replace(view.movers, in_sight=jnp.asarray(in_sight)))


observe = jax.jit(EGOCENTRIC)


def ranges(view):
    """Return how far the body can go in the 32 directions [m]."""
    return 1 / np.asarray(observe(view))[RAYS] - 1


def test_distance_to_a_capsule_is_that_of_the_first_point_on_its_outline():
    """Against steps of 1 mm along each ray, from 2,000 random places outside."""
    keys = jax.random.split(jax.random.key(0), 4)
    starts = jax.random.uniform(keys[0], (2, 2000), minval=-2.0, maxval=2.0)
    axes = jax.random.uniform(keys[1], (2, 2000), minval=-1.5, maxval=1.5).at[:, :200].set(0.0)
    angles = jax.random.uniform(keys[2], (2000,), maxval=2 * jnp.pi)
    radii = jax.random.uniform(keys[3], (2000,), minval=0.05, maxval=0.5)
    directions = jnp.cos(angles), jnp.sin(angles)
    ours = np.asarray(jax.vmap(distance_to_capsule)(tuple(starts), tuple(axes), directions, radii))
    along = np.arange(0, 5, 1e-3)[:, None]
    x, y = (along * np.asarray(part) for part in directions)
    (sx, sy), (ax, ay) = np.asarray(starts), np.asarray(axes)
    share = np.clip(((x - sx) * ax + (y - sy) * ay) / np.maximum(ax**2 + ay**2, 1e-12), 0, 1)
    inside = np.hypot(x - sx - share * ax, y - sy - share * ay) < np.asarray(radii)
    first = np.where(inside.any(axis=0), along[np.argmax(inside, axis=0), 0], np.inf)
    outside, grazes = ~inside[0], inside.sum(axis=0) < 60
    meets = outside & np.isfinite(first)
    assert meets.sum() > 200
    np.testing.assert_allclose(ours[meets & ~grazes], first[meets & ~grazes], atol=1.1e-3)
    assert np.isinf(ours[outside & np.isinf(first)]).mean() > 0.99, "but for grazes between two steps"
    assert np.isinf(ours[~outside]).all()


@pytest.mark.parametrize(("vx", "gap"), [(0.0, 2.0), (-0.8, 2.0 - 0.8 * FORESIGHT), (0.8, 2.0)])
def test_ray_ends_at_a_mover_or_where_it_comes_to(vx, gap):
    view = seen((2.0, 5.0, 0.0, 0.0), (4.0 + 0.2 + 0.25, 5.0, vx, 0.0))
    assert ranges(view)[0] == pytest.approx(gap, abs=1e-3)
    alone = ranges(replace(view, movers=None))
    assert ranges(view)[4:29] == pytest.approx(alone[4:29]), "at its sides it sees none"
    assert ranges(seen((2.0, 5.0, 0.0, math.pi / 2), (4.45, 5.0, vx, 0.0)))[24] == pytest.approx(gap, abs=1e-3)


def test_ray_ends_at_the_way_of_a_mover_that_crosses():
    """It is 2 m to the left of the ray, and would be on it after 0.8 s; a slower one would not."""
    pursuer, far = (2.0, 5.0, 0.0, 0.0), seen((2.0, 5.0, 0.0, 0.0))
    crossing, slow = seen(pursuer, (4.0, 7.0, 0.0, -2.5)), seen(pursuer, (4.0, 7.0, 0.0, -1.0))
    assert ranges(crossing)[0] == pytest.approx(2.0 - 0.45, abs=1e-3)
    assert ranges(slow)[0] == pytest.approx(ranges(far)[0])


def test_hidden_movers_are_not_observed():
    hidden = seen((2.0, 5.0, 1.0, 0.0), (3.0, 5.0, 0.0, 0.0), (3.0, 6.0, 0.0, 0.0), in_sight=[False, True])
    only = seen((2.0, 5.0, 1.0, 0.0), (3.0, 6.0, 0.0, 0.0))
    np.testing.assert_array_equal(observe(hidden), observe(only))
    assert (np.asarray(observe(seen((2.0, 5.0, 1.0, 0.0), (3.0, 5.0, 0.0, 0.0)))) != np.asarray(observe(only))).any()


def test_action_leaves_the_clearance_from_movers_that_keep_their_velocities():
    """At 1.2 m/s the robot cannot stop or turn aside within 1 m: one that stands there bars all actions, one that
    leaves bars none, and one that will be there when the robot comes bars straight braking."""
    pursuer = (2.0, 5.0, 1.2, 0.0)
    stands, leaves, comes = (
        np.asarray(observe(seen(pursuer, place)))[BRAKING]
        for place in ((3.0, 5.0, 0.0, 0.0), (3.0, 5.0, 0.0, 2.5), (3.0, 7.5, 0.0, -2.5))
    )
    assert (stands < 0).all()
    assert (leaves == 1).all()
    assert comes.min() < 0


def test_movers_do_not_count_where_the_robot_rests():
    """It is walked into; an action that drives off towards the mover leaves no room."""
    numbers = np.asarray(observe(seen((2.0, 5.0, 0.0, 0.0), (2.47, 5.0, 0.0, 0.0))))[BRAKING]
    assert numbers[KEEP] == 1
    assert numbers[FULL] * ROOM == pytest.approx(0.02 - 0.003, abs=2e-3)


def test_a_delay_lets_movers_come_nearer():
    view = seen((2.0, 5.0, 0.0, 0.0), (5.0, 5.0, -1.0, 0.0))
    later: MoversInView = replace(view.movers, age=0.5)
    assert float(later.clearance(jnp.float32(2.0), jnp.float32(5.0), 0.5)) == pytest.approx(3.0 - 1.0 - 0.25)
