"""Cars, wheels and omnidirectional wheels: their motion against an ODE solver, their limits, files, and players."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from apollonius.agents.wrappers.backup import Backup, brakes
from apollonius.agents.wrappers.shield import with_shield
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import from_dict, to_dict
from apollonius.catalogue import find_player
from apollonius.evaluate.match import play_match
from apollonius.export.parity import cases_of, compare_decisions
from apollonius.export.player import find_exportable
from apollonius.game.arena import Arena
from apollonius.game.car import Car
from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.models import MODELS
from apollonius.game.omni import Omni
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.teams import Teams
from apollonius.game.types import Role
from apollonius.game.uncertainty import Uncertainties, Uncertainty
from apollonius.game.wheels import Wheels
from apollonius.io.errors import InvalidInput
from apollonius.observe.braking import clearances_after
from apollonius.observe.surroundings import Surroundings
from apollonius.observe.view import Robot
from apollonius.simulate.drive import RobotHardware
from apollonius.simulate.physics import mjcf
from jaxpr2c import CompiledProgram, translate
from tests.acting import a_match, robot
from tests.jaxpr2c.gcc import needs_gcc

DT = 0.1
ROBOTS = {
    "unicycle": Unicycle(v_min=-0.6),
    "car": Car(),
    "wheels": Wheels(v_min=-1.0, v_max=1.2, u2_max=2.0),
    "omni": Omni(v_min=-0.5),
}
"""One of each kind, all of which may drive backwards."""
PAPER = make_game("paper")


def turn_rate(body, u2, v):
    """The turn rate by textbook formulas [rad/s]."""
    if isinstance(body, Car):
        return v * math.tan(u2) / body.wheelbase
    if isinstance(body, Wheels):
        limit = (body.wheel_speed - abs(v)) / (body.track / 2)
        return min(max(u2, -limit), limit)
    if isinstance(body, Omni):
        limit = body.lateral_acceleration / max(abs(v), 1e-9)
        return min(max(u2, -limit), limit)
    return u2


def final_state(body, start, u1, u2, seconds):
    """The end of a motion under constant controls, by an ODE solver, with the speed within its limits."""
    limit = (body.v_max if u1 > 0 else body.v_min) if start[2] * u1 >= 0 else 0.0

    def speed(time):
        v = start[2] + u1 * time
        return min(v, limit) if u1 > 0 else max(v, limit)

    def rate(time, place):
        v = speed(time)
        return [v * math.cos(place[2]), v * math.sin(place[2]), turn_rate(body, u2, v)]

    ends = solve_ivp(rate, (0, seconds), [start[0], start[1], start[3]], max_step=seconds / 50, rtol=1e-9).y[:, -1]
    return ends[0], ends[1], speed(seconds), ends[2]


def errors(body, start, u1, u2):
    """Distances of a step's end from the ODE solver's: place [m], speed [m/s] and heading [rad]."""
    after = body.move(robot(*start), jnp.float32(u1), jnp.float32(u2), DT)
    x, y, v, heading = final_state(body, start, u1, u2, DT)
    turned = abs(math.remainder(float(after.heading) - heading, math.tau))
    return math.hypot(after.x - x, after.y - y), abs(float(after.v) - v), turned


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("v", [-0.45, -0.02, 0.0, 0.02, 0.4, 1.18])
def test_step_at_constant_speed_or_rate_matches_an_ode_solver(name, v):
    """A car's arc is exact while its speed changes; where a limit moves with the speed, the step keeps below it."""
    body = ROBOTS[name]
    for u1 in (-0.3, 0.0, 0.3):
        for share in (-1.0, 0.0, 0.5, 1.0):
            place, speed, heading = errors(body, (1.0, 2.0, v, 2.0), u1, share * body.u2_max)
            moving_limit = name in ("wheels", "omni") and u1 != 0
            assert speed < 1e-6
            assert heading < (0.03 if moving_limit else 3e-6)
            assert place < (3e-3 if moving_limit else 3e-5)


