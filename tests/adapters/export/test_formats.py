"""Every format decides as the package's player does, and brakes where there is nothing to decide on."""

from importlib import import_module
from pathlib import Path
from shutil import which

import numpy as np
import pytest

from apollonius.adapters.export.parity import compare
from tests.adapters.export.conftest import CONTINUOUS, ONE_OF_EACH

FORMATS = ["onnx", pytest.param("c", marks=pytest.mark.skipif(which("gcc") is None, reason="needs gcc"))]


@pytest.fixture(params=FORMATS)
def decide(request, case, tmp_path):
    """The case's policy, exported and loaded again."""
    format_ = import_module(f"apollonius.adapters.export.{request.param}")
    out = tmp_path / f"small_policy{format_.SUFFIX}"
    for path, content in format_.make_files(case.blueprint, out).items():
        path.write_bytes(content)
    return format_.load(out)


def test_it_decides_as_the_player_and_brakes_in_a_broken_state(decide, case):
    assert len(set(case.actions.tolist())) > 3
    parity = compare(decide, case.blueprint, case.states, case.observations, case.actions)
    assert (parity.states, parity.errors, parity.ties) == (400, 0, 0)
    brake = (1, pytest.approx(-case.blueprint.own.u1_max), 0.0)
    assert all(decide(state) == brake for state in broken(case.states[case.actions != 1]))


@pytest.mark.parametrize("case", CONTINUOUS, indirect=True)
def test_a_continuous_one_steers_as_the_player_and_brakes_in_a_broken_state(decide, case):
    between = np.abs(case.actions) < 0.9
    assert between.mean(axis=0).min() > 0.5, "gears in all their range"
    assert case.actions.std(axis=0).min() > 0.1
    own = case.blueprint.own
    said = np.array([decide(state) for state in case.states])
    np.testing.assert_allclose(said / [own.u1_max, own.u2_max], case.controls / [own.u1_max, own.u2_max], atol=2e-5)
    brake = (pytest.approx(-own.u1_max), 0.0)
    assert all(decide(state) == brake for state in broken(case.states[between.all(axis=1)]))


def broken(states):
    """What is no state: NaNs, infinities, and numbers too large, in each place and in all."""
    for place in range(8):
        for number in (np.nan, np.inf, -np.inf, 3e38, -2e6):
            state = states[place].copy()
            state[place] = number
            yield state
    yield np.full(8, np.nan, np.float32)


@pytest.mark.parametrize("case", ONE_OF_EACH, indirect=True)
def test_a_file_written_again_is_the_same(case):
    for name in ("onnx", "c"):
        format_ = import_module(f"apollonius.adapters.export.{name}")
        out = Path(f"policy{format_.SUFFIX}")
        assert format_.make_files(case.blueprint, out) == format_.make_files(case.blueprint, out)
