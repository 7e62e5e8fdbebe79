"""The rules against their NumPy twin, what must hold in teams, and refusals of games that nobody can play."""

import math
import subprocess
import sys
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.file import find_game, from_dict, load_game, to_dict
from apollonius.game.arena import Arena, Disc
from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle, as_action
from apollonius.game.game import Game, reset_batch
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_teams, make_game, paper, randomised
from apollonius.game.reward import Reward
from apollonius.game.scenario import Spread
from apollonius.game.sensing import Noise, Sensing, Sensors
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams
from apollonius.game.types import NUM_ACTIONS, ROLES, BySide, GameState, Outcome, RobotState, RobotStatus
from apollonius.game.validation import require_key
from apollonius.io.errors import InvalidInput
from tests.acting import clearances, state_of
from tests.oracle import numpy_teams

TEAMS = 3, 2


def in_sides(values, sizes):
    return BySide(tuple(values[: sizes[0]]), tuple(values[sizes[0] :]))


def random_game(rng, profile, sizes):
    """A small, crowded game, no two robots alike, in numbers that float32 can hold."""

    def sample(low, high):
        return float(np.float32(rng.uniform(low, high)))

    def body():
        return Unicycle(sample(-0.5, 0.5), sample(0.6, 3.0), sample(0.1, 3.0), sample(0.1, 3.0), sample(0.0, 0.2))

    corners = rng.uniform(-0.6, 0.6, 2)
    vertices = [tuple(map(float, np.float32(corners + turned))) for turned in ((0.4, 0.0), (0.0, 0.4), (-0.4, -0.4))]
    (pursuer, *pursuers), (evader, *evaders) = ([body() for _ in range(size)] for size in sizes)
    return Game(
        pursuer=pursuer,
        evader=evader,
        teams=Teams(tuple(pursuers), tuple(evaders), mates_collide=profile == "paper") if pursuers else None,
        arena=Arena(
            sample(-3.5, -3), sample(3, 3.5), sample(-4, -3), sample(3, 4),
            discs=tuple(Disc(sample(-2.5, 2.5), sample(-2.5, 2.5), sample(0.01, 0.2)) for _ in range(2)),
            polygons=(Polygon(tuple(vertices)),),
            territory=Disc(sample(-2, 2), sample(-2, 2), sample(0.1, 0.4)) if profile == "zero-sum" else None,
        ),
        capture_distance=sample(0.05, 0.4),
        dt=sample(0.05, 0.3),
        max_steps=int(rng.integers(10, 40)),
        reward=Reward(profile, sample(1, 10), sample(1, 10), sample(1, 10)),
    )  # fmt: skip


def random_status(rng, shape, sizes):
    """Robots of which one in three is out, whatever put it out; one of either side at least is in play."""
    status = np.where(rng.random((*shape, sum(sizes))) < 0.3, rng.integers(1, len(RobotStatus), (*shape, 1)), 0)
    for side in (slice(None, sizes[0]), slice(sizes[0], None)):
        nobody = (status[..., side] > 0).all(axis=-1)
        status[..., side] *= ~nobody[..., None]
    return status.astype(np.int32)


def random_places(rng, game, count):
    """Places [x, y, v, heading] of all robots, one in three at either limit of its speed: `[count, robots, 4]`."""
    arena, bodies = game.arena, [body for side in game.bodies for body in side]
    shape = count, len(bodies)
    x, y = np.moveaxis(rng.uniform((arena.x_min, arena.y_min), (arena.x_max, arena.y_max), (*shape, 2)), -1, 0)
    low, high = np.array([(body.v_min, body.v_max) for body in bodies]).T
    v = np.clip(rng.uniform(2 * low - high, 2 * high - low, shape), low, high)
    return np.stack([x, y, v, rng.uniform(-np.pi, np.pi, shape)], axis=-1).astype(np.float32)


@partial(jax.jit, static_argnames="sizes")
def step_games(games, places, statuses, steps, actions, sizes):
    """A step of each game from each of its states."""

    def one(game, places, statuses, steps, actions):
        state = GameState(in_sides([RobotState(*place) for place in places], sizes), steps, in_sides(statuses, sizes))
        return game.step(state, *in_sides(actions, sizes))

    return jax.vmap(jax.vmap(one, (None, 0, 0, 0, 0)))(games, places, statuses, steps, actions)


MANY = [pytest.param(TEAMS, profile, 100, marks=pytest.mark.slow) for profile in ("paper", "zero-sum")]


