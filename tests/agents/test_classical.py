"""Players that follow a rule, alone and in teams: what each says, against geometry done otherwise, and games."""

from dataclasses import replace
from math import atan2, hypot, pi, sin

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents import built_in
from apollonius.agents.classical import AbstractClassical
from apollonius.agents.guidance import Flee, FleeAware, Intercept, PurePursuit, nearest_reach
from apollonius.agents.path_following import Search
from apollonius.agents.surrounding import Encirclement, VoronoiPursuit, even_bearings, path_length_to, path_lengths_from
from apollonius.arenas.charting import with_chart
from apollonius.catalogue import find_player, player_names
from apollonius.evaluate.match import Match, play_match
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_teams, make_game
from apollonius.game.types import BySide, GameState, RobotState, RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.view import look
from tests.acting import act, robot, state_of

PAPER = make_game("paper")
TEAM = make_game("team-2v1")
OPEN = Game(
    pursuer=Unicycle(v_max=1.5, u2_max=1.0), evader=Unicycle(v_max=1.0), arena=Arena(0.0, 20.0, 0.0, 20.0), dt=0.1
)
CLASSICAL = [name for name, (kind, _) in built_in.PLAYERS.items() if issubclass(kind, AbstractClassical)]
PLAYERS = [(name, role) for name in CLASSICAL for role in built_in.PLAYERS[name][1]]


def random_pairs(seed):
    """Numbers of some 190 pairs of robots, at least 1 m apart, well inside the open game."""
    own, opponent = np.random.default_rng(seed).uniform([4, 4, 0, -pi], [16, 16, 1.0, pi], (2, 200, 4)).swapaxes(1, 2)
    apart = np.hypot(*(opponent - own)[:2]) > 1
    return own[:, apart], opponent[:, apart]


def view(game, role, own, opponent):
    return look(game, GameState.of_two(*BySide.of(role, own, opponent), jnp.int32(0)), role)


@eqx.filter_jit
def of_views(function, own, opponent, game=OPEN, role=Role.PURSUER):
    """What a function makes of the view of each of several robots."""

    def alone(own, opponent):
        return function(view(game, role, RobotState(*own), RobotState(*opponent)))

    return jax.vmap(alone, 1)(jnp.asarray(own, jnp.float32), jnp.asarray(opponent, jnp.float32))


def difference(first, second):
    return np.abs((first - second + pi) % (2 * pi) - pi)


def towards(own, opponent):
    return np.arctan2(opponent[1] - own[1], opponent[0] - own[0])


CHASER, LEADER = (kind.for_side(OPEN, Role.PURSUER) for kind in (PurePursuit, Intercept))


def test_best_action_brings_heading_and_speed_closest_to_the_course():
    own, opponent = random_pairs(0)
    found = of_views(lambda seen: (CHASER.course(seen), CHASER.values(seen)), own, opponent)
    (heading, speed), values = jax.device_get(found)
    levels, body = np.array([[-1], [0], [1]]), OPEN.pursuer
    thrust = np.abs(speed - np.clip(own[2] + levels * body.u1_max * OPEN.dt, 0, body.v_max)).argmin(axis=0)
    turn = difference(heading, own[3] + levels * body.u2_max * OPEN.dt).argmin(axis=0)
    np.testing.assert_array_equal(values.argmax(axis=1), 3 * thrust + turn)


def test_pure_pursuit_slows_down_to_the_turning_circle_through_its_target():
    """Where the speed is not the top one, the target lies on the circle that full turn makes of it."""
    own, opponent = random_pairs(1)
    speed = np.asarray(of_views(CHASER.course, own, opponent)[1])
    angle = (towards(own, opponent) - own[3] + pi) % (2 * pi) - pi
    slow = (speed < OPEN.pursuer.v_max) & (np.abs(angle) < pi / 2)
    radius, side = speed / OPEN.pursuer.u2_max, own[3] + np.sign(angle) * pi / 2
    centre = own[:2] + radius * np.stack([np.cos(side), np.sin(side)])
    np.testing.assert_allclose(np.hypot(*(opponent[:2] - centre))[slow], radius[slow], rtol=1e-3)
    assert slow.sum() > 3


def test_pure_pursuit_heads_for_the_opponent_and_flee_away_from_it():
    own, opponent = random_pairs(2)
    heading, _ = of_views(CHASER.course, own, opponent)
    assert difference(heading, towards(own, opponent)).max() < 1e-4
    heading, speed = of_views(Flee.for_side(OPEN, Role.EVADER).course, own, opponent, role=Role.EVADER)
    assert difference(heading, towards(opponent, own)).max() < 1e-4
    assert set(speed.tolist()) == {OPEN.evader.v_max}


