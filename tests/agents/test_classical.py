"""Players that follow a rule, alone and in teams: what each says, against geometry done otherwise, and games."""

from dataclasses import replace
from math import atan2, cos, hypot, pi, sin

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents import built_in
from apollonius.agents.classical import AbstractClassical
from apollonius.agents.guidance import Flee, FleeAware, Intercept, PurePursuit, nearest_reach
from apollonius.agents.searching import Search
from apollonius.agents.surrounding import Encirclement, VoronoiPursuit, even_bearings, path_length_to, to_all
from apollonius.arenas.charting import charted
from apollonius.catalogue import find_player, player_names
from apollonius.evaluate.match import play_match
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_teams, make_game
from apollonius.game.types import GameState, RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.view import look
from tests.acting import a_match, act, robot, state_of

PAPER = make_game("paper")
TEAM = make_game("team-2v1")
OPEN = Game(
    pursuer=Unicycle(v_max=1.5, u2_max=1.0), evader=Unicycle(v_max=1.0), arena=Arena(0.0, 20.0, 0.0, 20.0), dt=0.1
)
CLASSICAL = [name for name, (kind, _) in built_in.PLAYERS.items() if issubclass(kind, AbstractClassical)]
PLAYERS = [(name, role) for name in CLASSICAL for role in built_in.PLAYERS[name][1]]


def random_pairs(seed, count=50):
    """Pairs of robots as plain numbers, at least 1 m apart, well inside the open game."""
    rng = np.random.default_rng(seed)
    while count:
        pair = rng.uniform([4, 4, 0, -pi] * 2, [16, 16, 1.0, pi] * 2)
        if hypot(pair[4] - pair[0], pair[5] - pair[1]) > 1:
            count -= 1
            yield pair[:4], pair[4:]


def view(game, role, own, opponent):
    robots = (own, opponent) if role == Role.PURSUER else (opponent, own)
    return look(game, GameState.of_two(*robots, jnp.int32(0)), role)


@eqx.filter_jit
def course_in_view(player, seen):
    return player.course(seen)


def course_of(player, own, opponent, game=OPEN, role=Role.PURSUER):
    return map(float, course_in_view(player, view(game, role, robot(*own), robot(*opponent))))


def difference(first, second):
    return abs((first - second + pi) % (2 * pi) - pi)


def same_direction(first, second, within=1e-4):
    return difference(first, second) < within


def test_actions_bring_heading_and_speed_as_close_to_the_course_as_one_step_can():
    player = PurePursuit.for_side(OPEN, Role.PURSUER)
    judge = jax.jit(player.values)
    body, dt = OPEN.pursuer, OPEN.dt
    for own, opponent in random_pairs(0, 20):
        heading, speed = course_of(player, own, opponent)
        v = [min(max(own[2] + level * body.u1_max * dt, 0), body.v_max) for level in (-1, 0, 1)]
        turned = [own[3] + level * body.u2_max * dt for level in (-1, 0, 1)]
        thrust = int(np.argmin([abs(speed - value) for value in v]))
        turn = int(np.argmin([difference(heading, value) for value in turned]))
        assert int(jnp.argmax(judge(view(OPEN, Role.PURSUER, robot(*own), robot(*opponent))))) == 3 * thrust + turn


def test_a_chaser_is_never_too_fast_for_the_circle_through_its_target():
    """Where the speed is not the top one, the target lies on the circle that full turn makes of it."""
    player = PurePursuit.for_side(OPEN, Role.PURSUER)
    slow = 0
    for own, opponent in random_pairs(1, 200):
        _, speed = course_of(player, own, opponent)
        angle = (atan2(opponent[1] - own[1], opponent[0] - own[0]) - own[3] + pi) % (2 * pi) - pi
        if speed < OPEN.pursuer.v_max and abs(angle) < pi / 2:
            slow += 1
            radius = speed / OPEN.pursuer.u2_max
            side = own[3] + np.sign(angle) * pi / 2
            centre = own[0] + radius * cos(side), own[1] + radius * sin(side)
            assert hypot(opponent[0] - centre[0], opponent[1] - centre[1]) == pytest.approx(radius, rel=1e-3)
    assert slow > 3


def test_pure_pursuit_heads_for_the_opponent_and_flee_away_from_it():
    for own, opponent in random_pairs(2, 10):
        sight = atan2(opponent[1] - own[1], opponent[0] - own[0])
        heading, _ = course_of(PurePursuit.for_side(OPEN, Role.PURSUER), own, opponent)
        assert same_direction(heading, sight)
        heading, speed = course_of(Flee.for_side(OPEN, Role.EVADER), own, opponent, role=Role.EVADER)
        assert same_direction(heading, sight + pi)
        assert speed == OPEN.evader.v_max