@pytest.mark.parametrize(
    ("sizes", "profile", "count"), [((1, 1), "paper", 30), ((1, 1), "zero-sum", 30), (TEAMS, "paper", 10), *MANY]
)
def test_step_matches_the_numpy_twin(sizes, profile, count):
    """Many transitions in each of many arenas; with the paper's rewards mates can collide."""
    rng, robots = np.random.default_rng(0), sum(sizes)
    games = [random_game(rng, profile, sizes) for _ in range(count)]
    shape = count, max(20, count)
    places = np.array([random_places(rng, game, shape[1]) for game in games])
    statuses = random_status(rng, shape, sizes)
    actions = rng.integers(NUM_ACTIONS, size=(*shape, robots))
    steps = rng.integers(39, size=shape)
    leaves = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *games)
    ours = step_games(leaves, *map(jnp.asarray, (places, statuses, steps, actions)), sizes)

    twins = []
    for game, *columns in zip(games, *(one.tolist() for one in (places, statuses, steps, actions)), strict=True):
        bodies = [body for side in game.bodies for body in side]
        for place, status, played, action in zip(*columns, strict=True):
            rows = zip(bodies, place, status, strict=True)
            both = [{"body": body, "place": tuple(here), "status": RobotStatus(now).name} for body, here, now in rows]
            sides = *in_sides(both, sizes), played, *in_sides(action, sizes)
            twins.append(numpy_teams.step(game, *sides, mates_collide=profile == "paper"))
    clear_cut = np.array([twin.margin > 1e-4 for twin in twins])  # closer to a threshold float32 may decide either way
    assert clear_cut.mean() > 0.99

    def same(values, expected, atol=0.0):
        np.testing.assert_allclose(np.ravel(values)[clear_cut], np.array(expected)[clear_cut], rtol=0, atol=atol)

    outcomes = np.array([Outcome[twin.outcome] for twin in twins])
    same(ours.outcome, outcomes)
    truncated = (outcomes == Outcome.NO_RESULT) & (profile == "paper")
    same(ours.truncated, truncated)
    same(ours.terminated, (outcomes != Outcome.ONGOING) & ~truncated)
    same(ours.state.steps, 1 + steps.ravel())
    possible = [outcome for outcome in Outcome if outcome != Outcome.TERRITORY_REACHED or profile == "zero-sum"]
    if count > 10:
        assert np.bincount(outcomes[clear_cut], minlength=len(Outcome))[possible].min() > 0
    for side, size in zip(("pursuer", "evader"), sizes, strict=True):
        for number in range(size):
            found = [getattr(twin, f"{side}s")[number] for twin in twins]
            same(getattr(ours.state.status, side)[number], [RobotStatus[robot["status"]] for robot in found])
            paid = [getattr(twin, f"{side}_rewards")[number] for twin in twins]
            same(getattr(ours.rewards, side)[number], paid, atol=5e-5)
            robot = getattr(ours.state.robots, side)[number]
            place = np.array([robot["place"] for robot in found])
            for name, column in (("x", 0), ("y", 1), ("v", 2)):
                same(getattr(robot, name), place[:, column], atol=2e-6)
            same(np.exp(1j * np.asarray(robot.heading)), np.exp(1j * place[:, 3]), atol=1e-6)
            assert np.all((robot.heading > -np.float32(np.pi)) & (robot.heading <= np.float32(np.pi)))


def play(game, state):
    """A step in which nobody steers."""
    return game.step(state, *([jnp.asarray(4)] * len(side) for side in state.robots))


def test_last_capture_counts_when_its_pursuer_fails_in_the_same_step():
    state = state_of([(9.95, 5, 1.2, 0), (5, 1, 0, 0)], [(9.9, 5, 0, 0), (1, 9, 0, 0)], ([0, 2], [0, 1]))
    after = play(in_teams(Game(), 2, 2), state)
    assert Outcome(int(after.outcome)) == Outcome.CAPTURED
    assert int(after.state.status.pursuer[0]) == RobotStatus.OUT_OF_RANGE
    assert [float(one) for one in after.rewards.pursuer] == [10, 0]


@pytest.mark.parametrize(("collide", "status"), [(True, RobotStatus.HIT_MATE), (False, RobotStatus.ACTIVE)])
def test_teammates_collide_only_with_mates_collide(collide, status):
    body = Unicycle(radius=0.2)
    game = in_teams(Game(body, body), 2, 1, mates_collide=collide)
    after = play(game, state_of([(2, 2, 0, 0), (2.3, 2, 0, 0)], [(8, 8, 0, 0)], ([0, 0], [0])))
    assert [RobotStatus(int(one)) for one in after.state.status.pursuer] == [status] * 2
    assert Outcome(int(after.outcome)) == (Outcome.PURSUER_HIT_OBSTACLE if collide else Outcome.ONGOING)