def test_intercept_heads_for_the_circle_of_apollonius():
    """Where the places with distances in the ratio of the speeds meet the opponent's course, by plain algebra."""
    own, opponent = random_pairs(3)
    p, e, along = own[:2], opponent[:2], np.stack([np.cos(opponent[3]), np.sin(opponent[3])])
    ratio = opponent[2] / OPEN.pursuer.v_max
    centre = (e - ratio**2 * p) / (1 - ratio**2)
    radius = ratio * np.hypot(*(e - p)) / (1 - ratio**2)
    b = np.sum(along * (e - centre), axis=0)
    meeting = e + (-b + np.sqrt(b**2 - np.sum((e - centre) ** 2, axis=0) + radius**2)) * along
    heading, _ = of_views(LEADER.course, own, opponent)
    assert difference(heading, towards(own, meeting)).max() < 1e-3


def test_intercept_leads_a_fast_crossing_opponent_by_a_right_angle():
    fast = replace(OPEN, evader=Unicycle(v_max=5.0))
    heading, _ = of_views(LEADER.course, *np.array([[5, 5, 0, 0], [10, 5, 5, pi / 2]])[..., None], fast)
    assert float(heading[0]) == pytest.approx(pi / 2, abs=1e-4)


def test_flee_aware_keeps_off_walls_and_discs():
    """`flee` would run into them in more than half of these games."""
    game = replace(make_game("one-large"), max_steps=150)
    outcomes = play_match(Match.of_names(game, "pure-pursuit", "flee-aware", games=60, seed=0)).outcomes
    assert outcomes["evader_hit_obstacle"] + outcomes["evader_out_of_range"] + outcomes["both_failed"] == 0


def test_course_to_a_place_behind_a_wall_leads_round_its_end():
    """The wall is at x from 4 to 4.2, below a door at y from 6 to 8."""
    wall = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, 6.0), (4.0, 6.0)))
    game = with_chart(Game(arena=Arena(0.0, 8.0, 0.0, 8.0, polygons=(wall,))))
    search = Search.for_side(game, Role.PURSUER)
    way = jax.jit(lambda own, place: search.course_to(view(game, Role.PURSUER, own, place), place))
    for x, y in ((3.0, 3.0), (3.3, 4.0), (2.0, 4.5)):
        heading, speed = map(float, way(robot(x, y, 0.0, pi / 2), robot(5.5, 2.0, 0.0, 0.0)))
        assert difference(heading, atan2(6.2 - y, 4.0 - x)) < 0.35
        assert speed > 0.5


def test_flee_aware_values_the_time_to_contact_when_no_action_is_safe():
    """At 1.2 m/s, 2 m before the wall x = 0, it cannot stop; the more it brakes, the later."""
    seen = view(PAPER, Role.EVADER, robot(2.0, 5.0, 1.2, pi), robot(9.0, 5.0, 0.0, 0.0))
    values = np.asarray(jax.jit(FleeAware.for_side(PAPER, Role.EVADER).values)(seen))
    braking, coasting, hurrying = values[[1, 4, 7]]
    assert (hurrying, coasting) == (-25, -25)
    assert -25 < braking < -10


@pytest.mark.parametrize(("dt", "steps"), [(0.1, 40), (0.05, 80), (0.3, 14)])
def test_flee_aware_looks_equally_far_ahead_at_every_time_step(dt, steps):
    """Nose to a wall no way lasts: each is valued by the steps that it fails in, of all."""
    seen = view(replace(PAPER, dt=dt), Role.EVADER, robot(0.05, 5.0, 1.2, pi), robot(9.0, 5.0, 0.0, 0.0))
    np.testing.assert_array_equal(jax.jit(FleeAware().values)(seen), -steps)


@pytest.mark.parametrize(("name", "role"), PLAYERS)
def test_find_player_returns_each_player_by_name(name, role):
    game = {"territory": make_game("territory"), "voronoi-pursuit": TEAM, "encirclement": TEAM}.get(name, PAPER)
    player = find_player(name, role, game).policy
    assert name in player_names(role, game)
    shielded = find_player(f"shielded:{name}", role, game).policy
    assert (shielded.policy, shielded.needs_chart) == (player, player.needs_chart)


def test_classical_player_selects_the_best_allowed_action():
    @jax.jit
    @jax.vmap
    def played(key):
        """Return its action, the one in place of this, and the values of all."""
        seen = look(OPEN, OPEN.reset(key), Role.PURSUER)
        own = act(CHASER, seen, jnp.uint32(0))
        return own, CHASER.select(CHASER.score(seen, (), jnp.uint32(0))[0], jnp.arange(9) != own), CHASER.values(seen)

    own, other, values = map(np.asarray, played(jax.random.split(jax.random.key(1), 20)))
    np.testing.assert_array_equal(own, values.argmax(axis=1))
    others = np.where(np.arange(9) == own[:, None], -np.inf, values)
    np.testing.assert_array_equal(other, others.argmax(axis=1))


