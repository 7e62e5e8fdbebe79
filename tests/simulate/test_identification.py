"""A robot's drive, identified from what it recorded: true values in their intervals, and what cannot be known."""

import json
import re
import tomllib
from dataclasses import replace
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest

from apollonius.arenas.file import find_game
from apollonius.cli.identify import drive_file
from apollonius.cli.main import main
from apollonius.io.errors import InvalidInput
from apollonius.simulate.channel import ChannelLimits, Commands, channel_response
from apollonius.simulate.drive import load_drive
from apollonius.simulate.drive_fit import correlation_time, fit_drive
from apollonius.simulate.drive_record import DriveRecord, load_drive_record
from apollonius.simulate.identification import Estimate, Identification, identify
from tests.export.bags import write_drive
from tests.simulate.recorded import CALIBRATION, REST, ROUND, TURNS, Robot, command_rows, record_of

ROBOT = Robot()
NOISE = ("position", "heading", "speed", "turn_rate")
DRIVE = ("v_max", "u1_max", "u2_max", "turn_acceleration", "latency", "lag")


def estimates(record):
    identified = identify(record)
    return identified.drive | identified.noise


def truth(robot):
    """Each true value by its name."""
    return {name: getattr(robot, name) for name in DRIVE} | dict(zip(NOISE, robot.noise, strict=True))


def outside(robot, found):
    """The identified values that are not within their intervals."""
    true = truth(robot)
    return {
        name: (one, true[name])
        for name, one in found.items()
        if one.value is not None and not one.low <= true[name] <= one.high
    }


def unknown(found):
    return {name for name, one in found.items() if one.value is None}


@pytest.mark.parametrize(
    ("robot", "uneven"),
    [
        (ROBOT, {}),
        (replace(ROBOT, latency=0.31, lag=0.02, u1_max=1.1), {"seed": 1}),
        (replace(ROBOT, v_min=0.0, u2_max=0.8), {"seed": 2}),
        (replace(ROBOT, rate=25.0, turn_acceleration=5.0), {"seed": 3, "jitter": 0.9, "lost": 0.3}),
    ],
    ids=["usual", "late", "no reversing", "uneven stamps"],
)
def test_true_values_are_within_narrow_intervals(robot, uneven):
    found = estimates(record_of(robot, **uneven))
    assert outside(robot, found) == {}
    assert unknown(found) == set()
    for name in ("v_max", "u1_max", "u2_max", "turn_acceleration"):
        assert (found[name].high - found[name].low) / found[name].value < 0.2, name
    for name in ("latency", "lag"):
        assert found[name].high - found[name].low < 0.07, name
    for name in NOISE:
        assert (found[name].high - found[name].low) / found[name].value < 0.5, name


def test_lag_of_nothing_leaves_the_latency_certain():
    """There, no derivative tells the two apart."""
    robot = replace(ROBOT, latency=0.2, lag=0.0005)
    found = estimates(record_of(robot))
    assert outside(robot, found) == {}
    assert unknown(found) == set()
    assert found["latency"].high - found["latency"].low < 0.07
    assert found["lag"].high < 0.05


def test_limits_that_no_command_exceeds_are_not_identified():
    found = estimates(record_of(replace(ROBOT, v_max=2.0, v_min=-2.0, u2_max=3.0)))
    assert unknown(found) == {"v_max", "u2_max"}
    assert found["v_max"].low == pytest.approx(0.9, rel=0.1), "it was that fast"
    assert found["u2_max"].low == pytest.approx(1.4, rel=0.1)
    assert found["v_max"].high == inf
    assert "higher speed" in found["v_max"].remedy
    assert "both sides" in found["u2_max"].remedy


def test_a_drive_that_is_as_fast_as_commanded_by_a_hundredth_shows_no_limit():
    """Wheels that slip, and no limit."""
    slipping = record_of(replace(ROBOT, v_max=2.0, v_min=-2.0))
    slow = replace(slipping, speed=0.99 * slipping.speed)
    assert "v_max" in unknown(estimates(slow))