def test_intercept_heads_for_the_circle_of_apollonius():
    """Where the places with distances in the ratio of the speeds meet the opponent's course, by plain algebra."""
    player = Intercept.for_side(OPEN, Role.PURSUER)
    for own, opponent in random_pairs(3):
        p, e, speed, along = own[:2], opponent[:2], opponent[2], np.array([cos(opponent[3]), sin(opponent[3])])
        ratio = speed / OPEN.pursuer.v_max
        centre = (e - ratio**2 * p) / (1 - ratio**2)
        radius = ratio * np.linalg.norm(e - p) / (1 - ratio**2)
        b = along @ (e - centre)
        meeting = e + (-b + np.sqrt(b**2 - (e - centre) @ (e - centre) + radius**2)) * along
        heading, _ = course_of(player, own, opponent)
        assert same_direction(heading, atan2(*(meeting - p)[::-1]), within=1e-3)


def test_an_opponent_that_crosses_too_fast_is_led_by_a_right_angle():
    fast = replace(OPEN, evader=Unicycle(v_max=5.0))
    heading, _ = course_of(Intercept.for_side(fast, Role.PURSUER), (5, 5, 0, 0), (10, 5, 5.0, pi / 2), fast)
    assert same_direction(heading, pi / 2)


def test_flee_aware_keeps_off_walls_and_discs():
    """`flee` would run into them in more than half of these games."""
    game = replace(make_game("one-large"), max_steps=150)
    chaser = find_player("pure-pursuit", Role.PURSUER, game).policy
    outcomes = play_match(a_match(game, chaser, FleeAware.for_side(game, Role.EVADER), games=60, seed=0)).outcomes
    assert outcomes["evader_hit_obstacle"] + outcomes["evader_out_of_range"] + outcomes["both_failed"] == 0


def test_the_way_to_a_place_behind_a_wall_leads_round_its_end():
    """The wall is at x from 4 to 4.2, below a door at y from 6 to 8."""
    wall = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, 6.0), (4.0, 6.0)))
    game = charted(Game(arena=Arena(0.0, 8.0, 0.0, 8.0, polygons=(wall,))))
    search = Search.for_side(game, Role.PURSUER)
    way = jax.jit(lambda own, place: search.way(view(game, Role.PURSUER, own, place), place))
    for x, y in ((3.0, 3.0), (3.3, 4.0), (2.0, 4.5)):
        heading, speed = map(float, way(robot(x, y, 0.0, pi / 2), robot(5.5, 2.0, 0.0, 0.0)))
        round_the_end = atan2(6.2 - y, 4.0 - x)
        assert same_direction(heading, round_the_end, 0.35)
        assert speed > 0.5


def test_where_flee_aware_has_no_way_left_it_values_how_late_its_clearance_runs_out():
    """At 1.2 m/s, 2 m before the wall x = 0, it cannot stop; the more it brakes, the later."""
    seen = view(PAPER, Role.EVADER, robot(2.0, 5.0, 1.2, pi), robot(9.0, 5.0, 0.0, 0.0))
    values = np.asarray(jax.jit(FleeAware.for_side(PAPER, Role.EVADER).values)(seen))
    braking, coasting, hurrying = values[[1, 4, 7]]
    assert (hurrying, coasting) == (-25, -25)
    assert -25 < braking < -10


def test_flee_aware_looks_equally_far_ahead_whatever_the_step():
    steps = [FleeAware.for_side(replace(PAPER, dt=dt), Role.EVADER).steps for dt in (0.1, 0.05, 0.3)]
    assert steps == [40, 80, 14]