def random_course(body, steps=3000):
    """States of a robot under random actions, leaves `[steps]`."""
    actions = jax.random.randint(jax.random.key(0), (steps,), 0, 9)

    def step(state, action):
        after = body.move(state, *body.controls(action), DT)
        return after, after

    return jax.jit(lambda: jax.lax.scan(step, robot(0, 0), actions)[1])()


def turn_rates(course):
    """The turn rates between the states of a course [rad/s]."""
    return np.abs(np.angle(np.exp(1j * np.diff(np.asarray(course.heading, float))))) / DT


def fastest(course):
    """The higher of the speeds before and after each step [m/s]."""
    speeds = np.abs(np.asarray(course.v, float))
    return np.maximum(speeds[1:], speeds[:-1])


def test_wheels_never_turn_faster_than_they_can():
    body = ROBOTS["wheels"]
    course = random_course(body)
    outer = fastest(course) + turn_rates(course) * body.track / 2
    assert body.wheel_speed - 1e-3 < outer.max() < body.wheel_speed + 1e-4


def test_omni_keeps_within_its_lateral_acceleration_and_takes_any_course_at_rest():
    body = ROBOTS["omni"]
    course = random_course(body)
    across, rates = turn_rates(course) * fastest(course), turn_rates(course)
    assert across.max() == pytest.approx(body.lateral_acceleration, abs=1e-3)
    assert rates.max() == pytest.approx(body.u2_max, abs=1e-3)


def test_car_turns_with_its_way_and_not_at_rest():
    body = ROBOTS["car"]
    course = random_course(body)
    place = np.stack([course.x, course.y]).astype(float)
    way = np.hypot(*np.diff(place, axis=1))
    sharpest = math.tan(body.u2_max) / body.wheelbase
    assert np.max(turn_rates(course) * DT - sharpest * way) < 3e-4  # a chord is shorter than its arc
    assert float(body.turning_radius) == pytest.approx(1 / sharpest, rel=1e-5)
    still = body.move(robot(1, 1, 0, 0.7), jnp.float32(0), jnp.float32(body.u2_max), DT)
    assert (float(still.x), float(still.heading)) == (1.0, pytest.approx(0.7))


@pytest.mark.parametrize("name", ROBOTS)
def test_robot_that_brakes_is_at_rest_before_it_reverses(name):
    body = ROBOTS[name]
    for v, u1 in ((0.02, -0.3), (-0.02, 0.3)):
        at_rest = body.move(robot(0, 0, v), jnp.float32(u1), jnp.float32(0), DT)
        assert float(at_rest.v) == 0.0
        assert float(at_rest.x) == pytest.approx(v * abs(v) / (2 * 0.3), abs=1e-7)
        assert float(body.move(at_rest, jnp.float32(u1), jnp.float32(0), DT).v) == pytest.approx(u1 * DT)


@pytest.mark.parametrize("name", ROBOTS)
def test_fastest_speed_on_an_arc_drives_it_and_a_higher_one_does_not(name):
    body = replace(ROBOTS[name], v_max=1.1)
    for radius in (0.3, 0.8, 3.0):
        v = float(body.fastest_on_arc(jnp.float32(radius)))
        speeds = np.linspace(1e-3, 1.1, 2000)
        possible = [speed for speed in speeds if turn_rate(body, body.u2_max, speed) * radius >= speed]
        assert v == pytest.approx(max(possible, default=1.1), abs=2e-3)


@pytest.mark.parametrize("name", ROBOTS)
def test_usual_turn_rate_is_that_at_half_the_top_speed(name):
    body = replace(ROBOTS[name], v_max=1.2)
    assert float(body.usual_turn_rate) == pytest.approx(turn_rate(body, body.u2_max, 0.6), rel=1e-5)


# ---- files and checks


