"""What is seen of teams: as in a game of two, and the other robots in order of their distance."""

import functools
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

WALL = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, 6.0), (4.0, 6.0)))
GAME = charted(Game(arena=Arena(0.0, 8.0, 0.0, 8.0, polygons=(WALL,))))
FIRST = EGOCENTRIC.size


def state(pursuers, evaders, out=()):
    """A state from rows of (x, y, v, heading), in which the robots with these numbers, pursuers first, are out."""
    robots = BySide(pursuers, evaders).map(
        lambda side: tuple(RobotState(*jnp.asarray(one, jnp.float32)) for one in side)
    )
    status = [RobotStatus.HIT_OBSTACLE if number in out else RobotStatus.ACTIVE for number in range(len(pursuers) + 9)]
    numbers = [jnp.asarray(int(one), jnp.int32) for one in status]
    sides = BySide(tuple(numbers[: len(pursuers)]), tuple(numbers[len(pursuers) : len(pursuers) + len(evaders)]))
    return GameState(robots, jnp.asarray(0), status=sides if len(pursuers) + len(evaders) > 2 else None)


@functools.partial(jax.jit, static_argnames=("role", "observation"))
def look_together(game, states, role, observation):
    return perceive(observation, game, states, role)[1]


def seen(pursuers, evaders, out=(), role=Role.PURSUER, observation=TEAM):
    """What each robot of a side sees."""
    game = in_teams(GAME, len(pursuers), len(evaders)) if len(pursuers) + len(evaders) > 2 else GAME
    states = jax.tree.map(lambda leaf: leaf[None], state(pursuers, evaders, out))
    return np.asarray(look_together(game, states, role, observation))


def slots(numbers):
    """The numbers of the robots besides the nearest opponent."""
    return numbers[FIRST:].reshape(MATES + OPPONENTS, OF_A_ROBOT)


ME, MATE, THIRD = (2.0, 4.0, 0.6, 0.0), (2.0, 6.0, 1.2, math.pi / 2), (3.0, 7.0, 0.0, math.pi)
PREY, OTHER = (6.0, 7.0, 0.5, 0.0), (7.0, 1.0, 1.0, 1.0)


def test_in_a_game_of_two_it_is_egocentric_and_nothing_else():
    numbers = seen([ME], [PREY])
    assert numbers.shape == (1, TEAM.size)
    np.testing.assert_array_equal(numbers[:, :FIRST], seen([ME], [PREY], observation=EGOCENTRIC))
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
    theirs, theirs_again = (seen(*both, role=Role.EVADER) for both in (robots, others))
    np.testing.assert_allclose(ours[[0, 2, 1]], again, atol=1e-6)
    np.testing.assert_allclose(theirs[[1, 0]], theirs_again, atol=1e-6)
    np.testing.assert_array_equal(slots(ours[0])[:, 0], [1, 1, 0, 1, 0])
    np.testing.assert_allclose(slots(ours[0])[0, 3], 1 / 3, atol=1e-5)
    np.testing.assert_allclose(slots(ours[0])[1, 3], 1 / (1 + math.hypot(1, 3)), atol=1e-5)
    np.testing.assert_array_equal(slots(theirs[0])[:, 0], [1, 0, 0, 1, 1])


def test_who_is_out_is_not_seen():
    some = seen([ME, MATE, THIRD], [PREY, OTHER], out=(1, 4))[0]
    same = seen([ME, THIRD], [PREY])[0]
    np.testing.assert_allclose(some, same, atol=1e-6)


def test_of_many_mates_the_nearest_are_seen():
    crowd = [ME, *((2.0, 4.5 + away, 0.0, 0.0) for away in (2.5, 1.0, 2.0, 0.5))]
    distances = 1 / slots(seen(crowd, [PREY])[0])[:MATES, 3] - 1
    np.testing.assert_allclose(distances, [1.0, 1.5, 2.5], atol=1e-4)