@pytest.mark.parametrize(
    ("holds", "missing"),
    [
        ([*REST, *ROUND, *REST], {"u2_max", "turn_acceleration"}),
        ([*REST, *ROUND, (0, 1.4, 3), (0, 0, 3), (0, 1.4, 3), *REST], {"u2_max"}),
        ([*REST, *TURNS, *TURNS, *REST], {"v_max"}),
        ([*ROUND[:3], *TURNS], set(NOISE)),
    ],
    ids=["no turns", "turns to one side", "half speed", "no rest"],
)
def test_what_was_not_driven_is_not_identified(holds, missing):
    found = estimates(record_of(ROBOT, holds))
    assert unknown(found) - {"u1_max"} == missing
    assert outside(ROBOT, found) == {}
    assert all(found[name].remedy for name in missing)


def test_lower_of_two_accelerations_is_the_limit():
    """A robot that brakes at twice the rate at which it speeds up, and one that brakes at half of it."""
    commands = command_rows(CALIBRATION)
    times = np.arange(0.1, commands[-1, 0], 0.025)
    still = np.zeros_like(times)
    for rise, fall in ((0.4, 0.8), (0.8, 0.4)):
        limits = ChannelLimits(0.7, 0.7, rise, fall)
        speed = channel_response(Commands(commands[:, 0], commands[:, 1]), limits, 0.1, times - 0.1)
        turn = channel_response(Commands(commands[:, 0], commands[:, 2]), ChannelLimits(), 0.1, times - 0.1)
        speed += np.random.default_rng(0).normal(0, 0.01, len(times))
        found = estimates(DriveRecord(times, still, still, still, speed, turn, *commands.T))
        assert found["u1_max"].low <= 0.4 <= found["u1_max"].high < 0.45
        assert found["turn_acceleration"].value is None


def test_pauses_of_commands_are_left_out():
    """The drive stops by itself in some, which no command says."""
    record = record_of(ROBOT)
    rests = (record.command_speed == 0) & (record.command_times > 6) & (record.command_times < 30)
    sent = ~rests
    assert rests.sum() > 100
    paused = replace(
        record,
        command_times=record.command_times[sent],
        command_speed=record.command_speed[sent],
        command_turn_rate=record.command_turn_rate[sent],
    )
    assert len(list(paused.stretches())) == 5
    found = estimates(paused)
    assert outside(ROBOT, found) == {}
    assert unknown(found) == set()


def test_noise_is_that_of_rest_with_wider_intervals_where_it_is_correlated():
    record = record_of(ROBOT)
    rng = np.random.default_rng(5)
    steps = rng.normal(0, 0.01, len(record.times))
    drift = np.zeros_like(steps)
    for now in range(1, len(steps)):
        drift[now] = 0.9 * drift[now - 1] + steps[now]
    true = 0.01 / np.sqrt(1 - 0.9**2)
    white = identify(record).noise["heading"]
    found = identify(replace(record, heading=record.heading + drift)).noise["heading"]
    assert found.low < np.hypot(true, 0.008) < found.high
    assert np.log(found.high / found.low) > 2 * np.log(white.high / white.low)
    silent = identify(record_of(replace(ROBOT, noise=(0.0, 0.0, 0.0, 0.0)))).noise["position"]
    assert (silent.value, silent.low) == pytest.approx((0, 0), abs=1e-6)


def test_intervals_grow_with_the_noise():
    loud = replace(ROBOT, noise=(0.05, 0.05, 0.12, 0.15))
    quiet, noisy = estimates(record_of(ROBOT)), estimates(record_of(loud))
    assert outside(loud, noisy) == {}
    for name in DRIVE:
        assert noisy[name].high - noisy[name].low > 1.5 * (quiet[name].high - quiet[name].low), name