@pytest.mark.parametrize(("name", "role"), PLAYERS)
def test_each_is_found_by_name_and_acts_within_what_is_allowed(name, role):
    game = {"territory": make_game("territory"), "voronoi-pursuit": TEAM, "encirclement": TEAM}.get(
        name, charted(PAPER)
    )
    player = find_player(name, role, game).policy
    assert name in player_names(role, game)
    shielded = find_player(f"shielded:{name}", role, game).policy
    assert (shielded.policy, shielded.charted) == (player, player.charted)
    if (name, role) not in (("pure-pursuit", Role.PURSUER), ("search", Role.PURSUER), ("territory", Role.EVADER)):
        return  # whose actions are chosen alike

    @jax.jit
    def played(key):
        """Return its action, the one in place of this, and the values of all."""
        seen = look(game, game.reset(key), role)
        own = act(player, seen, jnp.uint32(0))
        allowed = jnp.arange(9) != own
        other = player.choose(player.weigh(seen, player.memory, jnp.uint32(0))[0], allowed)
        return own, other, allowed, player.values(seen)

    own, other, allowed, values = map(np.asarray, played(jax.random.key(1)))
    assert own == int(np.argmax(values))
    assert other == int(np.argmax(np.where(allowed, values, -np.inf)))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("flee", r"pursuer = 'flee' .* plays the evader only"),
        ("territory", r"arena.territory = none .* to guard or to reach"),
        ("encirclement", r"pursuers = 1 is not possible: .* 2 at least"),
    ],
)
def test_a_classical_player_needs_its_own_side_and_game(name, said):
    with pytest.raises(InvalidInput, match=said):
        find_player(name, Role.PURSUER, PAPER)
    assert name not in player_names(Role.PURSUER, PAPER)
    assert {"P_stage1", "pure-pursuit", "random"} <= set(player_names(Role.PURSUER, PAPER))


RATIOS = [0.5, 1.0, 1.25]
aim = jax.jit(nearest_reach)


def place(evader, pursuer, ratio, goal):
    return np.array([float(number) for number in aim(*(tuple(map(jnp.float32, p)) for p in (evader, pursuer)),
                                                     jnp.float32(ratio), tuple(map(jnp.float32, goal)))])  # fmt: skip


def states(seed, count):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        evader, pursuer, goal = rng.uniform(0, 10, (3, 2))
        if np.linalg.norm(evader - pursuer) > 0.5:
            yield evader, pursuer, goal


@pytest.mark.parametrize("ratio", RATIOS)
def test_it_is_the_nearest_of_all_places_that_the_evader_is_first_at(ratio):
    """By a search over a fine grid, far beyond the robots."""
    axis = np.linspace(-20, 30, 501)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1)
    reached = []
    for evader, pursuer, goal in states(0, 14):
        to_evader, to_pursuer, to_goal = (np.linalg.norm(grid - one, axis=-1) for one in (evader, pursuer, goal))
        first = to_evader < ratio * to_pursuer
        x, y = place(evader, pursuer, ratio, goal)
        assert np.hypot(x - goal[0], y - goal[1]) == pytest.approx(to_goal[first].min(), abs=0.11)
        late = np.hypot(x - evader[0], y - evader[1]) - ratio * np.hypot(x - pursuer[0], y - pursuer[1])
        reached.append(np.allclose([x, y], goal, atol=1e-4))
        assert late < 1e-3 if reached[-1] else abs(late) < 2e-3 * (1 + np.hypot(x, y))
    assert 1 < sum(reached) < len(reached)


def test_who_aims_there_guards_better_than_who_heads_for_the_evader():
    game = make_game("territory")
    evader = find_player("territory", Role.EVADER, game).policy
    lost = {}
    for name in ("territory", "pure-pursuit"):
        result = play_match(a_match(game, find_player(name, Role.PURSUER, game).policy, evader, 100, seed=0))
        lost[name] = result.outcomes["territory_reached"] / 100
        own = result.outcomes["pursuer_hit_obstacle"] + result.outcomes["pursuer_out_of_range"]
        assert result.evader_win_rate == pytest.approx(lost[name] + own / 100)
    assert 0.05 < lost["territory"] < lost["pure-pursuit"] - 0.05


OPEN_TO_TEAMS = in_teams(Game(arena=Arena(0.0, 10.0, 0.0, 10.0)), 3, 1)


def view_of_team(pursuers, evader, out=(), number=0, game=None):
    statuses = [RobotStatus.HIT_OBSTACLE if n in out else 0 for n in range(len(pursuers))]
    state = state_of(pursuers, [evader], (statuses, [0]))
    return look(game or charted(OPEN_TO_TEAMS), state, Role.PURSUER, number)


def random_teams(seed, count):
    """Places of three pursuers and an evader, well inside the arena, no two of them near each other."""
    rng = np.random.default_rng(seed)
    while count:
        places = rng.uniform(1.5, 8.5, (4, 2))
        apart = np.linalg.norm(places[:, None] - places[None], axis=2) + 10 * np.eye(4)
        if apart.min() > 1.7:
            count -= 1
            yield places[:3].tolist(), places[3].tolist()


