"""The shield: it does not let a robot crash, and otherwise leaves its player alone."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from apollonius.agents.classical import Still
from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.agents.policy import AbstractContinuous, AbstractPolicy
from apollonius.agents.shield import MARGIN, brakes, shielded
from apollonius.agents.uniform import Uniform
from apollonius.arenas.random_arena import random_arena
from apollonius.catalogue import find_player
from apollonius.evaluate.match import play_match
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle, action_levels
from apollonius.game.game import Game, reset_batch
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, RobotState, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe import paper
from apollonius.observe.encoded import ENCODED
from apollonius.observe.view import look
from tests.acting import act, of_views
from tests.matches import a_match

PAPER = make_game("paper")
RUGGED = Game(arena=random_arena("caves", 3, gap=1.2))
NETWORK = make_network("encoded", 8, 2, jax.random.key(3))


def robot(x, y, v=0.0, heading=0.0):
    return RobotState(*map(jnp.float32, (x, y, v, heading)))


@jax.jit
def clearances_after_all(own):
    return jax.vmap(lambda action: brakes(Game(), Role.PURSUER).clearance_after(own, action))(jnp.arange(9))


def clearances_after(own):
    """Room [m] after each action, of the pursuer in an arena without discs."""
    return np.asarray(clearances_after_all(own))


class Reckless(AbstractPolicy):
    """Always speeds up, and now and then turns."""

    observation = paper.PAPER

    def __call__(self, observation, memory, bits):
        return jnp.int32(6) + (bits >> 16).astype(jnp.int32) % 3, memory


@pytest.mark.parametrize(
    ("name", "policy"),
    [
        ("paper", Uniform()),
        pytest.param("one-large", Reckless(), marks=pytest.mark.slow),
        pytest.param("robot", Reckless(), marks=pytest.mark.slow),
    ],
    ids=["paper, random", "one-large, reckless", "robot, reckless"],
)
def test_behind_a_shield_neither_robot_ever_fails(name, policy):
    game = replace(make_game(name), max_steps=150)
    outcomes = play_match(a_match(game, *(shielded(policy, game, role) for role in Role), games=100, seed=1)).outcomes
    assert outcomes["captured"] + outcomes["no_result"] == 100
    bare = play_match(a_match(game, policy, policy, games=100, seed=1)).outcomes
    assert bare["captured"] + bare["no_result"] < 50


def test_far_from_everything_the_player_acts_for_itself():
    game, role = Game(), Role.EVADER
    player = Greedy(NETWORK)
    guarded = shielded(player, game, role)
    for turn, seed in enumerate(range(6)):
        state = game.reset(jax.random.key(seed))
        centre = RobotState(jnp.float32(5.0), jnp.float32(5.0), jnp.float32(0.6), state.pursuer.heading)
        state = type(state).of_two(centre, centre, state.steps)
        seen, bits = look(game, state, role), jnp.uint32(turn)
        assert int(eqx.filter_jit(act)(guarded, seen, bits)) == int(act(player, ENCODED(seen), bits))


def test_what_replaces_a_forbidden_action_is_the_best_of_the_allowed():
    """At full speed 1.25 m before a wall only braking and turning at once will do."""
    own = robot(10 - 1.25, 5.0, 1.2)
    state = Game().reset(jax.random.key(0))
    seen = look(Game(), type(state).of_two(own, robot(1.0, 1.0), state.steps), Role.PURSUER)
    allowed = clearances_after(own) > MARGIN
    assert list(np.flatnonzero(allowed)) == [0, 2]
    chosen, acts = set(), eqx.filter_jit(lambda player, seen: act(player, seen, jnp.uint32(0)))
    for seed in range(12):
        network = make_network("encoded", 8, 2, jax.random.key(seed))
        values = np.where(allowed, np.asarray(network(ENCODED(seen))), -np.inf)
        assert int(acts(shielded(Greedy(network), Game(), Role.PURSUER), seen)) == int(np.argmax(values))
        chosen.add(int(np.argmax(values)))
    assert chosen == {0, 2}


def test_room_is_what_the_best_way_to_brake_leaves():
    """From 1.2 m/s it takes 4 s; against a SciPy integration of Eq. 1, turning all the while."""
    own = robot(10 - 2.0, 5.0, 1.2)
    reach = quad(lambda t: (1.2 - 0.3 * t) * np.cos(0.8 * t), 0, np.pi / 1.6)[0]
    assert clearances_after(own)[0] == pytest.approx(2.0 - reach, abs=2e-3)
    along = robot(5.0, 0.02, 1.2)  # beside a wall, with open space on the left
    assert clearances_after(along)[4] == pytest.approx(0.02, abs=1e-4)


def test_a_robot_that_is_lost_does_what_leaves_most_room():
    guarded = shielded(Greedy(NETWORK), Game(), Role.PURSUER)
    own = robot(9.5, 5.0, 1.2)
    clearance = list(clearances_after(own))
    assert max(clearance) < 0
    state = Game().reset(jax.random.key(0))
    seen = look(Game(), type(state).of_two(own, robot(1.0, 1.0), state.steps), Role.PURSUER)
    assert clearance[int(act(guarded, seen, jnp.uint32(0)))] == max(clearance)


LEFT, LOWER = -20.0, -4.0
"""The corner of the yard."""


def yard():
    """18 m square, 16 stars and triangles of 1 m in it."""
    star = [(1.0, 0.0), (0.2, 0.2), (0.0, 1.0), (-0.2, 0.2), (-1.0, 0.0), (-0.2, -0.2), (0.0, -1.0), (0.2, -0.2)]
    triangle = [(0.9, 0.0), (-0.6, 0.7), (-0.5, -0.8)]
    polygons = [
        Polygon(tuple((LEFT + 3.0 + 3.6 * column + 0.3 * row + x, LOWER + 3.0 + 3.5 * row + y) for x, y in shape))
        for row in range(4)
        for column, shape in enumerate([star, triangle] * 2)
    ]
    arena = Arena(x_min=LEFT, x_max=LEFT + 18.0, y_min=LOWER, y_max=LOWER + 18.0, polygons=tuple(polygons))
    return Game(arena=arena, max_steps=80)


def test_among_many_polygons_only_those_within_reach_are_looked_at_and_nothing_changes():
    game = yard()
    backup = brakes(game, Role.PURSUER)
    edges = sum(len(polygon.vertices) for polygon in game.arena.polygons)
    assert backup.surroundings.within.shape[-1] < edges / 2
    x, y, v, heading = jax.random.uniform(jax.random.key(0), (4, 800))
    robots = jax.vmap(RobotState)(LEFT + 18 * x, LOWER + 18 * y, 1.2 * v, 6 * heading - 3)
    actions = jnp.arange(800) % 9
    near, all_over = (
        np.asarray(jax.jit(jax.vmap(tried.clearance_after))(robots, actions))
        for tried in (backup, replace(backup, surroundings=None))
    )
    lost = all_over <= 2 * MARGIN
    assert 60 < lost.sum() < 700
    np.testing.assert_allclose(near[lost], all_over[lost], atol=2e-5)
    assert (near[~lost] > MARGIN).all()
    assert (near >= all_over - 2e-5).all()
    assert (all_over < -0.3).sum() > 10


@pytest.mark.slow
def test_behind_a_shield_a_robot_never_fails_among_many_polygons():
    """The other one stands still, so that nothing ends a game before its time but a failure or a capture."""
    game = yard()
    outcomes = play_match(a_match(game, shielded(Reckless(), game, Role.PURSUER), Still(), games=32, seed=1)).outcomes
    assert outcomes["captured"] + outcomes["no_result"] == 32
    assert outcomes["no_result"] > 16


class Swerves(AbstractContinuous):
    """Speeds up, and turns by chance."""

    observation = paper.PAPER

    def __call__(self, observation, memory, bits):
        return jnp.stack([jnp.float32(0.7), (bits >> 16).astype(jnp.float32) / 32768 - 1]), memory


NINE = jnp.stack([jnp.stack(action_levels(action)) for action in jnp.arange(9)])


@pytest.mark.parametrize("game", [PAPER, yard(), RUGGED], ids=["discs", "polygons", "map"])
def test_what_surely_stops_does_and_mostly_it_is_known(game):
    arena, backup = game.arena, brakes(game, Role.PURSUER)
    x, y, v, heading = jax.random.uniform(jax.random.key(0), (4, 600))
    width, height = arena.x_max - arena.x_min, arena.y_max - arena.y_min
    robots = jax.vmap(RobotState)(arena.x_min + width * x, arena.y_min + height * y, 1.2 * v, 6 * heading - 3)
    actions = jnp.arange(600) % 9
    sure, clearance = (
        np.asarray(jax.jit(jax.vmap(f))(robots, actions)) for f in (backup.surely_stops, backup.clearance_after)
    )
    stops = clearance > MARGIN
    assert not (sure & ~stops).any()
    assert 0.6 < sure.sum() / stops.sum() < 1
    assert 0.1 < stops.mean() < 0.95


@pytest.mark.parametrize(
    ("game", "policy"),
    [(PAPER, Greedy(NETWORK)), (PAPER, Swerves()), pytest.param(yard(), Reckless(), marks=pytest.mark.slow)],
    ids=["discs, valued", "discs, continuous", "polygons, random"],
)
def test_games_are_guarded_together_as_by_trying_all_nine_actions_in_each(game, policy):
    """Of those that are held back there are several blocks and a part of one."""
    role, player = Role.PURSUER, shielded(policy, game, Role.PURSUER)
    states = jax.jit(reset_batch, static_argnums=2)(game, jax.random.key(0), 500)
    speeds = jnp.linspace(0.6, 1.2, 500)
    states = eqx.tree_at(lambda states: states.pursuer.v, states, speeds)
    bits = jax.random.bits(jax.random.key(1), 500)

    @eqx.filter_jit
    def together(player):
        return of_views(lambda view, bits: act(player, player.observation(view), bits), game, states, role, bits)

    @eqx.filter_jit
    def by_all_nine(states, bits):
        def alone(given):
            view, bits = look(game, given[0], role), given[1]
            weighed = policy.weigh(policy.observation(view), (), bits)[0]
            tried = (
                jnp.concatenate([NINE, jnp.stack(action_levels(weighed))[None]]) if policy.continuous else jnp.arange(9)
            )
            clearance = jax.lax.map(lambda action: player.backup.clearance_after(view.own.state, action), tried)
            best = policy.choose(weighed, clearance[:9] > MARGIN)
            if not policy.continuous:
                return jnp.where(jnp.any(clearance > MARGIN), best, jnp.argmax(clearance))
            held = jnp.where(jnp.any(clearance[:9] > MARGIN), best, jnp.argmax(clearance[:9]))
            return jnp.where(clearance[9] > MARGIN, weighed, NINE[held])

        return jax.lax.map(alone, (states, bits))

    guarded = np.asarray(together(player))
    np.testing.assert_array_equal(guarded, by_all_nine(states, bits))
    differs = guarded != np.asarray(together(policy))
    held_back = differs.reshape(500, -1).any(axis=1).sum()
    assert 8 < held_back < 492
    assert held_back % 8


def test_where_all_are_held_back_none_is_forgotten():
    """A dozen robots at full speed 1.25 m before a wall, where only braking and turning at once will do."""
    game, count = Game(), 12
    player = shielded(Reckless(), game, Role.PURSUER)
    y = jnp.linspace(4.5, 5.5, count)
    robots = [
        jax.vmap(RobotState)(jnp.full(count, at), y, jnp.full(count, v), jnp.zeros(count))
        for at, v in ((8.75, 1.2), (1.0, 0.0))
    ]
    states = jax.vmap(GameState.of_two)(*robots, jnp.zeros(count, jnp.int32))
    together = jax.jit(lambda: of_views(lambda view: act(player, view, jnp.uint32(0)), game, states, Role.PURSUER))()
    assert set(np.asarray(together).tolist()) <= {0, 2}


@pytest.mark.parametrize("v_min", [0.2, -0.5], ids=["drives on", "goes backwards"])
def test_a_robot_that_does_not_come_to_rest_is_refused(v_min):
    with pytest.raises(InvalidInput, match=rf"v_min, u1_max = \({v_min}, 0.3\) .*can stop"):
        shielded(Uniform(), Game(pursuer=Unicycle(v_min=v_min)), Role.PURSUER)


def test_a_name_asks_for_the_shield():
    found = find_player("shielded:P_stage1", Role.PURSUER, PAPER)
    assert found.name == "shielded:P_stage1"
    assert found.header == find_player("P_stage1", Role.PURSUER).header
    assert found.policy.backup.body == PAPER.pursuer
    with pytest.raises(InvalidInput, match="needs a game"):
        find_player("shielded:P_stage1", Role.PURSUER)
    with pytest.raises(InvalidInput, match="nobody"):
        find_player("shielded:nobody", Role.PURSUER, PAPER)