def test_teammates_start_apart_in_free_space_and_opponents_further():
    """The last robot of either side is smaller than its mates."""
    body, small = Unicycle(radius=0.2), Unicycle(radius=0.05)
    game = replace(paper(), pursuer=body, evader=body, teams=Teams((body, small), (small,)))
    starts = jax.jit(reset_batch, static_argnames="games")(game, jax.random.key(0), 200)
    robots = [(role, *one) for role in ROLES for one in zip(starts.robots[role], game.bodies[role], strict=True)]
    for role, robot, own in robots:
        assert clearances(game.arena, robot.x, robot.y).min() >= 0.3 + own.radius - 1e-5
        for other_role, other, its in robots:
            if other is not robot:
                apart = np.hypot(np.asarray(robot.x) - other.x, np.asarray(robot.y) - other.y)
                assert apart.min() >= (0.3 + own.radius + its.radius if role == other_role else 1.0) - 1e-5
    assert (np.array([np.asarray(one) for side in starts.status for one in side]) == 0).all()


def test_game_file_sets_the_robots_of_each_side_and_their_limits(tmp_path):
    path = tmp_path / "game.toml"
    path.write_text("evaders = 2\n[evader]\nv_max = 1.0\n[[pursuers]]\nv_max = 1.1\n[[pursuers]]\nv_max = 0.8\n")
    game = load_game(path)
    assert [[body.v_max for body in side] for side in game.bodies] == [[1.1, 0.8], [1.0, 1.0]]
    assert from_dict(Game, to_dict(game), "a record") == game
    assert "teams" not in to_dict(paper())
    path.write_text("pursuers = 0")
    with pytest.raises(InvalidInput, match="pursuers = 0 is not possible"):
        load_game(path)
    assert find_game("team-2v1/office") == in_teams(find_game("office"), 2, 1)
    assert make_game("team-3v1").duel("a table") == paper()


NAN, INF = math.nan, math.inf


def discs(*discs):
    return {"arena": Arena(discs=tuple(Disc(*disc) for disc in discs))}


def starts(**numbers):
    return {"starts": Starts(**numbers)}


def spread(field, low, high):
    return lambda: randomised(paper(), [Spread((field,), low, high)])


def misnamed_part(part, field, name):
    """A part with a name that its constructor's types would not let through."""
    object.__setattr__(part, field, name)
    return part