def test_it_heads_for_the_middle_of_the_edge_between_its_cell_and_the_evaders():
    """Between equally fast robots without obstacles: the theorem of Huang and others."""
    player, headings = VoronoiPursuit.for_side(OPEN_TO_TEAMS, Role.PURSUER), []
    course = jax.jit(player.course)
    for pursuers, evader in random_teams(1, 40):
        own, points = np.array(pursuers[0]), np.linspace(-15, 15, 30_001)
        middle, across = (own + evader) / 2, np.array([own[1] - evader[1], evader[0] - own[0]])
        edge = middle + points[:, None] * across / np.linalg.norm(across)
        others = [np.hypot(*(edge - mate).T) for mate in pursuers[1:]]
        on_edge = np.all((edge > 0) & (edge < 10), axis=1) & (np.hypot(*(edge - own).T) < np.min(others, axis=0))
        if on_edge.sum() > 2000:  # 2 m
            centroid = edge[on_edge].mean(axis=0)
            heading, _ = course(view_of_team(pursuers, evader))
            headings.append(difference(float(heading), atan2(*(centroid - own)[::-1])))
    assert len(headings) > 15
    assert np.median(headings) < 0.2
    assert max(headings) < 0.5


def test_a_mate_that_is_out_has_no_cell_and_the_order_of_mates_is_nothing():
    player = VoronoiPursuit.for_side(OPEN_TO_TEAMS, Role.PURSUER)
    (pursuers, evader), *_ = random_teams(2, 1)
    cost = [
        float(player.cost(seen)(jnp.float32(3), jnp.float32(3)))
        for seen in (
            view_of_team(pursuers, evader),
            view_of_team([pursuers[0], pursuers[2], pursuers[1]], evader),
            view_of_team([pursuers[1], pursuers[0], pursuers[2]], evader, number=1),
            view_of_team(pursuers, evader, out=(1,)),
        )
    ]
    assert cost[1:3] == pytest.approx([cost[0]] * 2)
    assert cost[3] > cost[0] + 1


def test_bearings_are_even_in_their_order_and_turn_as_little_as_can_be():
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


def test_in_the_open_the_lengths_of_paths_are_nearly_distances_to_points_all_over():
    seen = view_of_team([(2, 3), (9, 9), (8, 1)], (6, 4))
    x, y = np.meshgrid(*[(np.arange(0, 40, 2) + 0.5) / 4] * 2)
    np.testing.assert_allclose(to_all(seen, seen.own), np.hypot(x - 2, y - 3).ravel(), rtol=0.05, atol=0.15)


def test_encirclement_closes_in_at_its_own_bearing():
    """Two that come from one side take opposite ones."""
    player = Encirclement.for_side(OPEN_TO_TEAMS, Role.PURSUER)
    seen = view_of_team([(8, 5.5), (8, 4.5), (5, 1)], (5, 5), out=(2,))
    cost, radius = player.cost(seen), 0.7 * hypot(3, 0.5)
    assert float(cost(jnp.float32(5), jnp.float32(5 + radius))) == pytest.approx(0, abs=0.2)
    heading, _ = player.course(seen)
    assert float(heading) == pytest.approx(atan2(5 + radius - 5.5, 5 - 8), abs=0.1)
    close, _ = player.course(view_of_team([(5.5, 5.5), (8, 4.5), (5, 1)], (5, 5)))
    assert float(close) == pytest.approx(-3 * pi / 4)


@pytest.mark.slow
def test_behind_a_wall_ways_are_those_around_it():
    wall = Polygon(((4.8, 0.0), (5.2, 0.0), (5.2, 8.0), (4.8, 8.0)))
    game = in_teams(charted(Game(arena=Arena(polygons=(wall,)))), 2, 1)
    seen = view_of_team([(4, 2), (9, 9)], (6, 2), out=(1,), game=game)
    there = seen.opponent.state
    around = hypot(0.8, 6) + 0.4 + hypot(0.8, 6)
    assert float(path_length_to(seen, there)(*map(jnp.float32, (4, 2)))) == pytest.approx(around, rel=0.1)
    own, evader = (np.asarray(to_all(seen, robot)) for robot in seen.robots)
    free = evader < 100
    assert 0.9 < free.mean() < 1
    x, y = np.meshgrid(*[(np.arange(0, 40, 2) + 0.5) / 4] * 2)
    straight = np.hypot(x.ravel() - 4, y.ravel() - 2)
    assert (own - straight)[free].min() > -0.3
    beside = free & (x.ravel() < 4.5)
    np.testing.assert_allclose(own[beside], straight[beside], rtol=0.1, atol=0.3)
    heading, _ = VoronoiPursuit.for_side(game, Role.PURSUER).course(seen)
    assert sin(float(heading)) > 0.9
