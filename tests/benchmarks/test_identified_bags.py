"""Drives of robots whose numbers are known, and the count of those that are identified."""

import numpy as np
import pytest

from apollonius.simulate.identification import Estimate, identify


def test_count_tells_misses_from_what_is_not_identified(benchmark):
    count = benchmark.Count()
    assert count.add(0, 1.0, Estimate(1.1, 0.9, 1.3, "m/s"))
    assert not count.add(1, 1.0, Estimate(1.3, 1.2, 1.4, "m/s"))
    assert not count.add(2, 1.0, Estimate(None, 0.5, float("inf"), "m/s", "drive faster"))
    summary = count.summary()
    assert (summary["identified"], summary["inside"]) == (2, 1)
    assert summary["misses"] == [{"bag": 1, "true": 1.0, "low": 1.2, "high": 1.4}]
    assert summary["median error"] == pytest.approx(0.2)


def test_commands_exceed_the_limits_of_each_robot(benchmark):
    for number in range(20):
        random = np.random.default_rng(number)
        robot = benchmark.draw_robot(random)
        times, speeds, turns = benchmark.commands_of(robot, random).T
        assert (np.diff(times) > 0).all()
        assert 45 < times[-1] < 100
        for commanded, limit in ((speeds, robot.v_max), (turns, robot.u2_max)):
            assert min(commanded.max(), -commanded.min()) >= 1.1 * limit


@pytest.mark.slow
def test_robot_with_a_body_is_identified(benchmark):
    pytest.importorskip("mujoco", reason="needs mujoco: pip install mujoco")
    random = np.random.default_rng(7)
    robot = benchmark.draw_robot(random)
    identified = identify(benchmark.record_drive(robot, random))
    for name, estimate in (identified.drive | identified.noise).items():
        assert estimate.value is not None, name
        assert 0.9 * estimate.low - 0.01 <= robot.truth[name] <= 1.1 * estimate.high + 0.01, name
