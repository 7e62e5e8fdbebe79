"""A pursuer at rest does not stay where it is."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.agents.wrappers.departure import NEAR, Departing, departures
from apollonius.arenas.charting import with_chart
from apollonius.game.arena import Arena
from apollonius.game.car import Car
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.types import GameState, Role
from apollonius.observe.view import look
from tests.acting import robot

WALL = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, 6.0), (4.0, 6.0)))
GAME = with_chart(Game(Unicycle(radius=0.2), arena=Arena(0.0, 8.0, 0.0, 8.0, polygons=(WALL,))))
TURNS = {0, 2}
DRIVES = {6, 7, 8}


@jax.jit
def departure_mask(game, own):
    return departures(look(game, GameState.of_two(own, robot(6.0, 3.0), jnp.int32(0)), Role.PURSUER))


def allowed_actions(own, game=GAME):
    return set(np.flatnonzero(departure_mask(game, own)))


class Undecided(AbstractActionValuePolicy):
    """Turns to the heading 0 on the spot, and never comes to rest at it."""

    def values(self, seen):
        values = jnp.zeros(9).at[jnp.array([6, 7, 8])].set(-1.0)
        return values.at[jnp.where(seen.own.state.heading > 0, 0, 2)].set(1.0)


def test_robot_at_rest_in_the_open_may_only_depart_or_turn_to_its_path():
    assert allowed_actions(robot(2.0, 3.0, 0.03, 0.0)) == set(range(9))
    assert allowed_actions(robot(2.0, 3.0, 0.0, 0.0)) == DRIVES | {2}, "the end of the wall is to its left"
    assert allowed_actions(robot(2.0, 3.0, 0.0, np.pi)) == DRIVES | {0}
    assert allowed_actions(robot(2.0, 3.0, 0.0, 0.98)) == DRIVES


@pytest.mark.parametrize("clearance", [0.01, 0.04])
def test_robot_at_rest_near_a_wall_turns_one_way_until_its_path_is_free(clearance):
    x, free = 4.0 - 0.2 - clearance, []
    for heading in np.arange(-1.2, 1.8, 0.08):
        actions = allowed_actions(robot(x, 3.0, 0.0, heading))
        assert actions <= {2, 7}, "up to the end of the wall, on its left"
        free.append(actions == {7})
    assert free == sorted(free)
    assert 1 <= sum(free) <= 3


def test_speed_counted_as_rest_scales_with_the_time_step():
    slow = replace(GAME, dt=0.2)
    assert allowed_actions(robot(2.0, 3.0, 0.04, 0.0)) == set(range(9))
    assert allowed_actions(robot(2.0, 3.0, 0.02, 0.0), slow) == DRIVES | {2}


def test_departing_frees_a_robot_that_oscillates_on_the_spot():
    @jax.jit
    def course(own):
        def step(state, _):
            view = look(GAME, state, Role.PURSUER)
            return GAME.step(state, [jnp.argmax(player.values(view))], [jnp.int32(1)]).state, state.pursuer

        start = GameState.of_two(own, robot(6.0, 3.0), jnp.int32(0))
        return jax.lax.scan(step, start, length=300)[1]

    own = robot(4.0 - 0.2 - NEAR / 2, 3.0, 0.0, 0.3)
    player = Undecided()
    stays = course(own)
    assert float(stays.y[-1]) == 3.0
    assert len({round(float(heading), 3) for heading in stays.heading[-20:]}) == 2
    course.clear_cache()
    player = Departing(Undecided())
    leaves = course(own)
    clearances = np.asarray(jax.vmap(GAME.arena.clearance)(leaves.x, leaves.y)) - 0.2
    assert float(leaves.y[-1]) > 3.1
    assert clearances.min() > NEAR / 4


CARS = with_chart(Game(Car(radius=0.2), arena=GAME.arena))
RADIUS = float(CARS.pursuer.turning_radius)
BACKWARDS_AND_LEFT, FORWARDS_AND_LEFT = {0}, {8}


def before_wall(ahead, v=0.0):
    """A car that heads for the wall, whose end is on its left, with so much way ahead of its body."""
    return robot(4.0 - 0.2 - ahead, 3.0, v, 0.0)


def test_car_before_a_wall_drives_backwards_until_it_can_turn():
    assert allowed_actions(before_wall(0.9 * RADIUS), CARS) == BACKWARDS_AND_LEFT
    assert allowed_actions(before_wall(1.1 * RADIUS), CARS) == DRIVES
    assert allowed_actions(before_wall(1.1 * RADIUS, -0.1), CARS) == BACKWARDS_AND_LEFT
    assert allowed_actions(before_wall(1.6 * RADIUS, -0.1), CARS) == DRIVES
    assert allowed_actions(before_wall(0.5 * RADIUS, 0.1), CARS) == set(range(9))


def test_car_without_room_behind_drives_forwards_or_brakes():
    corridor = with_chart(Game(Car(radius=0.2), arena=Arena(0.0, 1.2, 0.0, 8.0)))
    evader = robot(0.6, 7.0)

    @jax.jit
    def allowed_in_corridor(own):
        return departures(look(corridor, GameState.of_two(own, evader, jnp.int32(0)), Role.PURSUER))

    def actions(x, v=0.0):
        return set(np.flatnonzero(allowed_in_corridor(robot(x, 3.0, v, 0.0))))

    assert actions(0.7) == BACKWARDS_AND_LEFT
    assert actions(0.5) == FORWARDS_AND_LEFT, "there is more way ahead"
    assert actions(0.24, -0.2) == DRIVES, "it brakes"


def test_car_that_cannot_reverse_drives_forwards():
    forwards_only = with_chart(replace(GAME, pursuer=Car(v_min=0.0, radius=0.2)))
    assert allowed_actions(before_wall(0.5 * RADIUS), forwards_only) == FORWARDS_AND_LEFT