IMPOSSIBLE = [
    ({"dt": 0.0}, ["dt = 0.0", "more than 0 s", "uses 0.1"]),
    ({"dt": NAN}, ["dt = nan", "a finite number"]),
    ({"capture_distance": 0.0}, ["capture_distance = 0.0", "more than 0 m", "uses 0.3"]),
    ({"max_steps": 0}, ["max_steps = 0", "at least 1", "uses 1000"]),
    ({"pursuer": Unicycle(v_min=2.0, v_max=1.0)}, ["pursuer.v_min = 2.0", "at most v_max = 1.0", "exchange"]),
    ({"evader": Unicycle(v_max=0.0)}, ["evader.v_max = 0.0", "more than 0 m/s"]),
    ({"pursuer": Unicycle(v_max=-INF)}, ["pursuer.v_max = -inf", "a finite number"]),
    ({"pursuer": Unicycle(u1_max=-0.3)}, ["pursuer.u1_max = -0.3", "0 m/s^2 or more"]),
    ({"evader": Unicycle(u2_max=-0.8)}, ["evader.u2_max = -0.8", "0 rad/s or more"]),
    ({"pursuer": Unicycle(u2_max=21.0)}, ["pursuer.u2_max = 21.0", "at most 20 rad/s", "make it or dt smaller"]),
    ({"dt": 4.0}, ["pursuer.u2_max = 0.8", "at most 0.5 rad/s", "in a step of 4 s", "make it or dt smaller"]),
    ({"evader": Unicycle(radius=-0.2)}, ["evader.radius = -0.2", "0 m (a point) or more"]),
    ({"arena": Arena(x_min=10.0)}, ["arena.x_min = 10.0", "less than x_max = 10.0"]),
    ({"arena": Arena(x_min=11.0)}, ["arena.x_min = 11.0", "less than x_max = 10.0"]),
    ({"arena": Arena(y_min=11.0)}, ["arena.y_min = 11.0", "less than y_max = 10.0"]),
    (discs((3.0, 3.0, 0.0)), ["discs[0].radius = 0.0", "more than 0 m", "remove the disc"]),
    (discs((3.0, 3.0, 0.5), (7.0, 3.0, -0.5)), ["discs[1].radius = -0.5", "more than 0 m", "remove the disc"]),
    (discs((12.0, 3.0, 0.5)), ["discs[0] centre = (12.0, 3.0)", "[0.0, 10.0] x [0.0, 10.0]", "move or remove"]),
    (discs((5.0, 5.0, 8.0)), ["pursuer no place to start", "clearance of 0.3 m", "make the obstacles"]),
    (
        {
            "arena": Arena(x_max=4.0, y_max=4.0, territory=Disc(2.0, 2.0, 0.5)),
            "starts": Starts(clearance=0.5, separation=1.8),  # 2.1 m from the corner of its room to the middle
        },
        ["evader no place to start", "clearance of 0.5 m"],
    ),
    ({"evader": Unicycle(radius=6.0)}, ["evader no place to start", "clearance of 6.3 m", "arena larger"]),
    (
        {"pursuer": Unicycle(radius=4.9), "evader": Unicycle(radius=4.9), **starts(clearance=0.05)},
        ["the robots no place to start", "none of 100,000 pairs", "arena larger"],
    ),
    (starts(clearance=6.0), ["no place to start", "clearance of 6 m", "clearance smaller"]),
    (starts(clearance=-0.1), ["starts.clearance = -0.1", "0 m or more"]),
    (starts(separation=0.2), ["starts.separation = 0.2", "at least capture_distance = 0.3", "before they begin"]),
    (starts(separation=14.0), ["starts.separation = 14.0", "at most 12.", "smaller or the arena larger"]),
    (
        {"evader": Unicycle(radius=4.5), **starts(separation=10.0)},
        ["starts.separation = 10.0", "at most", "smaller or the arena larger"],
    ),
    ({"reward": Reward(capture=NAN)}, ["reward.capture = nan", "a finite number"]),
    ({"reward": misnamed_part(Reward(), "profile", "fair")}, ["reward.profile = fair", "paper or zero-sum"]),
    ({"starts": misnamed_part(Starts(), "speed", "fast")}, ["starts.speed = fast", "rest or moving"]),
    *[
        ({"arena": Arena(polygons=(Polygon(corners),))}, said)
        for corners, said in (
            (((1.0, 1.0), (3.0, 1.0)), ["2 corners is not possible: it must be 3 to 1000"]),
            (((1.0, 1.0), (3.0, 1.0), (3.0, 11.0)), ["(3, 11)", "inside the walls", "move"]),
            (((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)), ["no place to start"]),
            (((1.0, INF), (3.0, 1.0), (3.0, 11.0)), ["finite number"]),
        )
    ],
    *[
        ({"drives": Drives(evader=Drive(**{name: value}))}, [f"drives.evader.{name} = "])
        for name, value in (("lag", -1), ("lag", 1.5), ("lag", 11), ("turn_time", -0.1), ("turn_time", NAN))
    ],
    *[
        ({"sensors": Sensing(evader=Sensors(**numbers))}, [f"sensors.evader.{said}"])
        for numbers, said in (
            ({"range": -1.0}, "range = -1"),
            ({"range": NAN}, "range = nan"),
            ({"field_of_view": 7.1}, "field_of_view = 7.1"),
            ({"drop_out": 1.1}, "drop_out = 1.1"),
            ({"delay": 11}, "delay = 11"),
            ({"delay": 0.5}, "delay = 0.5"),
            ({"noise": Noise(position=-0.1)}, "noise.position = -0.1"),
            ({"own_noise": Noise(heading=-0.1)}, "own_noise.heading = -0.1"),
        )
    ],
    *[
        (spread(field, low, high), [said])
        for field, low, high, said in (
            ("pursuer.speed", 1.0, 2.0, "'speed' is none of"),
            ("drives.pursuer", 1.0, 2.0, "whole path"),
            ("drives", 1.0, 2.0, "whole path"),
            ("evader", 1.0, 2.0, "whole path"),
            ("pursuer.v_max.x", 1.0, 2.0, "whole path"),
            ("drives.pursuer.lag", 2.0, 1.0, "low = 2"),
            ("drives.pursuer.lag", 0.0, 11.0, "drives.pursuer.lag = "),
            ("sensors.evader.drop_out", 0.0, 1.5, "sensors.evader.drop_out = "),
        )
    ],
    (lambda: in_teams(Game(arena=Arena(x_max=2.5, y_max=2.5)), 9, 9), ["teams = 9 v 9 is not possible", "fit"]),
    (lambda: make_game("team-17v1"), ["pursuers = 17 is not possible"]),
    (lambda: make_game("team-0v1"), ["pursuers = 0 is not possible"]),
    (lambda: make_game("team-3v1").require_two("a policy"), ["robots = 3 v 1", "a policy knows games of two"]),
    (lambda: Game(teams=Teams((Unicycle(v_max=2.0),))).duel("a table"), ["alike on either side"]),
]


