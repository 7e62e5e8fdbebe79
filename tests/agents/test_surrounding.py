"""Pursuers that play as a team: what they aim at, against geometry done otherwise."""

from math import atan2, hypot, pi, sin

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.surrounding import Encirclement, VoronoiPursuit, even_bearings, path_length_to, to_all
from apollonius.arenas.charting import charted
from apollonius.catalogue import find_player, player_names
from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_teams, paper
from apollonius.game.types import RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.view import look
from tests.acting import state_of

OPEN = in_teams(Game(arena=Arena(0.0, 10.0, 0.0, 10.0)), 3, 1)


def view(pursuers, evader, out=(), number=0, game=OPEN):
    statuses = [RobotStatus.HIT_OBSTACLE if n in out else 0 for n in range(len(pursuers))]
    state = state_of(pursuers, [evader], (statuses, [0]))
    return look(game, state, Role.PURSUER, number)


def random_teams(seed, count):
    """Places of three pursuers and an evader, well inside the arena, no two of them near each other."""
    rng = np.random.default_rng(seed)
    while count:
        places = rng.uniform(1.5, 8.5, (4, 2))
        apart = np.linalg.norm(places[:, None] - places[None], axis=2) + 10 * np.eye(4)
        if apart.min() > 1.7:
            count -= 1
            yield places[:3].tolist(), places[3].tolist()


def difference(first, second):
    return abs((first - second + pi) % (2 * pi) - pi)


def test_it_heads_for_the_middle_of_the_edge_between_its_cell_and_the_evaders():
    """Between equally fast robots without obstacles: the theorem of Huang and others."""
    player, headings = VoronoiPursuit.for_side(OPEN, Role.PURSUER), []
    course = jax.jit(player.course)
    for pursuers, evader in random_teams(1, 40):
        own, points = np.array(pursuers[0]), np.linspace(-15, 15, 30_001)
        middle, across = (own + evader) / 2, np.array([own[1] - evader[1], evader[0] - own[0]])
        edge = middle + points[:, None] * across / np.linalg.norm(across)
        others = [np.hypot(*(edge - mate).T) for mate in pursuers[1:]]
        on_edge = np.all((edge > 0) & (edge < 10), axis=1) & (np.hypot(*(edge - own).T) < np.min(others, axis=0))
        if on_edge.sum() > 2000:  # 2 m
            centroid = edge[on_edge].mean(axis=0)
            heading, _ = course(view(pursuers, evader))
            headings.append(difference(float(heading), atan2(*(centroid - own)[::-1])))
    assert len(headings) > 15
    assert np.median(headings) < 0.2
    assert max(headings) < 0.5


def test_a_mate_that_is_out_has_no_cell_and_the_order_of_mates_is_nothing():
    player = VoronoiPursuit.for_side(OPEN, Role.PURSUER)
    (pursuers, evader), *_ = random_teams(2, 1)
    cost = [
        float(player.cost(seen)(jnp.float32(3), jnp.float32(3)))
        for seen in (
            view(pursuers, evader),
            view([pursuers[0], pursuers[2], pursuers[1]], evader),
            view([pursuers[1], pursuers[0], pursuers[2]], evader, number=1),
            view(pursuers, evader, out=(1,)),
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


def test_in_the_open_the_lengths_of_paths_are_distances_to_points_all_over():
    seen = view([(2, 3), (9, 9), (8, 1)], (6, 4))
    x, y = np.meshgrid(*[(np.arange(0, 40, 2) + 0.5) / 4] * 2)
    np.testing.assert_allclose(to_all(seen, seen.own), np.hypot(x - 2, y - 3).ravel(), atol=1e-5)


def test_encirclement_closes_in_at_its_own_bearing():
    """Two that come from one side take opposite ones."""
    player = Encirclement.for_side(OPEN, Role.PURSUER)
    seen = view([(8, 5.5), (8, 4.5), (5, 1)], (5, 5), out=(2,))
    cost, radius = player.cost(seen), 0.7 * hypot(3, 0.5)
    assert float(cost(jnp.float32(5), jnp.float32(5 + radius))) == pytest.approx(0, abs=1e-4)
    heading, _ = player.course(seen)
    assert float(heading) == pytest.approx(atan2(5 + radius - 5.5, 5 - 8), abs=0.1)
    close, _ = player.course(view([(5.5, 5.5), (8, 4.5), (5, 1)], (5, 5)))
    assert float(close) == pytest.approx(-3 * pi / 4)


@pytest.mark.slow
def test_behind_a_wall_ways_are_those_around_it():
    wall = Polygon(((4.8, 0.0), (5.2, 0.0), (5.2, 8.0), (4.8, 8.0)))
    game = in_teams(charted(Game(arena=Arena(polygons=(wall,)))), 2, 1)
    seen = view([(4, 2), (9, 9)], (6, 2), out=(1,), game=game)
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


def test_they_play_in_teams_only():
    with pytest.raises(InvalidInput, match=r"pursuers = 1 is not possible: .* 2 at least"):
        find_player("encirclement", Role.PURSUER, paper())
    assert "voronoi-pursuit" not in player_names(Role.PURSUER, paper())
    assert {"voronoi-pursuit", "encirclement"} <= set(player_names(Role.PURSUER, OPEN))
    assert find_player("shielded:encirclement", Role.PURSUER, in_teams(paper(), 2, 1)).policy.charted