def euler(commands, limits, lag, times, step=0.0005):
    """The response in small steps."""
    reference, value, values = 0.0, 0.0, np.zeros(len(times))
    for number in range(round(times[-1] / step)):
        now = number * step
        place = np.searchsorted(commands.times, now + step / 2) - 1
        target = np.clip(commands.values[place] if place >= 0 else 0.0, -limits.lowest, limits.highest)
        away = reference * target >= 0 and abs(target) > abs(reference)
        goal = target if reference * target >= 0 else 0.0
        reach = (limits.rise if away else limits.fall) * step
        reference += np.clip(goal - reference, -reach, reach)
        value += (reference - value) * step / lag
        values[np.abs(times - now - step) < step / 2] = value
    return values


def test_closed_form_is_the_limit_of_small_steps():
    rng = np.random.default_rng(0)
    commands = Commands(np.arange(12) * 0.7 + 0.2, rng.uniform(-1, 1, 12))
    limits = ChannelLimits(0.7, 0.5, 0.9, 1.6)
    times = np.arange(1, 90) * 0.1 + 0.05
    assert channel_response(commands, limits, 0.15, times) == pytest.approx(
        euler(commands, limits, 0.15, times), abs=3e-3
    )
    assert channel_response(commands, ChannelLimits(), 0.0, times) == pytest.approx(
        commands.values[np.searchsorted(commands.times, times, side="right") - 1] * (times >= 0.2), abs=1e-6
    )


def test_standard_errors_see_correlated_residuals():
    assert correlation_time(np.random.default_rng(0).normal(size=4000)) < 1.2
    assert correlation_time(np.repeat(np.random.default_rng(0).normal(size=800), 5)) == pytest.approx(5, rel=0.2)
    record = record_of(ROBOT)
    waves = 0.02 * np.sin(2 * np.pi * record.times / 1.7)
    plain, waving = fit_drive(record), fit_drive(replace(record, speed=record.speed + waves))
    assert waving.inflation > 3 > plain.inflation
    for name in ("speed highest", "speed rise"):
        assert waving.standard_errors[name] > 1.5 * plain.standard_errors[name]


SOUND = record_of(ROBOT)
NOISE_ALONE = np.random.default_rng(0).normal(0, 0.03, len(SOUND.times))


@pytest.mark.parametrize(
    ("changes", "refusal"),
    [
        ({"speed": np.where(SOUND.times > 3, nan, SOUND.speed)}, r"speed of message 1\d\d of 2,1\d\d = nan .* number"),
        ({"x": np.where(SOUND.times > 3, inf, SOUND.x)}, "x of message .* = inf"),
        ({"command_times": SOUND.command_times[::-1]}, r"stamps of commands after message 1 = -0\.100 s .* than 0"),
        ({"times": np.floor(SOUND.times)}, r"stamps of odometry after message 1 = \+0\.000 s .* one publisher"),
        ({"command_times": SOUND.command_times + 50}, r"command every 0\.5 s = 4\.\d s .* at least 10 s.* one clock"),
        ({"command_times": SOUND.command_times * 10}, r"command every 0\.5 s = 0\.0 s .* send commands all the time"),
        ({"times": SOUND.times * 20}, "rate of the odometry = 2.0 .* at least 5 a second"),
        ({"speed": NOISE_ALONE}, r"change of the speed = 0\.0\d\d .* at least 0\.05 where 1\.80 was commanded"),
        ({"turn_rate": NOISE_ALONE}, r"change of the turn rate = 0\.0\d\d .* where 2\.80 was .* did not move"),
        ({"command_speed": SOUND.x[:540] * 0, "command_turn_rate": SOUND.x[:540] * 0}, "change of commands = 0.000"),
    ],
    ids=["nan", "infinite", "backwards", "standing clock", "apart", "rare", "slow", "no speed", "no turn", "silence"],
)  # fmt: skip
def test_impossible_record_is_refused(changes, refusal):
    with pytest.raises(InvalidInput, match=refusal):
        replace(SOUND, **changes)


def test_short_record_is_refused():
    few = {name: getattr(SOUND, name)[:30] for name in SOUND.__dataclass_fields__}
    with pytest.raises(InvalidInput, match=r"odometry = 30 .* at least 50; record a longer drive"):
        DriveRecord(**few)


