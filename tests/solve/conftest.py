"""Two robots in a cramped place once more, by plain loops: what several files compare tables with."""

import numpy as np
import pytest

from tests.oracle import numpy_duel as oracle
from tests.solve.small import BODY, CRAMPED, FEWER, HOLD


@pytest.fixture(scope="session")
def robot():
    return oracle.Robot(CRAMPED, FEWER, HOLD)


@pytest.fixture(scope="session")
def captures(robot):
    """By the pursuer's node, the evader's node, and their actions."""
    steps = oracle.captures(CRAMPED, robot, robot, CRAMPED.capture_distance + 2 * BODY.v_max * HOLD * CRAMPED.dt)
    assert 0.01 < np.mean(np.isfinite(steps)) < 0.5
    return steps