@pytest.mark.parametrize(("change", "said"), IMPOSSIBLE, ids=[said[0] for _, said in IMPOSSIBLE])
def test_impossible_value_is_named_with_its_bound_and_the_remedy(change, said):
    with pytest.raises(ValueError, match=r"\.$") as refusal:
        change() if callable(change) else Game(**change)
    message = str(refusal.value)
    assert "\n" not in message
    for words in said:
        assert words in message


def test_actions_may_be_plain_numbers_and_enumerations_print_names():
    game = make_game("paper")
    state = game.reset(jax.random.key(0))
    plain, same = game.step(state, 8, [1]), game.step(state, jnp.int32(8), jnp.int32(1))
    assert jax.tree.leaves(plain) == jax.tree.leaves(same)
    assert f"{Outcome(int(plain.outcome))} {RobotStatus(3)} {ROLES.evader}" == "ONGOING OUT_OF_RANGE EVADER"
    for act, said in (
        (lambda: game.step(state, 9, 1), "action = 9 .* from 0 to 8"),
        (lambda: as_action(np.float32(4.5)), "action = 4.5 .* two real ones"),
        (lambda: as_action(np.int64(12)), "action = 12 .* from 0 to 8"),
        (lambda: as_action("up"), "action = up .* a whole number from 0 to 8"),
        (lambda: as_action(True), "action = true .* a whole number from 0 to 8"),
        (lambda: require_key(3), r"key = 3 .* as jax.random.key\(3\)"),
        (lambda: require_key(jnp.int32(3)), r"key = 3 .* a key of JAX"),
        (lambda: game.step(state, [8, 8], 1), r"pursuer_action = \[8, 8\] .* 1 in number"),
    ):
        with pytest.raises(InvalidInput, match=said):
            act()
    assert as_action(np.int64(1)) == 1


@pytest.mark.slow
def test_reset_refuses_a_seed_in_place_of_a_key():
    """In a process of its own, where types are not checked."""
    said = subprocess.run(
        [sys.executable, "-c", "import apollonius; apollonius.make_game('paper').reset(7)"],
        capture_output=True, text=True, check=False,
    ).stderr  # fmt: skip
    assert said.splitlines()[-1].endswith("key = 7 is not possible: it must be a key of JAX, as jax.random.key(7).")


@pytest.mark.parametrize(
    ("setting", "value", "said"),
    [
        ("jax_threefry_partitionable", False, "true: a seed means other games"),
        ("jax_default_prng_impl", "rbg", "threefry2x32: a seed"),
        ("jax_random_seed_offset", 5, "0: a seed"),
        ("jax_default_matmul_precision", "bfloat16", "highest: everything here is in single"),
        ("jax_transfer_guard", "disallow", "allow: numbers are sent"),
    ],
)
def test_jax_settings_that_change_numbers_are_refused(setting, value, said):
    before = getattr(jax.config, setting)
    jax.config.update(setting, value)
    try:
        with pytest.raises(InvalidInput, match=f"{setting.upper()} = .* must be {said}.*; unset it"):
            Game()
    finally:
        jax.config.update(setting, before)
    with jax.default_matmul_precision("highest"):
        Game()


def test_fast_math_flags_of_xla_are_refused(monkeypatch):
    for flags, name in (("", "cpu_enable_fast_math"), ("--xla_x=1 ", "gpu_enable_fast_min_max=true")):
        monkeypatch.setenv("XLA_FLAGS", f"{flags}--xla_{name}")
        with pytest.raises(InvalidInput, match=r"XLA_FLAGS = .* without fast-math"):
            Game()
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_enable_fast_math=false --xla_cpu_prefer_vector_width=512")
    Game()


@pytest.mark.parametrize(
    "change",
    [
        {"max_steps": 1},
        {"dt": 2.5},
        {"evader": Unicycle(v_min=0.5, v_max=0.5, u1_max=0.0, u2_max=0.0)},
        {"evader": Unicycle(radius=4.5), **starts(separation=6.0)},
        {"sensors": Sensing(evader=Sensors())},
        discs((0.0, 10.0, 0.5)),
        starts(clearance=0.0, separation=0.3),
        starts(separation=12.5),
    ],
)
def test_values_just_within_their_bounds_are_accepted(change):
    Game(**change)