def test_commands_of_another_robot_are_refused():
    rng = np.random.default_rng(3)
    other = command_rows([(rng.uniform(-1, 1), rng.uniform(-1, 1), 2) for _ in range(27)])
    columns = ("command_times", "command_speed", "command_turn_rate")
    record = replace(SOUND, **dict(zip(columns, other.T, strict=True)))
    with pytest.raises(InvalidInput, match=r"commands explain = \d+% .* one robot, which nothing else drives"):
        identify(record)


def told(**changes):
    """An identification in round numbers, and with other estimates."""
    drive = {
        "v_max": Estimate(0.7, 0.68571, 0.72, "m/s"),
        "u1_max": Estimate(0.5, 0.4, 0.6, "m/s^2"),
        "u2_max": Estimate(1.0, 0.9, 1.1, "rad/s"),
        "turn_acceleration": Estimate(2.0, 1.8, 2.2, "rad/s^2"),
        "latency": Estimate(0.2, 0.19, 0.21, "s"),
        "lag": Estimate(0.05, 0.04, 0.06, "s"),
    }
    noise = dict.fromkeys(NOISE, Estimate(0.01, 0.0099, 0.01041, "m")) | {"speed": Estimate(0.0, 0.0, 0.0, "m/s")}
    return Identification(drive | changes, noise)


@pytest.mark.parametrize(
    ("latency", "own", "steps", "in_simulation"),
    [(0.2, 0.1, 3, 1), (0.1, 0.1, 2, 0), (0.23, 0.03, 3, 2), (0.04, 0.04, 2, 0)],
)
def test_file_has_at_most_one_step_of_latency_and_the_game_the_rest(latency, own, steps, in_simulation):
    text = drive_file(told(latency=Estimate(latency, latency - 0.01, latency + 0.01, "s")), Path("bag"))
    assert tomllib.loads(text) == {"latency": pytest.approx(own), "lag": 0.05, "turn_acceleration": 2.0}
    assert f"# lag = {steps}  # steps of 0.1 s; {in_simulation} with simulate --drive" in text


def test_lines_for_the_game_round_limits_down_and_delays_up():
    text = drive_file(told(), Path("bag"))
    for line in (
        "v_max = 0.685",
        "u1_max = 0.400",
        "u2_max = 0.900",
        "turn_time = 0.612",
        "position = 0.0105",
        "speed = 0.00",
    ):
        assert f"\n# {line}\n" in text
    unknown_drive = drive_file(
        told(u2_max=Estimate(None, 0.5, inf, "rad/s", "turn"), lag=Estimate(None, 0.0, inf, "s", "more")), Path("bag")
    )
    assert tomllib.loads(unknown_drive).keys() == {"latency", "turn_acceleration"}
    for line in (
        "lag: not identified; more",
        "lag: not identified",
        "u2_max: not identified",
        "turn_time: not identified",
    ):
        assert f"\n# {line}\n" in unknown_drive


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    pytest.importorskip("rosbags", reason="needs rosbags: pip install rosbags")
    folder = tmp_path_factory.mktemp("bags")
    write_drive(folder / "late", record_of(replace(ROBOT, latency=0.23)))
    unlimited = record_of(replace(ROBOT, v_max=2.0, v_min=-2.0, u2_max=3.0))
    write_drive(folder / "stamped", unlimited, ("/odom", "/cmd_vel"), stamped=True)
    return folder


@pytest.mark.parametrize("name", ["late", "stamped"])
def test_bag_has_the_record_that_was_written(bags, name):
    record = load_drive_record(bags / name, "odom", "cmd_vel")
    assert record.times[0] - record.command_times[0] == pytest.approx(0.1, abs=1e-6)
    robot = replace(ROBOT, latency=0.23) if name == "late" else replace(ROBOT, v_max=2.0, v_min=-2.0, u2_max=3.0)
    written = record_of(robot)
    for column in ("x", "y", "heading", "speed", "turn_rate", "command_speed", "command_turn_rate"):
        assert getattr(record, column) == pytest.approx(getattr(written, column), abs=1e-6), column


