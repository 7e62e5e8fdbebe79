"""Things that move by themselves: bounds of their motion, contact, starts, what players see of them, files."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.file import find_game, from_dict, load_game, to_dict
from apollonius.evaluate.match import Match, draw_starts, record_game
from apollonius.exploit.attackers import planner_against
from apollonius.game.arena import Arena
from apollonius.game.game import Game, reset_batch
from apollonius.game.movers import MoverBodies, Movers
from apollonius.game.presets import make_game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.timetable import Door, Shuttle
from apollonius.game.types import MoverMotion, Outcome, RobotStatus, Role
from apollonius.game.walkers import Walkers
from apollonius.io.document import to_json
from apollonius.io.errors import InvalidInput
from apollonius.observe import tracking
from apollonius.observe.view import look, view_of
from apollonius.play.replay import as_data, load_replay, play_actions, save_replay
from apollonius.show.canvas import Canvas
from apollonius.show.palette import OTHER
from apollonius.solve.motion import motion_of
from tests.acting import robot, state
from tests.oracle import numpy_game, numpy_movers

DOORS = (Door(2.7, 6.1, -0.7, 0.0), Door(13.7, 6.1, 0.7, 0.0, period=12.0, share_open=0.6))
SHUTTLES = (
    Shuttle(((2.0, 2.0), (8.0, 2.0), (8.0, 8.5)), pause=1.0),
    Shuttle(((1.0, 9.0), (9.0, 9.2)), hx=0.3, hy=0.1, radius=0.1, v_max=1.5, a_max=0.4),
    Shuttle(((5.0, 1.0), (5.2, 1.0)), v_max=2.0),
)
OFFICE = replace(find_game("office"), movers=Movers(doors=DOORS, walkers=(Walkers(7), Walkers(3, 0.2, 0.8, 1.0))))
PAPER = replace(make_game("paper"), movers=Movers(SHUTTLES, walkers=(Walkers(4, v_max=2.0, a_max=0.6),)))
GAMES = {
    "office": OFFICE,
    "paper": PAPER,
    "empty": replace(make_game("paper"), arena=Arena(), movers=Movers(walkers=(Walkers(30),)), dt=0.2),
    "by the clock": replace(make_game("paper"), movers=Movers(SHUTTLES)),
}
STANDING = jnp.int32(4)


def course(game, games, steps, seed=0):
    """All states of games in which no robot moves: leaves `[steps + 1, games, ...]`."""

    @jax.jit
    def play(key):
        start = reset_batch(game, key, games)
        step = jax.vmap(lambda state: game.step(state, STANDING, STANDING).state)
        _, states = jax.lax.scan(lambda state, _: (step(state), state), start, length=steps + 1)
        return states

    return play(jax.random.key(seed))


@pytest.fixture(scope="module", params=GAMES)
def played(request):
    game = GAMES[request.param]
    return game, jax.tree.map(np.asarray, course(game, 12, 400))


def test_movers_keep_their_bounds(played):
    """Top speeds and accelerations; in a step each goes by the velocity that it then has."""
    game, states = played
    motion, bodies, dt = states.movers.motion, jax.tree.map(np.asarray, game.movers.bodies), game.dt
    speeds = np.hypot(motion.vx, motion.vy)
    changes = np.hypot(np.diff(motion.vx, axis=0), np.diff(motion.vy, axis=0))
    assert (speeds <= bodies.v_max + 1e-4).all()
    assert (changes <= bodies.a_max * dt + 1e-4).all()
    assert (speeds.max(axis=(0, 1)) > 0.5 * np.minimum(bodies.v_max, 0.6)).all(), "each moves"
    np.testing.assert_allclose(np.diff(motion.x, axis=0), motion.vx[1:] * dt, atol=1e-5)
    np.testing.assert_allclose(np.diff(motion.y, axis=0), motion.vy[1:] * dt, atol=1e-5)


def test_walkers_never_leave_the_floor(played):
    game, states = played
    timed, motion = len(game.movers.timed), states.movers.motion
    x, y = motion.x[..., timed:], motion.y[..., timed:]
    clearance = jax.jit(jax.vmap(game.arena.clearance))(jnp.asarray(x.ravel()), jnp.asarray(y.ravel()))
    room = np.asarray(clearance).reshape(x.shape) - np.asarray(game.movers.bodies.radius[timed:])
    assert (room > 0).all()
    for step, index, number in np.random.default_rng(0).integers((400, 12, max(x.shape[2], 1)), size=(100, 3)):
        if not x.shape[2]:
            continue
        places = [(x[when, index, number], y[when, index, number], 0, 0) for when in (step, step + 1)]
        radius = float(game.movers.bodies.radius[timed + number])
        assert min(numpy_game.gaps(game.arena, radius, *places)) > 0


def test_walkers_walk_on():
    """Nobody is stuck: in half a minute each walker is somewhere else."""
    states = course(OFFICE, 12, 1500)
    motion = states.movers.motion
    x, y = motion.x[..., 2:], motion.y[..., 2:]
    moved = np.array([np.hypot(x[step] - x[step - 300], y[step] - y[step - 300]) for step in range(300, 1500, 100)])
    assert (moved.max(axis=0) > 1).all()
    assert np.hypot(motion.vx, motion.vy)[..., 2:].mean() > 0.2


def test_movers_stay_within_their_reach(played):
    """Of what a player sees, whatever they do for the next one and a half seconds."""
    game, states = played
    bodies, dt, rng = game.movers.bodies, game.dt, np.random.default_rng(0)
    motion = jax.tree.map(jnp.asarray, states.movers.motion)

    @jax.jit
    @jax.vmap
    def distances(now, index, later, x, y, to_x, to_y):
        seen, before, after = (
            jax.tree.map(lambda leaf, step=step: leaf[step, index], motion)
            for step in (now, now + later, now + later + 1)
        )
        move = robot_at(x, y), robot_at(to_x, to_y)
        bound = bodies.distance_from_reach(seen, *move, later.astype(jnp.float32) * dt, dt)
        return bound, bodies.distance_along(before, after, *move)

    rows = [jnp.asarray(rng.integers(most, size=2000), jnp.int32) for most in (380, 12, 15)]
    places = rng.uniform(0, 10, (2, 2000)).astype(np.float32)
    ends = places + rng.uniform(-0.1, 0.1, places.shape).astype(np.float32)
    bound, actual = distances(*rows, *map(jnp.asarray, (*places, *ends)))
    assert (bound <= actual + 1e-4).all()
    assert (actual - bound).min() < 0.1, "and some come close to its edge"


@pytest.mark.parametrize("mover", [*SHUTTLES, *DOORS], ids=lambda mover: type(mover).__name__)
def test_places_by_the_clock_match_the_oracle(mover):
    legs, period = (numpy_movers.legs_of if isinstance(mover, Shuttle) else numpy_movers.legs_of_door)(mover)
    assert float(mover.period) == pytest.approx(period, rel=1e-5)
    clocks = np.linspace(0, period, 500, endpoint=False)
    ours = jax.jit(jax.vmap(mover.place))(jnp.asarray(clocks, jnp.float32))
    expected = [numpy_movers.place_at(legs, clock, mover.v_max, mover.a_max) for clock in clocks]
    np.testing.assert_allclose(np.stack(ours, axis=1), expected, atol=1e-4)


def test_contact_along_a_step_matches_the_oracle():
    """20,000 steps of a robot past a capsule, half of which are discs, some of both standing still."""
    count, rng = 20_000, np.random.default_rng(0)
    start, centre = rng.uniform(-1, 1, (2, count, 2))
    end = start + rng.normal(size=(count, 2)) * rng.choice([0.0, 0.1, 1.0], (count, 1))
    centre_after = centre + rng.normal(size=(count, 2)) * rng.choice([0.0, 0.1, 1.0], (count, 1))
    axis = rng.normal(size=(count, 2)) * rng.choice([0.0, 0.5], (count, 1))
    radius, body = rng.uniform(0.05, 0.4, (2, count))
    places = [rng_places.astype(np.float32) for rng_places in (start, end, centre, centre_after, axis)]
    passes = numpy_movers.capsule_passes(*(place.astype(float) for place in places)) - radius
    numbers = [jnp.asarray(column) for place in places for column in place.T]

    @jax.jit
    @jax.vmap
    def distance(x, y, to_x, to_y, at_x, at_y, later_x, later_y, hx, hy, radius):
        movers = MoverBodies(hx[None], hy[None], radius[None], jnp.ones(1), jnp.ones(1))
        still = jnp.zeros(1)
        motion, moved = (MoverMotion(x[None], y[None], still, still) for x, y in ((at_x, at_y), (later_x, later_y)))
        return movers.distance_along(motion, moved, robot_at(x, y), robot_at(to_x, to_y))[0]

    ours = np.asarray(distance(*numbers, jnp.asarray(radius, jnp.float32)))
    clear_cut = np.abs(passes - body) > 1e-5
    assert clear_cut.mean() > 0.999
    assert 0.2 < (passes < body).mean() < 0.8
    np.testing.assert_array_equal((ours < body)[clear_cut], (passes < body)[clear_cut])
    np.testing.assert_allclose(ours, passes, atol=2e-5)


def robot_at(x, y):
    return replace(robot(0, 0), x=x, y=y)


def facing(game, speed, offset):
    """A pursuer that heads for the path of a shuttle at the start of its period, and the evader far away."""
    start = state((5.0, 5.0 + offset, speed, math.pi / 2), (1.0, 1.0))
    x, y = game.movers.shuttles[0].waypoints[0]
    motion = MoverMotion(*(jnp.array([value], jnp.float32) for value in (x, y, 0, 0)))
    movers = game.reset(jax.random.key(0)).movers
    return replace(start, movers=replace(movers, clocks=jnp.zeros(1), motion=motion))


@pytest.mark.parametrize(("speed", "action", "outcome"), [
    (0.0, 4, Outcome.ONGOING),  # stands while it is walked into
    (0.0, 5, Outcome.ONGOING),  # turns in its place
    (0.0, 7, Outcome.PURSUER_HIT_OBSTACLE),  # starts
    (0.02, 1, Outcome.PURSUER_HIT_OBSTACLE),  # stops in this step
])  # fmt: skip
def test_robot_at_rest_may_be_walked_into(speed, action, outcome):
    game = replace(make_game("paper"), arena=Arena(), movers=Movers((Shuttle(((4.8, 5.1), (5.8, 5.1))),)))
    start = facing(game, speed, 0.0)
    timestep = jax.jit(game.step)(start, jnp.int32(action), STANDING)
    assert int(timestep.outcome) == outcome


def test_robot_is_hit_between_the_ends_of_a_step():
    """A mover and a robot that are apart before and after the step, but cross in between."""
    game = replace(
        make_game("paper"), arena=Arena(), dt=0.5,
        movers=Movers((Shuttle(((4.0, 5.5), (6.0, 5.5)), radius=0.1, v_max=4.0, a_max=100.0),)),
    )  # fmt: skip
    game = replace(game, pursuer=replace(game.pursuer, v_max=4.0, radius=0.05))
    start = facing(game, 4.0, -0.6)
    after = jax.jit(game.step)(start, STANDING, STANDING)
    apart = game.movers.bodies.distance_along
    for motion, place in ((start.movers.motion, start.pursuer), (after.state.movers.motion, after.state.pursuer)):
        assert apart(motion, motion, place, place)[0] > 0.3
    assert int(after.outcome) == Outcome.PURSUER_HIT_OBSTACLE


def test_movers_start_on_the_floor_away_from_robots():
    starts = jax.jit(lambda key: reset_batch(OFFICE, key, 300))(jax.random.key(1))
    motion, bodies = starts.movers.motion, OFFICE.movers.bodies
    clearance = jax.vmap(jax.vmap(OFFICE.arena.clearance))(motion.x[:, 2:], motion.y[:, 2:])
    assert (np.asarray(clearance) > np.asarray(bodies.radius[2:])).all()
    assert (motion.vx[:, 2:] == 0).all()
    distance = jax.vmap(lambda motion, place: bodies.distance_along(motion, motion, place, place))
    room = np.min([distance(motion, side[0]) for side in starts.robots], axis=(0, 2)) - OFFICE.pursuer.radius
    assert (room > OFFICE.starts.clearance - 1e-4).mean() > 0.99
    assert len(np.unique(starts.movers.clocks)) == 600
    assert len(np.unique(starts.movers.bits)) == 3000


def test_robots_start_as_without_movers_but_for_the_key():
    """A game without movers has no leaf more than before."""
    assert make_game("paper").reset(jax.random.key(0)).movers is None
    bare = jax.tree.leaves(replace(OFFICE, movers=None).reset(jax.random.key(0)))
    assert len(jax.tree.leaves(OFFICE.reset(jax.random.key(0)))) == len(bare) + 8


def test_course_follows_from_the_start():
    first, second, other = (course(PAPER, 3, 50, seed).movers for seed in (0, 0, 1))
    for ours, again in zip(*map(jax.tree.leaves, (first, second)), strict=True):
        np.testing.assert_array_equal(ours, again)
    assert not np.array_equal(first.motion.x, other.motion.x)


def test_players_see_places_and_velocities_but_no_plans():
    start = OFFICE.reset(jax.random.key(0))
    view = look(OFFICE, start, Role.PURSUER)
    assert view.movers.in_sight is None
    np.testing.assert_array_equal(view.movers.motion.x, start.movers.motion.x)
    names = {str(path) for path, _ in jax.tree_util.tree_leaves_with_path(view.movers)}
    assert not any(word in name for name in names for word in ("goal", "clock", "bits"))
    assert look(make_game("paper"), make_game("paper").reset(jax.random.key(0)), Role.PURSUER).movers is None


def test_sensors_limit_which_movers_are_seen():
    sensors = Sensors(line_of_sight=True, range=4.0)
    game = replace(OFFICE, sensors=Sensing(pursuer=sensors))
    start = game.reset(jax.random.key(2))
    track = tracking.init_track(game, start, Role.PURSUER)
    _, knowledge = tracking.sense_and_update(game, Role.PURSUER, track, start, jnp.uint32(0))
    movers = view_of(game, knowledge, Role.PURSUER).movers
    motion, own = start.movers.motion, start.pursuer
    near = np.hypot(motion.x - own.x, motion.y - own.y) <= 4
    hidden = [bool(game.arena.hides(own, robot(x, y))) for x, y in zip(motion.x, motion.y, strict=True)]
    np.testing.assert_array_equal(movers.in_sight, near & ~np.array(hidden))
    assert 0 < movers.in_sight.sum() < 12
    assert (np.asarray(movers.motion.x)[~np.asarray(movers.in_sight)] == 0).all()


FILE = """
[[movers.shuttles]]
waypoints = [[1, 1], [5, 1]]
[[movers.doors]]
x = 5
y = 5
hx = 0.5
hy = 0
period = 10
[[movers.walkers]]
count = 3
v_max = 1
"""


def test_movers_of_a_file_come_back_from_their_record(tmp_path):
    path = tmp_path / "people.toml"
    path.write_text(FILE)
    game = load_game(path)
    assert game.movers == Movers(
        (Shuttle(((1.0, 1.0), (5.0, 1.0))),), (Door(5.0, 5.0, 0.5, 0.0, period=10.0),), (Walkers(3, v_max=1.0),)
    )
    assert from_dict(Game, to_dict(game), "a record") == game


@pytest.mark.parametrize(("old", "new", "said"), [
    ("[5, 1]]", "[11, 1]]", "movers.shuttles[0].waypoints[1]"),
    ("[[1, 1], [5, 1]]", "[[1, 1]]", "movers.shuttles[0].waypoints"),
    ("[5, 1]]", "[1, 1]]", "movers.shuttles[0].waypoints"),
    ("[[1, 1], [5, 1]]", "7", "movers.shuttles.waypoints = 7 is not possible: it must be a list"),
    ("[5, 1]]", "[5, 1]]\nradius = 0", "movers.shuttles[0].radius"),
    ("[5, 1]]", "[5, 1]]\na_max = 0", "movers.shuttles[0].a_max"),
    ("[5, 1]]", "[5, 1]]\npause = -1", "movers.shuttles[0].pause"),
    ("hx = 0.5", "hx = 0", "movers.doors[0].hx, hy"),
    ("period = 10", "period = 5", "movers.doors[0].period"),
    ("period = 10", "period = 10\nshare_open = 1", "movers.doors[0].share_open"),
    ("x = 5", "x = 15", "movers.doors[0] centre"),
    ("count = 3", "count = 0", "movers.walkers[0].count"),
    ("count = 3", "count = 2.5", "movers.walkers.count"),
    ("v_max = 1", "v_max = 0", "movers.walkers[0].v_max"),
    ("v_max = 1", "radius = 6", "movers.walkers[0].radius"),
    ("v_max = 1", "speed = 1", "speed"),
    ("v_max = 1", "a_max = inf", "a_max"),
])  # fmt: skip
def test_each_error_in_a_file_is_one_line_that_names_the_value(old, new, said, tmp_path):
    path = tmp_path / "people.toml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(InvalidInput) as error:
        load_game(path)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_replay_plays_again_to_the_same_bits(tmp_path):
    match = Match.of_names(replace(PAPER, max_steps=60), "pure-pursuit", "flee", games=3, seed=1)
    replay = record_game(match, 1)
    assert replay.first_difference() is None
    save_replay(replay, tmp_path / "replay.json")
    loaded = load_replay(tmp_path / "replay.json")
    assert loaded.first_difference() is None
    start = jax.tree.map(lambda leaf: leaf[1], draw_starts(match)[0])
    played = play_actions(match.game, start, jnp.asarray(replay.actions))[0].movers.motion
    np.testing.assert_array_equal(loaded.mover_places(), np.stack([played.x, played.y], axis=-1))
    steps = np.hypot(*np.diff(loaded.mover_places(), axis=0).T)
    assert (steps.max(axis=1) > 0.01).all()
    statuses = loaded.trajectory().states.status
    assert (int(statuses.pursuer[0][-1]) == RobotStatus.ACTIVE) == (replay.outcome != Outcome.PURSUER_HIT_OBSTACLE)


@pytest.mark.parametrize("damage", [
    lambda data: data.pop("movers"),
    lambda data: data["movers"].pop(),
    lambda data: data["movers"][0].pop(),
    lambda data: data["movers"].__setitem__(0, ["x"]),
    lambda data: data["movers"][0].__setitem__(0, 1e9),
    lambda data: data["game"].pop("movers"),
])  # fmt: skip
def test_replay_with_other_movers_than_its_game_is_refused(damage, tmp_path):
    replay = record_game(Match.of_names(replace(PAPER, max_steps=5), "still", "still", games=1), 0)
    data = as_data(replay)
    damage(data)
    path = tmp_path / "replay.json"
    path.write_text(to_json(data))
    with pytest.raises(InvalidInput, match="movers"):
        load_replay(path)


def test_picture_shows_movers_in_their_places():
    canvas = Canvas(PAPER)
    places = [(2.0 + number, 9.5) for number in range(7)]
    canvas.move([1.0, 1.0, 0.0, 0.0, 9.0, 1.0, 0.0, 0.0], [True, True], places)
    picture = np.asarray(canvas.picture())
    scale = len(picture) / 10
    other = tuple(bytes.fromhex(OTHER[1:]))
    for x, y in places:
        assert tuple(picture[round((10 - y) * scale), round(x * scale)]) == other


REFUSALS = {
    "table": lambda game: motion_of(game, Role.PURSUER, 1),
    "planner": lambda game: planner_against(NamedPlayer("still", Still()), Role.EVADER, game),
}


@pytest.mark.parametrize("caller", REFUSALS)
def test_who_does_not_know_movers_refuses_them(caller):
    with pytest.raises(InvalidInput, match="movers = in the game is not possible: it must be left out"):
        REFUSALS[caller](OFFICE)


def test_game_with_movers_needs_a_state_with_them():
    start = replace(OFFICE, movers=None).reset(jax.random.key(0))
    with pytest.raises(InvalidInput, match="movers"):
        OFFICE.step(start, 4, 4)


def test_empty_table_of_movers_is_refused():
    with pytest.raises(InvalidInput, match="movers = empty"):
        replace(make_game("paper"), movers=Movers())