@pytest.mark.parametrize("name", MODELS)
def test_model_is_read_from_files_and_written_to_them(name):
    table = {"pursuer": {"model": name, "v_max": 0.9, "radius": 0.2}}
    game = from_dict(Game, table, "a file")
    assert type(game.pursuer) is MODELS[name]
    assert (game.pursuer.v_max, game.pursuer.radius) == (0.9, 0.2)
    assert from_dict(Game, to_dict(game), "a file") == game
    assert to_dict(game)["pursuer"].get("model", "unicycle") == name


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"model": "bike"}, "model = bike .* one of unicycle, car, wheels, omni"),
        ({"model": 3}, "model = 3"),
        ({"model": "car", "track": 0.3}, "a robot of model 'car': .*'track'"),
        ({"model": "car", "wheelbase": 0.0}, r"pursuer.wheelbase = 0.0 .* more than 0 m"),
        ({"model": "car", "u2_max": 1.6}, r"pursuer.u2_max = 1.6 .* less than pi / 2"),
        ({"model": "car", "u2_max": 1.5, "wheelbase": 0.05}, "at most 2.0 rad, not 33.8"),
        ({"model": "wheels", "track": 0.0}, "pursuer.track = 0.0"),
        ({"model": "wheels", "v_max": 1.3}, r"pursuer.v_max = 1.3 .* at most wheel_speed = 1.2 m/s"),
        ({"model": "wheels", "v_min": -1.3}, "pursuer.v_min = -1.3"),
        ({"model": "omni", "lateral_acceleration": -0.1}, "pursuer.lateral_acceleration = -0.1"),
        ({"model": "omni", "u2_max": 21.0}, "u2_max = 21.0 .* at most 20 rad/s"),
    ],
    ids=str,
)
def test_impossible_robots_are_refused(table, message):
    with pytest.raises(InvalidInput, match=message):
        from_dict(Game, {"pursuer": table}, "a file")


def test_mates_are_of_one_kind():
    with pytest.raises(InvalidInput, match=r"pursuers.model = car, unicycle .* one kind for all robots of a side"):
        Game(Car(), teams=Teams((Unicycle(),)))
    assert Game(Car(), Omni(), teams=Teams((Car(wheelbase=0.5),))).size == "2 v 1"


def test_those_who_know_unicycles_only_refuse_others():
    with pytest.raises(InvalidInput, match=r"evader.model = car .* 'unicycle': uncertainty.evader knows no other kind"):
        Game(evader=Car(), uncertainty=Uncertainties(evader=Uncertainty(0.1)))
    game = Game(Wheels(), Unicycle(v_min=-0.1), uncertainty=Uncertainties(evader=Uncertainty(0.1)))
    with pytest.raises(InvalidInput, match=r"pursuer.model = wheels .* 'unicycle'"):
        find_player("identifying:intercept", Role.PURSUER, game)
    with pytest.raises(InvalidInput, match=r"evader.v_min = -0.1 .* 0 m/s"):
        find_player("identifying:flee", Role.EVADER, game)
    with pytest.raises(InvalidInput, match=r"v_min = -0.1 .* 0 m/s: a robot that is uncertain"):
        brakes(game, Role.EVADER)
    with pytest.raises(InvalidInput, match=r"pursuer.model = wheels .* 'unicycle': simulate"):
        mjcf(game, RobotHardware(), 0.01)


# ---- players


def players(game, pursuer, evader):
    """The players of these names."""
    return find_player(pursuer, Role.PURSUER, game), find_player(evader, Role.EVADER, game)


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("name", "drive"),
    [("car", Drive(lag=2, turn_time=0.5)), *(pytest.param(name, None, marks=SLOW) for name in ROBOTS)],
)
def test_shielded_robot_of_any_kind_never_crashes(name, drive):
    """Not even driven at random, backwards and forwards, among obstacles; without its shield it does."""
    body = replace(ROBOTS[name], radius=0.2)
    game = replace(make_game("robot"), pursuer=body, max_steps=200, drives=drive and Drives(drive))
    policy, still = (player.policy for player in players(game, "random", "still"))
    shielded, bare = (
        play_match(a_match(game, pursuer, still, games=200)).outcomes
        for pursuer in (with_shield(policy, game, Role.PURSUER), policy)
    )
    failures = {"pursuer_hit_obstacle", "pursuer_out_of_range"}
    assert sum(shielded[outcome] for outcome in failures) == 0
    assert sum(bare[outcome] for outcome in failures) > 5


