"""The shield lets no robot crash and else leaves its player alone; players search and hide by what they believe."""

import functools
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from apollonius.agents.classical import Uniform
from apollonius.agents.network import make_network
from apollonius.agents.policy import AbstractContinuous, AbstractPolicy
from apollonius.agents.trained import Greedy
from apollonius.agents.wrappers.backup import MARGIN, brakes, steps_to_rest
from apollonius.agents.wrappers.shield import with_shield
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.arenas.random_arena import random_arena
from apollonius.arenas.suite import suite_arena
from apollonius.catalogue import find_player
from apollonius.evaluate.match import play_match
from apollonius.game.arena import Arena
from apollonius.game.chart import COARSE
from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle, action_levels
from apollonius.game.game import Game, reset_batch
from apollonius.game.movers import Movers
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.scenario import RobotKinds, Scenario
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.starts import Starts
from apollonius.game.timetable import Shuttle
from apollonius.game.types import BySide, GameState, MoverMotion, RobotState, RobotStatus, Role
from apollonius.game.uncertainty import Uncertainties, Uncertainty
from apollonius.game.walkers import Walkers
from apollonius.io.errors import InvalidInput
from apollonius.observe import paper
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.view import Robot, look, view_of
from tests.acting import a_match, act, of_views, robot

PAPER = make_game("paper")


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
@pytest.mark.parametrize(
    "drives", [Drives(Drive(lag=2, turn_time=0.9), Drive(turn_time=0.9)), pytest.param(None, marks=pytest.mark.slow)]
)
def test_shielded_robots_never_crash_or_leave_the_arena(name, policy, drives):
    """It knows how late and how slowly its drive does what it is told."""
    game = replace(make_game(name), max_steps=150, drives=drives)
    outcomes = play_match(
        a_match(game, *(with_shield(policy, game, role) for role in Role), games=100, seed=1)
    ).outcomes
    assert outcomes["captured"] + outcomes["no_result"] == 100


@pytest.mark.parametrize(
    "drives", [Drives(Drive(lag=2, turn_time=0.9), None), pytest.param(None, marks=pytest.mark.slow)]
)
def test_shielded_robots_never_run_into_movers(drives):
    """Without a shield most of them do."""
    movers = Movers((Shuttle(((1.0, 1.0), (9.0, 9.0)), v_max=2.0),), walkers=(Walkers(6),))
    braking = replace(PAPER.pursuer, u1_max=1.0, radius=0.1)
    game = replace(PAPER, pursuer=braking, evader=braking, movers=movers, max_steps=150, drives=drives)
    players = [with_shield(Reckless(), game, role) for role in Role]
    outcomes = play_match(a_match(game, *players, games=60, seed=1)).outcomes
    assert outcomes["captured"] + outcomes["no_result"] == 60
    bare = play_match(a_match(game, Reckless(), players[1], games=60, seed=1)).outcomes
    assert bare["pursuer_hit_obstacle"] + bare["pursuer_out_of_range"] > 50