def test_find_player_refuses_a_classical_player_for_the_wrong_side_or_game():
    for name, said in (
        ("flee", r"pursuer = 'flee' .* plays the evader only"),
        ("territory", r"arena.territory = none .* to guard or to reach"),
        ("encirclement", r"pursuers = 1 is not possible: .* 2 at least"),
    ):
        with pytest.raises(InvalidInput, match=said):
            find_player(name, Role.PURSUER, PAPER)
        assert name not in player_names(Role.PURSUER, PAPER)
    assert {"P_stage1", "pure-pursuit", "random"} <= set(player_names(Role.PURSUER, PAPER))


@pytest.mark.parametrize("ratio", [0.5, 1.0, 1.25])
def test_nearest_reach_matches_a_search_over_a_fine_grid(ratio):
    """By a search over a fine grid, far beyond the robots."""
    axis = np.linspace(-20, 30, 501)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1)
    robots = np.random.default_rng(7).uniform(0, 10, (3, 2, 14)).astype(np.float32)
    evader, pursuer, goal = robots[..., np.hypot(*(robots[0] - robots[1])) > 0.5]
    aim = jax.jit(jax.vmap(nearest_reach, (0, 0, None, 0)))
    found = np.stack(aim(tuple(evader), tuple(pursuer), jnp.float32(ratio), tuple(goal)))
    for place, *given in zip(found.T, evader.T, pursuer.T, goal.T, strict=True):
        to_evader, to_pursuer, to_goal = (np.linalg.norm(grid - one, axis=-1) for one in given)
        first = to_evader < ratio * to_pursuer
        assert np.hypot(*(place - given[2])) == pytest.approx(to_goal[first].min(), abs=0.11)
    reached = np.isclose(found, goal, atol=1e-4).all(axis=0)
    late = np.hypot(*(found - evader)) - ratio * np.hypot(*(found - pursuer))
    assert (late < 1e-3)[reached].all()
    assert (np.abs(late) < 2e-3 * (1 + np.hypot(*found)))[~reached].all()
    assert 1 < reached.sum() < len(reached)


@pytest.mark.slow
def test_territory_player_guards_better_than_pure_pursuit():
    game = make_game("territory")
    lost = {}
    for name in ("territory", "pure-pursuit"):
        result = play_match(Match.of_names(game, name, "territory", 100, seed=0))
        lost[name] = result.outcomes["territory_reached"] / 100
        own = result.outcomes["pursuer_hit_obstacle"] + result.outcomes["pursuer_out_of_range"]
        assert result.evader_win_rate == pytest.approx(lost[name] + own / 100)
    assert 0.05 < lost["territory"] < lost["pure-pursuit"] - 0.05


OPEN_TO_TEAMS = in_teams(Game(arena=Arena(0.0, 10.0, 0.0, 10.0)), 3, 1)


def view_of_team(pursuers, evader, out=(), number=0, game=None):
    statuses = [RobotStatus.HIT_OBSTACLE if n in out else 0 for n in range(len(pursuers))]
    state = state_of(pursuers, [evader], (statuses, [0]))
    return eqx.filter_jit(look)(game or with_chart(OPEN_TO_TEAMS), state, Role.PURSUER, number)


def random_teams(seed):
    """Places of three pursuers and an evader, well inside the arena, no two of them near each other."""
    places = np.random.default_rng(seed).uniform(1.5, 8.5, (150, 4, 2))
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=3) + 10 * np.eye(4)
    return places[apart.min(axis=(1, 2)) > 1.7]


@pytest.mark.slow
def test_voronoi_pursuit_heads_for_the_middle_of_the_shared_cell_edge():
    """Between equally fast robots without obstacles: the theorem of Huang and others."""
    player, headings = VoronoiPursuit.for_side(OPEN_TO_TEAMS, Role.PURSUER), []
    course = jax.jit(player.course)
    for *pursuers, evader in random_teams(1)[:40]:
        own, points = pursuers[0], np.linspace(-15, 15, 3001)
        middle, across = (own + evader) / 2, np.array([own[1] - evader[1], evader[0] - own[0]])
        edge = middle + points[:, None] * across / np.linalg.norm(across)
        others = [np.hypot(*(edge - mate).T) for mate in pursuers[1:]]
        on_edge = np.all((edge > 0) & (edge < 10), axis=1) & (np.hypot(*(edge - own).T) < np.min(others, axis=0))
        if on_edge.sum() > 200:  # 2 m
            centroid = edge[on_edge].mean(axis=0)
            heading, _ = course(view_of_team(pursuers, evader))
            headings.append(difference(float(heading), atan2(*(centroid - own)[::-1])))
    assert len(headings) > 15
    assert np.median(headings) < 0.2
    assert max(headings) < 0.5


