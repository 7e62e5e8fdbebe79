"""What is seen of teams: as in a game of two, and the other robots in order of their distance."""

import math

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.arenas.charting import charted
from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_teams
from apollonius.game.types import GameState, RobotState, RobotStatus, Role
from apollonius.observe.egocentric import EGOCENTRIC
from apollonius.observe.observation import perceive
from apollonius.observe.team import MATES, OF_A_ROBOT, OPPONENTS, TEAM
from apollonius.observe.view import look

WALL = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, 6.0), (4.0, 6.0)))
GAME = charted(Game(arena=Arena(0.0, 8.0, 0.0, 8.0, polygons=(WALL,))))
FIRST = EGOCENTRIC.size


TEAMS = in_teams(GAME, 5, 2)
OUT = (1.0, 1.0, 0.0, 0.0, 1)
"""A robot that fills up a team, out of play."""


@jax.jit
def look_together(states):
    return perceive(TEAM, TEAMS, states, Role.PURSUER)[1]


def seen(pursuers, evaders, out=()):
    """What each pursuer sees, of rows of (x, y, v, heading); those with these numbers, pursuers first, are out.

    All teams are filled up to the same size, so that few programs are compiled.
    """
    plays = [number not in out for number in range(len(pursuers) + len(evaders))]

    def filled(side, plays, size):
        rows = [(*one, 0 if in_play else 1) for one, in_play in zip(side, plays, strict=True)]
        return jnp.asarray(rows + [OUT] * (size - len(rows)), jnp.float32)

    sides = BySide(filled(pursuers, plays[: len(pursuers)], 5), filled(evaders, plays[len(pursuers) :], 2))
    robots = sides.map(lambda side: tuple(RobotState(*row[:4]) for row in side))
    status = sides.map(lambda side: tuple(jnp.where(row[4] > 0, RobotStatus.HIT_OBSTACLE, 0) for row in side))
    states = jax.tree.map(lambda leaf: leaf[None], GameState(robots, jnp.asarray(0), status=status))
    return np.asarray(look_together(states))[: len(pursuers)]


def slots(numbers):
    """The numbers of the robots besides the nearest opponent."""
    return numbers[FIRST:].reshape(MATES + OPPONENTS, OF_A_ROBOT)


ME, MATE, THIRD = (2.0, 4.0, 0.6, 0.0), (2.0, 6.0, 1.2, math.pi / 2), (3.0, 7.0, 0.0, math.pi)
PREY, OTHER = (6.0, 7.0, 0.5, 0.0), (7.0, 1.0, 1.0, 1.0)


def test_it_begins_with_egocentric_and_alone_is_nothing_else():
    numbers = seen([ME], [PREY])
    assert numbers.shape == (1, TEAM.size)
    me, prey = (RobotState(*jnp.asarray(one, jnp.float32)) for one in (ME, PREY))
    view = look(GAME, GameState.of_two(me, prey, jnp.asarray(0)), Role.PURSUER)
    np.testing.assert_allclose(numbers[0, :FIRST], jax.jit(EGOCENTRIC)(view), atol=1e-6)
    assert not numbers[:, FIRST:].any()


def test_a_mate_number_by_number():
    """The mate is 2 m to the left and drives away; the evader is behind the wall, 4.47 m and 4.12 m from them."""
    ours = seen([ME, MATE], [PREY])[0]
    there, mate, none = slots(ours)[0, 0], slots(ours)[0, 1:], slots(ours)[1:]
    assert there == 1
    assert not none.any()
    turned = math.atan2(-1.0, -4.0) - math.atan2(-3.0, -4.0)
    over = math.hypot(4.0, 1.0)
    np.testing.assert_allclose(mate[:4], [0.0, 1.0, 1 / 3, math.log(3) / 2], atol=1e-5)
    np.testing.assert_allclose(mate[4:6], [0.0, 1.0], atol=1e-5)
    np.testing.assert_allclose(mate[6:8], [math.cos(turned), math.sin(turned)], atol=1e-5)
    np.testing.assert_allclose(mate[8:11], [math.log(3) / 2, 1 / (1 + over), math.log1p(over) / 2], rtol=0.05)
    assert mate[11] > 0.6, "both come from the same side"


def test_an_opponent_between_two_pursuers_is_seen_as_such():
    pincer = seen([(1.0, 7.0, 0.0, 0.0), (7.0, 7.0, 0.0, 0.0)], [(4.0, 7.0, 0.0, 0.0)])
    assert (pincer[:, FIRST + 12] < 0.1).all()
    np.testing.assert_allclose(pincer[:, FIRST + 7], -1.0, atol=1e-5)


def test_robots_come_by_distance_whatever_their_numbers():
    """And of an opponent more the nearest is that of `egocentric`, the other one comes after the mates."""
    robots, others = ([ME, MATE, THIRD], [PREY, OTHER]), ([ME, THIRD, MATE], [OTHER, PREY])
    ours, again = (seen(*both) for both in (robots, others))
    np.testing.assert_allclose(ours[[0, 2, 1]], again, atol=1e-6)
    np.testing.assert_array_equal(slots(ours[0])[:, 0], [1, 1, 0, 1, 0])
    np.testing.assert_allclose(slots(ours[0])[0, 3], 1 / 3, atol=1e-5)
    np.testing.assert_allclose(slots(ours[0])[1, 3], 1 / (1 + math.hypot(1, 3)), atol=1e-5)


def test_who_is_out_is_not_seen():
    some = seen([ME, MATE, THIRD], [PREY, OTHER], out=(1, 4))[0]
    same = seen([ME, THIRD], [PREY])[0]
    np.testing.assert_allclose(some, same, atol=1e-6)


def test_of_many_mates_the_nearest_are_seen():
    crowd = [ME, *((2.0, 4.5 + away, 0.0, 0.0) for away in (2.5, 1.0, 2.0, 0.5))]
    distances = 1 / slots(seen(crowd, [PREY])[0])[:MATES, 3] - 1
    np.testing.assert_allclose(distances, [1.0, 1.5, 2.5], atol=1e-4)