def test_identify_writes_a_drive_that_simulate_takes(bags, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["identify", "--bag", str(bags / "late"), "--odometry", "/robot1/odom", "--out", "robot.toml"]
    assert main(words) == 0
    shown = capsys.readouterr()
    assert "late: 54 s, 2,1" in shown.out
    assert "to identify" not in shown.out
    assert "apollonius simulate" in shown.err
    drive = load_drive(tmp_path / "robot.toml")
    assert drive.latency == pytest.approx(0.03, abs=0.015), "without two whole steps"
    assert drive.lag == pytest.approx(ROBOT.lag, abs=0.02)
    assert drive.turn_acceleration == pytest.approx(ROBOT.turn_acceleration, rel=0.04)
    lines = (tmp_path / "robot.toml").read_text(encoding="utf-8").splitlines()
    game_lines = lines[next(place for place, line in enumerate(lines) if line == "# [pursuer]") :]
    text = "\n".join(line.removeprefix("#").strip() for line in game_lines)
    game = tomllib.loads(text)
    assert 0.66 < game["pursuer"]["v_max"] < 0.7
    assert 0.47 < game["pursuer"]["u1_max"] < 0.5
    assert 0.95 < game["pursuer"]["u2_max"] < 1.0
    assert game["drives"]["pursuer"]["lag"] == 4, "0.23 s and 0.08 s, rounded up"
    assert 0.5 < game["drives"]["pursuer"]["turn_time"] < 0.56
    assert 0.01 < game["sensors"]["pursuer"]["own_noise"]["position"] < 0.0115
    (tmp_path / "game.toml").write_text(text, encoding="utf-8")
    assert float(find_game("game.toml").pursuer.v_max) == pytest.approx(game["pursuer"]["v_max"])
    before = (tmp_path / "robot.toml").read_bytes()
    assert main(words) == 2
    assert "a new file" in capsys.readouterr().err
    assert (tmp_path / "robot.toml").read_bytes() == before


def test_identify_says_what_to_record(bags, capsys):
    assert main(["identify", "--bag", str(bags / "stamped")]) == 0
    shown = capsys.readouterr().out
    assert "to identify v_max: command a higher speed" in shown
    assert "# v_max: not identified" in shown
    assert tomllib.loads(shown[shown.index("# The drive in") :]).keys() == {"latency", "lag", "turn_acceleration"}
    assert main(["identify", "--bag", str(bags / "stamped"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["drive"]["v_max"]["value"] is facts["drive"]["v_max"]["high"] is None
    assert facts["drive"]["latency"]["low"] < 0.12 < facts["drive"]["latency"]["high"]
    assert facts["noise"]["speed"]["unit"] == "m/s"


@pytest.mark.parametrize(
    ("more", "refusal"),
    [
        (["--odometry", "odo"], "topic 'odo': not in this bag; its topics are: /robot1/cmd_vel, /robot1/odom"),
        (["--odometry", "/robot1/cmd_vel"], "topics = /robot1/cmd_vel, cmd_vel .* different ones"),
        (["--odometry", "cmd_vel", "--commands", "odom"], "must be nav_msgs/msg/Odometry; name another topic"),
        (["--bag", "nowhere"], "no such folder of a bag: 'nowhere'"),
        (["--bag", "."], "content = .* metadata.yaml"),
        (["--out", "robot.yaml"], "a file that ends in .toml"),
    ],
)  # fmt: skip
def test_identify_refuses_bad_input_in_one_line(bags, tmp_path, capsys, monkeypatch, more, refusal):
    monkeypatch.chdir(tmp_path)
    try:
        status = main(["identify", "--bag", str(bags / "late"), *more])
    except SystemExit as end:
        status = end.code
    assert status == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert re.search(refusal, error)


def test_topics_of_two_robots_are_listed(tmp_path, capsys):
    pytest.importorskip("rosbags", reason="needs rosbags: pip install rosbags")
    write_drive(tmp_path / "bag", SOUND, ("/robot1/odom", "/robot2/odom"))
    assert main(["identify", "--bag", str(tmp_path / "bag")]) == 2
    assert "topic 'odom': several topics end so: /robot1/odom, /robot2/odom" in capsys.readouterr().err