def test_voronoi_cost_ignores_inactive_teammates_and_their_order():
    player = VoronoiPursuit.for_side(OPEN_TO_TEAMS, Role.PURSUER)
    first, second, third, evader = random_teams(2)[0]
    views = (
        view_of_team([first, second, third], evader),
        view_of_team([first, third, second], evader),
        view_of_team([second, first, third], evader, number=1),
        view_of_team([first, second, third], evader, out=(1,)),
    )
    cost = np.array([*map(jax.jit(lambda seen: player.cost(seen)(jnp.float32(3), jnp.float32(3))), views)])
    assert cost[1:3] == pytest.approx(cost[0])
    assert cost[3] > cost[0] + 1


def test_even_bearings_are_evenly_spaced_with_the_least_rotation():
    rng = np.random.default_rng(0)
    for _ in range(20):
        bearings, active = rng.uniform(-pi, pi, 5), rng.random(5) < 0.7
        active[0] = True
        count = active.sum()
        wanted = np.asarray(even_bearings(jnp.float32(bearings), jnp.asarray(active)))[active]
        ranks = np.argsort(np.argsort(bearings[active]))
        steps = (wanted - wanted[0] - (ranks - ranks[0]) * 2 * pi / count) / (2 * pi)
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-5)
        turned = [np.cos(wanted + angle - bearings[active]).sum() for angle in np.linspace(-pi, pi, 73)]
        assert turned[36] == pytest.approx(max(turned), abs=1e-5)


def test_path_lengths_in_the_open_are_close_to_distances():
    seen = view_of_team([(2, 3), (9, 9), (8, 1)], (6, 4))
    x, y = np.meshgrid(*[(np.arange(0, 40, 2) + 0.5) / 4] * 2)
    np.testing.assert_allclose(path_lengths_from(seen, seen.own), np.hypot(x - 2, y - 3).ravel(), rtol=0.05, atol=0.15)


def test_encirclement_closes_in_at_its_own_bearing():
    """Two that come from one side take opposite ones."""
    player, radius = Encirclement.for_side(OPEN_TO_TEAMS, Role.PURSUER), 0.7 * hypot(3, 0.5)
    above = jnp.float32(5), jnp.float32(5 + radius)
    judge = jax.jit(lambda seen: (player.course(seen)[0], player.cost(seen)(*above)))
    far, cost = judge(view_of_team([(8, 5.5), (8, 4.5), (5, 1)], (5, 5), out=(2,)))
    assert float(cost) == pytest.approx(0, abs=0.2)
    assert float(far) == pytest.approx(atan2(5 + radius - 5.5, 5 - 8), abs=0.1)
    close, _ = judge(view_of_team([(5.5, 5.5), (8, 4.5), (5, 1)], (5, 5)))
    assert float(close) == pytest.approx(-3 * pi / 4)


@pytest.mark.slow
def test_path_lengths_and_voronoi_course_lead_around_a_wall():
    wall = Polygon(((4.8, 0.0), (5.2, 0.0), (5.2, 8.0), (4.8, 8.0)))
    game = in_teams(with_chart(Game(arena=Arena(polygons=(wall,)))), 2, 1)
    seen = view_of_team([(4, 2), (9, 9)], (6, 2), out=(1,), game=game)
    there = seen.opponent.state
    around = hypot(0.8, 6) + 0.4 + hypot(0.8, 6)
    assert float(path_length_to(seen, there)(*map(jnp.float32, (4, 2)))) == pytest.approx(around, rel=0.1)
    own, evader = (np.asarray(path_lengths_from(seen, robot)) for robot in seen.robots)
    free = evader < 100
    assert 0.9 < free.mean() < 1
    x, y = np.meshgrid(*[(np.arange(0, 40, 2) + 0.5) / 4] * 2)
    straight = np.hypot(x.ravel() - 4, y.ravel() - 2)
    assert (own - straight)[free].min() > -0.3
    beside = free & (x.ravel() < 4.5)
    np.testing.assert_allclose(own[beside], straight[beside], rtol=0.1, atol=0.3)
    heading, _ = VoronoiPursuit.for_side(game, Role.PURSUER).course(seen)
    assert sin(float(heading)) > 0.9