def test_shield_of_a_robot_that_backs_towards_a_wall_looks_behind_it():
    game = Game(ROBOTS["unicycle"])
    backup = brakes(game, Role.PURSUER)
    assert backup.may_reverse
    for v, x, clears in ((-0.6, 0.67, True), (-0.6, 0.65, False), (0.6, 9.33, True), (0.6, 9.35, False)):
        own = Robot(game.pursuer, robot(x, 5.0, v, 0.0))
        clearance = float(Backup(Arena(), DT, 20, (1,), may_reverse=True).clearance_after(own, jnp.int32(4)))
        assert (clearance > 0) == clears
        assert clearance == pytest.approx(min(x, 10 - x) - 0.06 - 0.6, abs=1e-3)
        assert bool(backup.can_stop_straight(own, jnp.int32(4))) == (clearance > 2e-3)


@pytest.mark.parametrize("name", ["unicycle", "car"])
def test_chart_says_the_clearance_of_a_robot_that_backs_as_the_rules_do(name):
    game = with_chart(Game(replace(ROBOTS[name], radius=0.1), arena=Arena(0.0, 8.0, 0.0, 8.0)))
    backup = brakes(game, Role.PURSUER)
    for heading in (0.0, 0.4, 1.2):
        own = Robot(game.pursuer, robot(0.6, 4.0, -0.5, heading))
        by_rules = [float(backup.clearance_after(own, jnp.int32(action))) for action in range(9)]
        np.testing.assert_allclose(clearances_after(Surroundings(game.chart), own, DT), by_rules, atol=0.03)


def test_standing_robot_that_may_reverse_stays_where_it_is():
    game = Game(evader=Car())
    still = find_player("still", Role.EVADER, game).policy
    action, _ = still(jnp.zeros(8), (), jnp.uint32(0))
    assert float(game.evader.move(robot(1, 1), *game.evader.controls(action), DT).v) == 0.0


WALL = Polygon(((4.0, 0.0), (4.2, 0.0), (4.2, 6.0), (4.0, 6.0)))


@pytest.mark.slow
@pytest.mark.parametrize("model", ["car", "wheels", "omni"])
def test_pursuer_catches_standing_evaders_with_robots_of_any_kind(model):
    game = replace(PAPER, pursuer=MODELS[model]())
    pursuer, still = (player.policy for player in players(game, "pursuer", "still"))
    outcomes = play_match(a_match(game, pursuer, still, games=200)).outcomes
    assert outcomes["captured"] >= 185
    assert outcomes["captured"] + outcomes["no_result"] == 200


@needs_gcc
@pytest.mark.parametrize("model", ["car", *(pytest.param(name, marks=SLOW) for name in ("unicycle", "wheels", "omni"))])
def test_export_of_a_robot_of_any_kind_decides_as_the_package_does(model):
    game = replace(make_game("robot"), pursuer=replace(ROBOTS[model], radius=0.2))
    player = find_exportable("shielded:intercept", Role.PURSUER, game)
    in_c = CompiledProgram(translate(player.decide, *player.arguments, name="robot"))

    def decide(*state):
        return in_c(player.policy, player.game, *state)[:2]

    assert compare_decisions(decide, player, cases_of(player, 300)).errors == 0


def test_export_brakes_in_a_broken_state_whichever_way_it_drives():
    game = Game(ROBOTS["car"])
    player = find_exportable("intercept", Role.PURSUER, game)
    for v, u1 in ((0.5, -0.3), (-0.5, 0.3), (np.nan, 0.0)):
        rows = jnp.array([[np.nan, 5.0, v, 0.0], [8.0, 5.0, 0.0, 0.0]], jnp.float32)
        controls = player.decide(player.policy, player.game, rows, None, None, player.memory, jnp.uint32(0))["controls"]
        np.testing.assert_allclose(controls, [u1, 0.0], atol=1e-6)


def test_speed_below_zero_of_a_robot_that_cannot_reverse_is_no_hindrance():
    """As noise of a sensor makes it."""
    after = Unicycle().move(robot(0, 0, -0.01), jnp.float32(0.3), jnp.float32(0), DT)
    assert float(after.v) == pytest.approx(0.02)
