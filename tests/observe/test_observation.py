"""What a robot sees (Eq. 6, 7), in its own frame, and of teams, number by number."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.wrappers.backup import Backup
from apollonius.arenas.charting import with_chart
from apollonius.game.arena import Arena, Disc
from apollonius.game.drive import MOST_LAG, Drive, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.presets import in_teams
from apollonius.game.teams import Teams
from apollonius.game.types import NUM_ACTIONS, DriveState, RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.braking import clearances_after
from apollonius.observe.egocentric import AHEAD, COURSES, EGOCENTRIC, NEAR, RAYS
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.observation import RAW_VIEW, observation_rows
from apollonius.observe.surroundings import Surroundings
from apollonius.observe.team import MATES, OF_A_ROBOT, OPPONENTS, TEAM
from apollonius.observe.view import Robot, look, view_of
from tests.acting import observe as observe_one
from tests.acting import state, state_of
from tests.arenas.test_charting import ROOM

OPEN = Game(
    pursuer=Unicycle(v_min=-0.5, v_max=1.5, u1_max=0.5, radius=0.1),
    evader=Unicycle(v_max=2.0, u1_max=1.0),
    arena=Arena(0.0, 8.0, -2.0, 2.0, discs=(Disc(6.0, 0.0, 0.5),)),
)
observe = jax.jit(observe_one, static_argnames=("role", "name"))


PURSUER, EVADER = (2.0, 1.0, 1.0, math.pi / 2), (4.0, 0.0, 1.0, 0.0)


@pytest.mark.parametrize(("role", "order"), [(Role.PURSUER, 1), (Role.EVADER, -1)])
def test_paper_scales_positions_and_speeds_by_limits_and_headings_by_pi(role, order):
    pursuer, evader = [-0.5, 0.5, 0.5, 0.5], [0.0, 0.0, 0.0, 0.0]
    expected = np.concatenate([pursuer, evader][::order])
    np.testing.assert_allclose(observe(OPEN, state(PURSUER, EVADER), role, "paper"), expected, atol=1e-6)


def test_encoded_has_the_expected_numbers():
    """The pursuer looks up: the evader is 1 m behind and 2 m to its right, and it would stop on the wall."""
    own, opponent = [-0.5, 0.5, 0.5, 0, 1], [0, 0, 0, 1, 0]
    relative, own_clearances, opponents = [-1 / 8, -2 / 8, math.sqrt(5) / 8], [1.0 - 0.1, 0.0 - 0.1], [1.0, 1.0]
    expected = own + opponent + relative + own_clearances + opponents
    np.testing.assert_allclose(observe(OPEN, state(PURSUER, EVADER), Role.PURSUER, "encoded"), expected, atol=1e-6)


def test_encoded_warns_of_a_disc_in_the_braking_distance():
    """At 2 m/s and 1 m/s^2 the evader stops after 2 m, in the middle of the disc 2 m ahead of it."""
    seen = observe(OPEN, state(PURSUER, (4.0, 0.0, 2.0, 0.0)), Role.EVADER, "encoded")
    np.testing.assert_allclose(seen[13:15], [1.0, -0.5], atol=1e-6)


def walled_game(**changes):
    return with_chart(Game(arena=ROOM, **changes))


@jax.jit
def look_by_chart(game, now):
    return EGOCENTRIC(look(game, now, Role.PURSUER))


def observe_pursuer(now):
    slow = Unicycle(v_max=0.6, u1_max=0.6, u2_max=1.6, radius=0.15)
    return np.asarray(look_by_chart(walled_game(pursuer=slow, capture_distance=0.6), now))


def test_egocentric_robot_numbers_match_the_geometry():
    """The pursuer at (2, 4) looks up at 0.6 m/s; the evader is 3 m to its right and drives away from it."""
    numbers = observe_pursuer(state((2.0, 4.0, 0.6, math.pi / 2), (5.0, 4.0, 1.2, 0.0)))[:23]
    own = [0.5, 0.5, 2.0, 2.0, 0.5, 0.0, 1.0, 1.0]
    apart = [0.0, -1.0, 1 / 4, math.log(4) / 2, (3.0 - 0.6) / 3]
    other = [0.0, -1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.8, 0.6, 2.0]
    np.testing.assert_allclose(numbers, own + apart + other, atol=0.03)


def test_egocentric_rays_match_the_distances_to_walls():
    numbers = observe_pursuer(state((2.0, 4.0, 0.0, 0.0), (5.0, 4.0, 0.0, 0.0)))[23 : 23 + RAYS]
    assert numbers.shape == (RAYS,)
    for angle, wall in ((0, 2.0), (RAYS // 4, 4.0), (RAYS // 2, 2.0), (3 * RAYS // 4, 4.0)):
        assert numbers[angle] == pytest.approx(1 / (1 + wall - 0.15), abs=0.01)


def test_egocentric_paths_show_the_way_and_who_arrives_first():
    """Behind a wall 6 m long the evader is not seen, its way leads up, and it is last wherever the pursuer can go."""
    hidden = observe_pursuer(state((3.0, 4.0, 0.0, math.pi / 2), (5.0, 4.0, 0.0, 0.0)))[23 + RAYS :]
    length = math.hypot(1.15, 2.15) + 0.5 + math.hypot(0.95, 2.15)  # the larger body, 15 cm, stays off the wall's end
    assert hidden[0] == 0
    np.testing.assert_allclose(hidden[1:3], [1 / (1 + length), math.log1p(length) / 2], rtol=0.05)
    longer, shorter, first = np.split(hidden[3 : 5 + 2 * COURSES], [COURSES, COURSES + 2])
    assert longer[0] < -0.8, "a metre and a half up the way is shorter by as much"
    assert longer[COURSES // 2] > 0.8
    assert shorter[0] > 0.5
    assert abs(shorter[1]) < 0.5
    along = min(4.0 - 0.1, AHEAD)
    theirs = math.hypot(0.95, 2.15) + 0.5 + math.hypot(1.15, 2.15 - 1.9)
    mine, later = along / 0.6, theirs / 1.2
    assert first[0] == pytest.approx((later - mine) / (later + mine), abs=0.06)
    plain = observe_pursuer(state((3.0, 7.0, 0.0, 0.0), (5.0, 7.0, 0.0, 0.0)))[23 + RAYS :]
    assert plain[0] == 1
    assert plain[1] == pytest.approx(1 / 3, abs=1e-3)
    assert NEAR < AHEAD


@pytest.mark.parametrize(("dt", "hold"), [(0.05, 0.1), (0.1, 0.1), (0.2, 0.2)])
def test_braking_clearance_matches_the_shield_with_the_same_hold(dt, hold):
    """By the chart instead of exact contact, within a few centimetres; clipped and scaled."""
    body = Unicycle(radius=0.15)
    game = walled_game(pursuer=body, dt=dt)
    starts = replace(game.starts, speed="moving", clearance=0.02)
    states = jax.vmap(lambda key: starts.sample(key, game.arena, game.bodies))(jax.random.split(jax.random.key(0), 300))
    backup = Backup(game.arena, hold, steps=40)

    @jax.vmap
    def exact(state):
        return jax.vmap(backup.clearance_after, in_axes=(None, 0))(Robot(body, state), jnp.arange(NUM_ACTIONS))

    expected = np.asarray(exact(states.pursuer))
    seen = np.asarray(jax.jit(jax.vmap(look_by_chart, in_axes=(None, 0)))(game, states))
    here, after = seen[:, 6:7], seen[:, -NUM_ACTIONS:]
    assert np.mean((after > 0) == (expected > 0)) > 0.99, "the same verdict"
    kept = (expected > -0.2) & (expected < 0.25)
    assert kept.sum() > 300
    wrong = np.abs(np.minimum(0.3 * after, here) - expected)[kept]
    assert np.median(wrong) < 0.005
    assert np.quantile(wrong, 0.99) < 0.06


def test_braking_clearance_accounts_for_the_drive_and_pending_commands():
    """Against the drive's own course, after the action, in steps of 0.02 s, by the chart's clearance."""
    body, drive = Unicycle(radius=0.15), Drive(lag=2, turn_time=0.6)
    game, at_once = walled_game(pursuer=body, drives=Drives(pursuer=drive)), Drive(turn_time=0.6)
    starts = replace(game.starts, speed="moving", clearance=0.02)
    states = jax.vmap(lambda key: starts.sample(key, game.arena, game.bodies))(jax.random.split(jax.random.key(0), 40))
    shares = jax.random.uniform(jax.random.key(1), (40, 3, 2), minval=-1, maxval=1) * jnp.array([[[0.3, 0.8]]])
    pending = jnp.pad(shares[:, 1:], ((0, 0), (0, MOST_LAG - 2), (0, 0)))
    drives = jax.vmap(DriveState)(pending, shares[:, 0, 1])
    chart = game.chart
    assert chart is not None

    def least(robot, driven, action, turn):
        asked = [driven.pending[1], driven.pending[0], jnp.stack(body.controls(action)), jnp.stack([-0.3, 0.8 * turn])]

        def on(now, step):
            robot, driven = now
            controls = jnp.stack(asked)[jnp.minimum(step // 5, 3)]
            held, driven = at_once.respond(driven, body, controls / jnp.array([0.3, 0.8]), 0.02)
            robot = body.move(robot, *held, 0.02)
            return (robot, driven), jnp.where(step < 14, jnp.inf, chart.clearance(robot.x, robot.y))

        return jnp.min(jax.lax.scan(on, (robot, driven), jnp.arange(250))[1]) - body.radius

    def seen_by(state, *drives):
        view = view_of(game, Knowledge.complete(state, drives), Role.PURSUER)
        return clearances_after(Surroundings(chart), view.own, game.dt)

    turns, actions = jnp.array([-1.0, 0.0, 1.0]), jnp.arange(NUM_ACTIONS)
    each = jax.vmap(jax.vmap(least, in_axes=(None, None, None, 0)), in_axes=(None, None, 0, None))
    expected = jnp.max(jax.vmap(each, in_axes=(0, 0, None, None))(states.pursuer, drives, actions, turns), axis=2)
    wrong = np.abs(np.asarray(jax.vmap(seen_by)(states, drives) - expected))
    assert np.median(wrong) < 0.003
    assert np.quantile(wrong, 0.97) < 0.03
    unknown = jax.vmap(seen_by)(states)
    assert np.quantile(np.abs(np.asarray(unknown - expected)), 0.97) > 0.1, "of a robot that does at once as it is told"


def test_actions_differ_in_clearance_while_pending_commands_pass_a_wall():
    """No action can change what happens before it takes effect."""
    game = walled_game(drives=Drives(pursuer=Drive(lag=2)))
    along = Knowledge.complete(
        state((2.0, 0.04, 0.5, 0.0), (5.0, 4.0, 1.2, 0.0)), (DriveState(jnp.zeros((MOST_LAG, 2)), None),)
    )
    chart = game.chart
    assert chart is not None
    right, straight, left = clearances_after(Surroundings(chart), view_of(game, along, Role.PURSUER).own, game.dt)[:3]
    assert right + 0.002 < straight < left - 0.002


def test_egocentric_numbers_are_finite_for_a_robot_that_cannot_brake():
    game = walled_game(pursuer=Unicycle(u1_max=0.0, u2_max=15.0))
    numbers = look_by_chart(game, state((2.0, 4.0, 0.6, 0.0), (5.0, 4.0, 1.2, 0.0)))
    assert np.all(np.isfinite(numbers))
    assert np.all(np.abs(numbers[-NUM_ACTIONS:]) <= 1)


def test_egocentric_without_a_chart_is_refused():
    bare = Game(arena=ROOM)
    with pytest.raises(InvalidInput, match="a player that reads an arena's chart"):
        EGOCENTRIC(look(bare, state((2.0, 4.0, 0.6, 0.0), (5.0, 4.0, 1.2, 0.0)), Role.EVADER))


FIRST = EGOCENTRIC.size


@jax.jit
def look_together(game, states):
    return observation_rows(TEAM, game, Knowledge.complete(states), Role.PURSUER)[1]


def together(pursuers, evaders, out=(), arena=ROOM):
    """What each pursuer sees, of rows of (x, y, v, heading); those with these numbers, pursuers first, are out.

    All teams are filled up to the same size with robots that are out, so that few programs are compiled.
    """
    places, statuses = [], []
    for side, first, size in ((pursuers, 0, 5), (evaders, len(pursuers), 2)):
        places.append([*side, *[(1.0, 1.0)] * (size - len(side))])
        plays = [number < len(side) and first + number not in out for number in range(size)]
        statuses.append([RobotStatus.ACTIVE if one else RobotStatus.HIT_OBSTACLE for one in plays])
    states = jax.tree.map(lambda leaf: leaf[None], state_of(*places, statuses))
    return np.asarray(look_together(in_teams(with_chart(Game(arena=arena)), 5, 2), states))[: len(pursuers)]


def slots(numbers):
    """The numbers of the robots besides the nearest opponent."""
    return numbers[FIRST:].reshape(MATES + OPPONENTS, OF_A_ROBOT)


ME, MATE, THIRD = (2.0, 4.0, 0.6, 0.0), (2.0, 6.0, 1.2, math.pi / 2), (3.0, 7.0, 0.0, math.pi)
PREY, OTHER = (6.0, 7.0, 0.5, 0.0), (7.0, 1.0, 1.0, 1.0)


def test_team_observation_extends_egocentric_and_is_zero_without_mates():
    numbers = together([ME], [PREY])
    assert numbers.shape == (1, TEAM.size)
    np.testing.assert_allclose(numbers[0, :FIRST], look_by_chart(walled_game(), state(ME, PREY)), atol=1e-6)
    assert not numbers[:, FIRST:].any()


def test_teammate_numbers_match_the_geometry():
    """The mate is 2 m to the left and drives away; the evader is behind the wall, 4.47 m and 4.12 m from them."""
    ours = together([ME, MATE], [PREY])[0]
    there, mate, none = slots(ours)[0, 0], slots(ours)[0, 1:], slots(ours)[1:]
    assert there == 1
    assert not none.any()
    turned = math.atan2(-1.0, -4.0) - math.atan2(-3.0, -4.0)
    over = math.hypot(4.0, 1.0)
    exact = [0.0, 1.0, 1 / 3, math.log(3) / 2, 0.0, 1.0, math.cos(turned), math.sin(turned)]
    np.testing.assert_allclose(mate[:8], exact, atol=1e-5)
    np.testing.assert_allclose(mate[8:11], [math.log(3) / 2, 1 / (1 + over), math.log1p(over) / 2], rtol=0.05)
    assert mate[11] > 0.6, "both come from the same side"


def test_opponent_between_two_pursuers_has_opposite_bearings():
    pincer = together([(1.0, 7.0, 0.0, 0.0), (7.0, 7.0, 0.0, 0.0)], [(4.0, 7.0, 0.0, 0.0)])
    assert (pincer[:, FIRST + 12] < 0.1).all()
    np.testing.assert_allclose(pincer[:, FIRST + 7], -1.0, atol=1e-5)


def test_robots_are_ordered_by_distance_not_by_number():
    """And of an opponent more the nearest is that of `egocentric`, the other one comes after the mates."""
    robots, others = ([ME, MATE, THIRD], [PREY, OTHER]), ([ME, THIRD, MATE], [OTHER, PREY])
    ours, again = (together(*both) for both in (robots, others))
    np.testing.assert_allclose(ours[[0, 2, 1]], again, atol=1e-6)
    np.testing.assert_array_equal(slots(ours[0])[:, 0], [1, 1, 0, 1, 0])
    np.testing.assert_allclose(slots(ours[0])[:2, 3], [1 / 3, 1 / (1 + math.hypot(1, 3))], atol=1e-5)


def test_mirror_gives_the_observation_of_the_mirror_image():
    """Of the room with its door at the bottom, and of robots of which no two are alike; from the floor to the top."""
    (wall,) = ROOM.polygons
    corners = tuple((x, 8.0 - y) for x, y in reversed(wall.vertices))
    upside_down = replace(ROOM, polygons=(replace(wall, vertices=corners),))
    team = [(3.7, 3.0, 0.8, 1.4), MATE, THIRD], [PREY, OTHER]
    images = ([(x, 8.0 - y, v, -heading) for x, y, v, heading in side] for side in team)
    numbers, image = jnp.asarray(together(*team)), together(*images, arena=upside_down)
    np.testing.assert_allclose(TEAM.mirror(numbers), image, atol=0.1)
    np.testing.assert_allclose(EGOCENTRIC.mirror(numbers[:, :FIRST]), image[:, :FIRST], atol=0.1)
    assert (np.abs(numbers - image) > 0.04).any(axis=0)[[9, 14, FIRST + 2, FIRST + 6, FIRST + 8, FIRST - 1]].all()


def test_inactive_robots_are_not_observed():
    some, same = together([ME, MATE, THIRD], [PREY, OTHER], out=(1, 4)), together([ME, THIRD], [PREY])
    np.testing.assert_allclose(some[0], same[0], atol=1e-6)


def test_views_of_a_team_have_the_turn_rate_of_each_robot():
    game = replace(in_teams(Game(arena=ROOM), 3, 1), drives=Drives(pursuer=Drive(turn_time=0.5)))
    drives = [DriveState(None, jnp.array(rates)) for rates in ([0.1, 0.4], [0.2, 0.5], [0.3, 0.6])]
    known = Knowledge.complete(reset_batch(game, jax.random.key(0), 2), tuple(drives))
    read, rows = observation_rows(RAW_VIEW, game, known, Role.PURSUER)
    views = jax.vmap(read)(rows)
    assert views.own.turn_rate == pytest.approx([0.1, 0.4, 0.2, 0.5, 0.3, 0.6])
    assert views.mates[0].turn_rate == pytest.approx([0.2, 0.5, 0.3, 0.6, 0.1, 0.4])
    assert (views.own.turn_time.tolist(), views.opponents[0].turn_time) == ([0.5] * 6, None)


def test_nearest_of_many_teammates_are_observed():
    crowd = [ME, *((2.0, 4.5 + away, 0.0, 0.0) for away in (2.5, 1.0, 2.0, 0.5))]
    distances = 1 / slots(together(crowd, [PREY])[0])[:MATES, 3] - 1
    np.testing.assert_allclose(distances, [1.0, 1.5, 2.5], atol=1e-4)


UNLIKE = Game(
    pursuer=Unicycle(v_max=1.0),
    evader=Unicycle(v_max=1.1),
    teams=Teams((Unicycle(v_max=1.2), Unicycle(v_max=1.3)), (Unicycle(v_max=1.4),)),
)
"""Three against two, whose top speeds tell who is who."""


@pytest.mark.parametrize(
    ("out", "nearest"),
    [((), 1.4), ((1,), 1.1), ((0,), 1.4), ((0, 1), 1.1)],
    ids=["all play", "the nearest is out", "the other is out", "nobody plays"],
)
def test_opponent_is_the_nearest_active_one(out, nearest):
    evaders = [RobotStatus.CAPTURED if number in out else RobotStatus.ACTIVE for number in range(2)]
    state = state_of([(1, 1), (5, 5), (9, 9)], [(1, 9), (6, 6)], ([0, 0, 0], evaders))
    for number, own in enumerate((1.0, 1.2, 1.3)):
        view = look(UNLIKE, state, Role.PURSUER, number)
        assert view.own.body.v_max == own
        assert {mate.body.v_max for mate in view.mates} == {1.0, 1.2, 1.3} - {own}
        assert float(view.opponent.body.v_max) == pytest.approx(nearest)