def test_robot_rests_after_the_steps_of_a_manoeuvre():
    """To the bit, though 1.2 less forty times 0.03 leaves a little in single precision: movers count until it rests."""

    @jax.jit
    @jax.vmap
    def rests(v_max, u1_max):
        body = Unicycle(v_max=v_max, u1_max=u1_max)
        brake = functools.partial(body.move, u1=-u1_max, u2=jnp.float32(0.0), dt=0.1)
        at_top_speed = robot(0.0, 0.0, 0.0, 0.0)
        at_top_speed = replace(at_top_speed, v=v_max)
        steps = steps_to_rest(body, 0.1)
        end = jax.lax.fori_loop(0, steps, lambda _, state: brake(state), at_top_speed)
        return end.v, steps.astype(jnp.float32) - v_max / (u1_max * 0.1)

    v_max, u1_max = (np.random.default_rng(0).uniform(0.1, 2.0, (2, 500)) // 0.01 * 0.01).astype(np.float32)
    v_max[0], u1_max[0] = 1.2, 0.3
    speeds, spare = rests(v_max, u1_max)
    assert (np.asarray(speeds) == 0).all()
    assert (np.asarray(spare) < 2.001).all()


def test_shield_promises_nothing_to_robots_that_do_not_see_all_movers():
    game = replace(PAPER, movers=Movers(walkers=(Walkers(2),)), max_steps=2)
    for sensors, unpromised in ((Sensors(range=3.0), {"pursuer": 5}), (Sensors(), None), (None, None)):
        own_game = replace(game, sensors=Sensing(pursuer=sensors))
        pursuer = with_shield(Uniform(), own_game, Role.PURSUER)
        assert play_match(a_match(own_game, pursuer, Uniform(), games=5)).unpromised == unpromised


def test_clearance_after_braking_matches_numerical_integration():
    """From 1.2 m/s it takes 4 s; against a SciPy integration of Eq. 1, turning all the while."""
    clearance_after, own = brakes(Game(), Role.PURSUER).clearance_after, Robot(Unicycle(), robot(10 - 2.0, 5.0, 1.2))
    reach = quad(lambda t: (1.2 - 0.3 * t) * np.cos(0.8 * t), 0, np.pi / 1.6)[0]
    assert clearance_after(own, jnp.int32(0)) == pytest.approx(2.0 - reach, abs=2e-3)
    along = Robot(Unicycle(), robot(5.0, 0.02, 1.2))  # beside a wall, with open space on the left
    assert clearance_after(along, jnp.int32(4)) == pytest.approx(0.02, abs=1e-4)


def yard():
    """18 m square, 16 stars and triangles of 1 m in it."""
    star = [(1.0, 0.0), (0.2, 0.2), (0.0, 1.0), (-0.2, 0.2), (-1.0, 0.0), (-0.2, -0.2), (0.0, -1.0), (0.2, -0.2)]
    triangle = [(0.9, 0.0), (-0.6, 0.7), (-0.5, -0.8)]
    polygons = [
        Polygon(tuple((3.6 * column + 0.3 * row + x - 17.0, 3.5 * row + y - 1.0) for x, y in shape))
        for row in range(4)
        for column, shape in enumerate([star, triangle] * 2)
    ]
    return Game(arena=Arena(-20.0, -2.0, -4.0, 14.0, polygons=tuple(polygons)), max_steps=80)


BOUNDS = Uncertainty(position=0.05, heading=0.05, speed=0.05, delay=0.1)


def course_under_errors(game, player, games, steps):
    """How one robot ended that is given extreme errors of its state by chance, and late commands by chance; and whether
    it was promised at the start that it would not fail."""
    starts = reset_batch(game, jax.random.key(4), games)
    drive, role = Drive(lag=0).at_rest(), Role.PURSUER

    def one_step(carry, key):
        state, memory, last, status, promised = carry
        keys = jax.random.split(key, 4)
        heading, speed = jax.random.rademacher(keys[0], (2,), jnp.float32)
        angle = 6.3 * jax.random.uniform(keys[1])
        own = state.pursuer
        believed = RobotState(
            x=own.x + BOUNDS.position * jnp.cos(angle),
            y=own.y + BOUNDS.position * jnp.sin(angle),
            v=jnp.maximum(own.v + BOUNDS.speed * speed, 0.0),
            heading=own.heading + BOUNDS.heading * heading,
        )
        command = (replace(drive, pending=drive.pending.at[0].set(last)),)
        seen = replace(state, robots=BySide((believed,), state.robots.evader))
        view = view_of(game, Knowledge.complete(seen, command), role)
        promised &= (state.steps > 0) | player.promises(view)
        action, memory = player(player.observation(view), memory, jax.random.bits(keys[2]))
        command = jnp.stack(game.pursuer.controls(action))
        held = jnp.where(jax.random.bernoulli(keys[3]), last, command)
        stays = (jnp.zeros(()), jnp.zeros(()))
        after = game.step_controls(state, BySide((tuple(held),), (stays,)))
        status = jnp.where(status == RobotStatus.ACTIVE, after.state.status.pursuer[0], status)
        return (after.state, memory, command, status, promised), None

    def one_game(state, key):
        start = (state, player.memory, jnp.zeros(2), state.status.pursuer[0], jnp.ones((), bool))
        return jax.lax.scan(one_step, start, jax.random.split(key, steps))[0][-2:]

    return map(np.asarray, jax.jit(jax.vmap(one_game))(starts, jax.random.split(jax.random.key(5), games)))


@pytest.mark.parametrize("make", [lambda: PAPER, pytest.param(yard, marks=pytest.mark.slow)], ids=["discs", "polygons"])
def test_shield_that_knows_the_bounds_of_errors_fails_under_none_of_them(make):
    game = replace(make(), drives=Drives(Drive(lag=0)))
    uncertain = replace(game, uncertainty=Uncertainties(pursuer=BOUNDS))
    aware, unaware = (with_shield(Reckless(), rules, Role.PURSUER) for rules in (uncertain, game))
    status, _ = course_under_errors(game, unaware, 40, 150)
    assert (status > RobotStatus.CAPTURED).sum() > 30
    status, promised = course_under_errors(uncertain, aware, 40, 150)
    assert (status <= RobotStatus.CAPTURED).all()
    assert promised.all()


class Circles(AbstractPolicy):
    """Always speeds up and turns left."""

    observation = paper.PAPER

    def __call__(self, observation, memory, bits):
        return jnp.int32(8), memory


class Amid(Starts):
    """The pursuer stands somewhere on the way of the shuttle below, the evader far away."""

    def sample(self, key, arena, bodies):
        x = jax.random.uniform(key, (), jnp.float32, 1.0, 9.0)
        return GameState.of_two(replace(robot(0.0, 5.0), x=x), robot(30.0, 30.0), jnp.int32(0))


BROOM = Shuttle(((0.0, 5.0), (10.0, 5.0)), hy=30.0, v_max=1.0, radius=0.1, a_max=5.0)
SLOW = replace(PAPER.pursuer, u1_max=0.2, v_max=0.4, radius=0.1)
SWEPT = Game(SLOW, arena=Arena(-40.0, 40.0, -40.0, 40.0), starts=Amid(), movers=Movers((BROOM,)))
SWEPT = replace(SWEPT, drives=Drives(Drive(lag=0)))
SWEPT_UNCERTAIN = replace(SWEPT, uncertainty=Uncertainties(pursuer=BOUNDS))


@pytest.mark.slow
def test_shield_that_knows_the_bounds_of_errors_stands_when_a_mover_comes():
    """The broom reaches everybody, and nobody knows for certain when its robot has come to rest."""
    games, steps = 100, 300
    status, _ = course_under_errors(SWEPT, with_shield(Circles(), SWEPT, Role.PURSUER), games, steps)
    assert (status == RobotStatus.HIT_OBSTACLE).sum() > 90
    player = with_shield(Circles(), SWEPT_UNCERTAIN, Role.PURSUER)
    status, promised = course_under_errors(SWEPT_UNCERTAIN, player, games, steps)
    assert promised.sum() > 80
    assert (status[promised] == RobotStatus.ACTIVE).all()


@pytest.mark.parametrize(("away", "promises"), [(0.3, {"certain"}), (3.0, {"certain", "uncertain"})])
def test_only_a_robot_that_certainly_stands_is_safe_beside_a_mover(away, promises):
    """One that may still roll, by the error of its speed, is not."""
    start = SWEPT.reset(jax.random.key(0))
    still = jnp.zeros(1)
    place = start.pursuer.x[None] + 0.2 + away
    movers = replace(start.movers, motion=MoverMotion(place, still + 5.0, still, still))
    knowledge = Knowledge.complete(replace(start, movers=movers), (Drive(lag=0).at_rest(),))
    found = set()
    for name, game in (("certain", SWEPT), ("uncertain", SWEPT_UNCERTAIN)):
        player = with_shield(Circles(), game, Role.PURSUER)
        if jax.jit(player.promises)(view_of(game, knowledge, Role.PURSUER)):
            found.add(name)
    assert found == promises


def test_drive_that_is_learned_says_when_commands_take_effect_among_movers():
    """Later by the learned lag, of which the game says nothing."""
    game = replace(SWEPT, drives=None)
    player = find_player("identifying:shielded:pure-pursuit", Role.PURSUER, game).policy
    view = look(game, game.reset(jax.random.key(0)), Role.PURSUER)
    estimate = player.memory[0]
    likely = estimate.drive(player.nominal, game.dt).drive.lag
    assert float(player.view_of(view, estimate).movers.age) == pytest.approx(0.1 * float(likely))
    late = replace(estimate, speeding=estimate.speeding.add(jnp.arange(6.0), jnp.full(6, 4.0)))
    seen = player.view_of(view, late)
    assert float(seen.movers.age) == pytest.approx(0.1 * float(late.drive(player.nominal, game.dt).drive.lag))
    assert float(seen.movers.age) > 0.05


def test_robot_that_no_action_is_safe_for_goes_on_with_the_last_safe_manoeuvre():
    """Beside a wall, where by its worst errors every way leads into it: it brakes to the left as it did, not right."""
    uncertain = replace(PAPER, drives=Drives(Drive(lag=0)), uncertainty=Uncertainties(pursuer=BOUNDS))
    player = with_shield(Reckless(), uncertain, Role.PURSUER)
    drives = (Drive(lag=0).at_rest(),)

    def decide(pursuer, memory):
        state = GameState.of_two(robot(*pursuer), robot(1.0, 1.0), jnp.int32(0))
        view = view_of(uncertain, Knowledge.complete(state, drives), Role.PURSUER)
        return player(player.observation(view), memory, jnp.uint32(0))

    assert player.memory[1] == -1
    decide = jax.jit(decide)
    action, (_, safe) = decide((5.0, 1.5, 0.0), player.memory)
    assert int(action) in (6, 7, 8)
    assert int(safe) >= 0
    near = (5.0, 0.03, 0.3, 0.0)
    for manoeuvre in range(3):
        action, (_, safe) = decide(near, ((), jnp.int32(manoeuvre)))
        assert int(action) == int(safe) == manoeuvre
    action, (_, safe) = decide(near, player.memory)
    assert int(safe) == -1, "it was never safe, and nothing is promised"


VALUED = Greedy(make_network("encoded", 8, 2, jax.random.key(3)))


class Swerves(AbstractContinuous):
    """Speeds up, and turns by chance."""

    observation = paper.PAPER

    def __call__(self, observation, memory, bits):
        return jnp.stack([jnp.float32(0.7), (bits >> 16).astype(jnp.float32) / 32768 - 1]), memory


@pytest.mark.parametrize(
    "make",
    [lambda: PAPER, yard, lambda: Game(arena=random_arena("caves", 3, gap=1.2))],
    ids=["discs", "polygons", "map"],
)
def test_can_stop_straight_is_sound_and_nearby_polygons_suffice(make):
    """Mostly it is known; and the clearance is that without the index of polygons, where it is not much."""
    arena, backup = (game := make()).arena, brakes(game, Role.PURSUER)
    x, y, v, heading = jax.random.uniform(jax.random.key(0), (4, 600))
    width, height = arena.x_max - arena.x_min, arena.y_max - arena.y_min
    robots = jax.vmap(RobotState)(arena.x_min + width * x, arena.y_min + height * y, 1.2 * v, 6 * heading - 3)

    @jax.jit
    @jax.vmap
    def tried(state, action):
        robot = Robot(game.pursuer, state)
        everywhere = (
            replace(backup, arena=arena, surroundings=None).clearance_after(robot, action)
            if backup.surroundings
            else 0.0
        )
        return backup.can_stop_straight(robot, action), backup.clearance_after(robot, action), everywhere

    sure, clearance, everywhere = map(np.asarray, tried(robots, jnp.arange(600) % 9))
    stops = clearance > MARGIN
    assert not (sure & ~stops).any()
    assert 0.6 < sure.sum() / stops.sum() < 1
    assert 0.1 < stops.mean() < 0.95
    if backup.surroundings:
        assert backup.surroundings.index.within.shape[-1] < sum(len(one.vertices) for one in arena.polygons) / 2
        little = everywhere <= 2 * MARGIN
        assert 60 < little.sum() < 500
        np.testing.assert_allclose(clearance[little], everywhere[little], atol=2e-5)
        assert (clearance[~little] > MARGIN).all()


def test_nearby_polygons_include_a_wall_within_reach_of_a_large_body():
    """At full speed, straight towards it and braking so, from where it just stops in time or just does not."""
    wall = Polygon(((10.0, 2.0), (11.0, 2.0), (11.0, 18.0), (10.0, 18.0)))
    game = Game(arena=Arena(0.0, 20.0, 0.0, 20.0, polygons=(wall,)), pursuer=Unicycle(radius=0.9))
    backup, away = replace(brakes(game, Role.PURSUER), manoeuvres=(1,)), jnp.linspace(2.0, 4.5, 200)
    assert backup.surroundings

    @jax.jit
    @jax.vmap
    def tried(away):
        state = RobotState(10.0 - away, jnp.float32(10.0), jnp.float32(1.2), jnp.float32(0.0))
        robot = Robot(game.pursuer, state)
        ways = backup, replace(backup, arena=game.arena, surroundings=None)
        return [one.clearance_after(robot, jnp.int32(7)) > MARGIN for one in ways]

    found, everywhere = map(np.asarray, tried(away))
    assert 0.2 < everywhere.mean() < 0.8
    np.testing.assert_array_equal(found, everywhere)


@functools.cache
def several_arenas():
    """A floor of a building, one of a few rooms, a map, discs, and robots of two kinds."""
    bodies = jax.tree.map(lambda *numbers: jnp.float32(numbers), Unicycle(radius=0.1), Unicycle(v_max=0.6, radius=0.25))
    kinds = RobotKinds(bodies, bodies, jnp.ones(2))
    names = "suite-v3/buildings-40", "suite-v2/floors-00", "suite-v2/caves-00", "suite-v1/discs-00"
    arenas = [suite_arena(*name.split("/")) for name in names]
    return Game(starts=Starts(clearance=0.15), scenario=Scenario.of(arenas, kinds), max_steps=60)


def test_shield_among_several_arenas_decides_as_by_all_edges():
    game, role = several_arenas(), Role.PURSUER
    backup = brakes(game, role)
    assert backup.surroundings.index.within.shape[-1] < game.scenario.edges.x.shape[1] / 4
    states = jax.jit(reset_batch, static_argnums=2)(game, jax.random.key(0), 800)
    x, y, v = jax.random.uniform(jax.random.key(1), (3, 800))
    moved = [states.pursuer.x + 3 * x - 1.5, states.pursuer.y + 3 * y - 1.5, 0.6 * v]
    states = eqx.tree_at(lambda states: [states.pursuer.x, states.pursuer.y, states.pursuer.v], states, moved)

    @jax.jit
    def clearances(game, states, actions):
        def tried(view, action):
            ways = backup, replace(backup, surroundings=None)
            return [way.for_view(view).clearance_after(view.own, action) for way in ways]

        return of_views(tried, game, states, role, actions)

    near, everywhere = map(np.asarray, clearances(game, states, jnp.arange(800) % 9))
    np.testing.assert_array_equal(near > MARGIN, everywhere > MARGIN)
    np.testing.assert_allclose(near[near <= MARGIN], everywhere[near <= MARGIN], atol=2e-5)
    by_arena = (everywhere > MARGIN)[np.argsort(states.variant % 4)].reshape(8, -1).mean(axis=1)
    assert ((by_arena > 0.1) & (by_arena < 0.95)).all()


@pytest.mark.slow
def test_shielded_robots_never_crash_in_several_arenas():
    game = several_arenas()
    players = [with_shield(Reckless(), game, role) for role in Role]
    outcomes = play_match(a_match(game, *players, games=16)).outcomes
    assert outcomes["captured"] + outcomes["no_result"] == 16


@pytest.mark.parametrize(
    ("make", "policy"),
    [(lambda: PAPER, VALUED), (lambda: PAPER, Swerves()), pytest.param(yard, Reckless(), marks=pytest.mark.slow)],
    ids=["discs, valued", "discs, continuous", "polygons, random"],
)
def test_batched_shield_matches_trying_all_nine_actions_in_each_game(make, policy):
    """Of those that are held back there are several blocks and a part of one."""
    game, role = make(), Role.PURSUER
    player = with_shield(policy, game, role)
    nine = jax.vmap(lambda action: jnp.stack(action_levels(action)))(jnp.arange(9))
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
            scores = policy.score(policy.observation(view), (), bits)[0]
            tried = (
                jnp.concatenate([nine, jnp.stack(action_levels(scores))[None]]) if policy.continuous else jnp.arange(9)
            )
            clearance = jax.lax.map(lambda action: player.backup.clearance_after(view.own, action), tried)
            best = policy.select(scores, clearance[:9] > MARGIN)
            stops = jnp.any(clearance[:9] > MARGIN)
            held = jnp.where(stops, best, jnp.argmax(clearance[:9]))
            return (jnp.where(clearance[9] > MARGIN, scores, nine[held]) if policy.continuous else held), stops

        return jax.lax.map(alone, (states, bits))

    guarded, (expected, stops) = np.asarray(together(player)), by_all_nine(states, bits)
    np.testing.assert_array_equal(guarded, expected)
    assert 0 < np.sum(~stops) < 100, "some are lost, and do what leaves most clearance"
    differs = guarded != np.asarray(together(policy))
    held_back = differs.reshape(500, -1).any(axis=1).sum()
    assert 8 < held_back < 492
    assert held_back % 8


@pytest.mark.parametrize(("v_min", "u1_max"), [(0.2, 0.3), (0.0, 0.0)], ids=["drives on", "does not brake"])
def test_shield_refuses_a_robot_that_cannot_stop(v_min, u1_max):
    with pytest.raises(InvalidInput, match=rf"v_min, u1_max = \({v_min}, {u1_max}\) .*can stop"):
        with_shield(Uniform(), Game(pursuer=Unicycle(v_min=v_min, u1_max=u1_max)), Role.PURSUER)


NO_BITS = jnp.zeros((), jnp.uint32)


@functools.cache
def game():
    return with_chart(find_game("one-large"))


def view(pursuer, evader, age=1e3, unseen=None):
    """What the pursuer sees that knows where the evader was some time ago, and for how long cells were not seen."""
    belief = jnp.full((COARSE, COARSE), -1.0) if unseen is None else jnp.asarray(unseen, jnp.float32)
    state = GameState.of_two(pursuer, evader, jnp.int32(0))
    knowledge = replace(Knowledge.complete(state), ages=(jnp.float32(age),), belief=belief)
    return view_of(game(), knowledge, Role.PURSUER)


@functools.cache
def decision(name):
    return eqx.filter_jit(find_player(name, Role.PURSUER, game()).policy)


def cells(*places):
    """Cells of which some were not seen for some seconds: x, y [m] and the time; no opponent can be in the others."""
    unseen = np.full((COARSE, COARSE), -1.0)
    for x, y, time in places:
        unseen[int(y * 4), int(x * 4)] = time
    return unseen


def number(x, y):
    return int(y * 4) * COARSE + int(x * 4)


def test_search_keeps_its_target_cell_until_the_opponent_cannot_be_there():
    here = robot(2.0, 2.0, 0.5, 0.0)
    ahead, behind = (8.1, 2.1), (2.1, 8.1)
    only_ahead = view(here, robot(5.0, 5.0), unseen=cells((*ahead, 50.0)))
    action, memory = decision("search")(only_ahead, jnp.int32(-1), NO_BITS)
    assert int(memory) == number(*ahead)
    assert int(action) // 3 == 2, "speeds up along its heading"
    both = view(here, robot(5.0, 5.0), unseen=cells((*ahead, 1.0), (*behind, 1e3)))
    for bits in range(20):  # it keeps its place, though another one is worth much more
        assert int(decision("search")(both, jnp.int32(number(*ahead)), jnp.uint32(bits))[1]) == number(*ahead)
    seen_empty = view(here, robot(5.0, 5.0), unseen=cells((*behind, 1e3)))
    action, memory = decision("search")(seen_empty, jnp.int32(number(*ahead)), NO_BITS)
    assert int(memory) == number(*behind)
    assert int(action) % 3 == 2, "turns to the left"
    reached = view(robot(*ahead), robot(5.0, 5.0), unseen=cells((*ahead, 1.0), (*behind, 1e3)))
    assert int(decision("search")(reached, jnp.int32(number(*ahead)), NO_BITS)[1]) == number(*behind)


def test_search_draws_target_cells_by_their_weight():
    """Of two, the one that is worth twice as much is drawn in three games of four: of uniform numbers u and v half of
    v is the larger one in every fourth."""
    near = view(robot(5.0, 1.0), robot(5.0, 9.0), unseen=cells((1.1, 1.1, 50.0), (8.9, 1.1, 25.0)))
    search = find_player("search", Role.PURSUER, game()).policy
    draw = jax.jit(jax.vmap(lambda bits: search.score(near, jnp.int32(-1), bits)[1]))
    drawn = np.asarray(draw(jnp.arange(1000, dtype=jnp.uint32)))
    assert set(drawn) == {number(1.1, 1.1), number(8.9, 1.1)}
    assert np.mean(drawn == number(1.1, 1.1)) == pytest.approx(0.75, abs=0.05)
    assert set(np.asarray(draw(jnp.arange(4, dtype=jnp.uint32)))) == set(drawn), "the bits decide"


@pytest.mark.slow
def test_searching_pursuer_heads_for_its_target_cell_while_it_sees_nothing():
    """In a game without sensors it always sees."""
    here, there, place, unseen = (
        robot(2.0, 2.0, 0.3, 1.0),
        robot(3.0, 8.0),
        robot(8.125, 2.125),
        cells((8.1, 2.1, 50.0)),
    )
    openly = look(game(), GameState.of_two(here, there, jnp.int32(0)), Role.PURSUER)
    bare, searching = (find_player(name, Role.PURSUER, game()).policy for name in ("pursuer", "searching:pursuer"))
    values = eqx.filter_jit(bare.values)
    for seen, opponent in (
        (openly, there),
        (view(here, there, 0.0, unseen), there),
        (view(here, there, 1.0, unseen), there),
        (view(here, there, 1.1, unseen), place),
        (view(here, there, 20.0, unseen), place),
    ):
        scores, (_, cell) = eqx.filter_jit(searching.score)(seen, searching.memory, NO_BITS)
        hunted = replace(openly, opponents=(replace(openly.opponent, state=opponent),))
        np.testing.assert_allclose(scores, values(hunted), rtol=1e-4)
        assert int(cell) == (number(8.1, 2.1) if opponent is place else -1)


def test_find_player_refuses_searching_for_players_that_cannot_search():
    for name, role, words in (
        ("searching:P_smooth", Role.PURSUER, "nine actions"),
        ("searching:intercept", Role.PURSUER, "finds its way by the chart"),
        ("searching:flee", Role.EVADER, "only pursuers do that"),
        ("searching:P_none", Role.PURSUER, "P_none"),
    ):
        with pytest.raises(InvalidInput, match=words):
            find_player(name, role, game())


def test_hide_leaves_the_line_of_sight_of_the_pursuer():
    """From beside the disc it drives behind it, and not towards a pursuer that waits there."""
    hide = find_player("hide", Role.EVADER, game()).policy
    act = jax.jit(lambda state: hide(look(game(), state, Role.EVADER), (), NO_BITS)[0])
    pursuer, evader = robot(1.5, 5.0), robot(7.0, 6.8, 0.5, -np.pi / 2)
    state, step = GameState.of_two(pursuer, evader, jnp.int32(0)), eqx.filter_jit(game().step)
    assert not bool(game().arena.hides(state.pursuer, state.evader))
    for _ in range(60):
        state = step(state, [jnp.int32(1)], [act(state)]).state
        state = replace(state, robots=BySide((pursuer,), state.robots.evader))
    assert bool(game().arena.hides(state.pursuer, state.evader))
    assert float(jnp.hypot(state.evader.x - 7.0, state.evader.y - 6.8)) > 0.5
