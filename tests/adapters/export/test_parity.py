"""The judge of exported policies: it sees what is wrong, and what is only rounded otherwise."""

import dataclasses
import itertools

import numpy as np
import pytest

from apollonius.adapters.export.parity import compare, largest_difference, microseconds
from apollonius.game.dynamics import Unicycle
from tests.adapters.export.conftest import CONTINUOUS, ONE_OF_EACH_PROFILE, UNEQUAL

one_case = pytest.mark.parametrize("case", ONE_OF_EACH_PROFILE[:1], indirect=True)


def scripted(answers):
    """A policy that says these things in turn, whatever the state."""
    script = itertools.cycle(answers)
    return lambda state: next(script)


@one_case
def test_other_actions_and_other_controls_are_errors_and_ties_are_not(case):
    blueprint = case.blueprint
    right = [(action, *blueprint.controls[action].tolist()) for action in case.actions.tolist()]
    seen = (case.states, case.observations, case.actions)
    parity = compare(scripted(right), blueprint, *seen)
    assert (parity.states, parity.ties, parity.errors) == (400, 0, 0)

    action, u1, u2 = right[3]
    other = (action + 1) % 9
    wrong_controls = [*right[:3], (action, u1, u2 + 1e-3), *right[4:]]
    wrong_action = [*right[:3], (other, *blueprint.controls[other].tolist()), *right[4:]]
    for wrong in (wrong_controls, wrong_action):
        parity = compare(scripted(wrong), blueprint, *seen)
        assert (parity.ties, parity.errors) == (0, 1)

    # A network for which all actions are the same.
    (weight, bias) = blueprint.layers[-1]
    level = dataclasses.replace(blueprint, layers=(*blueprint.layers[:-1], (0 * weight, np.ones_like(bias))))
    parity = compare(scripted(wrong_action), level, *seen)
    assert (parity.ties, parity.errors) == (1, 0)


@one_case
def test_values_in_double_precision_are_those_of_the_network(case):
    best = [int(np.argmax(case.blueprint.values(observation))) for observation in case.observations]
    assert best == case.actions.tolist()


@pytest.mark.parametrize("case", CONTINUOUS[1:3], indirect=True)
def test_the_largest_difference_is_a_share_of_the_control_that_differs_most(case):
    right, (u1_max, u2_max) = case.controls.tolist(), case.blueprint.largest_controls.tolist()

    def away(u1, u2):
        """By how much a policy is away that adds these to its fourth controls, shares of the largest."""
        wrong = (right[3][0] + u1 * u1_max, right[3][1] + u2 * u2_max)
        said = scripted([*right[:3], wrong, *right[4:]])
        return largest_difference(said, case.blueprint, case.states, case.actions)

    assert away(0, 0) < 1e-6
    assert away(0.001, 0) == pytest.approx(0.001, rel=1e-3)
    assert away(0.001, -0.003) == pytest.approx(0.003, rel=1e-3)
    assert np.isnan(away(0, np.nan))


@pytest.mark.parametrize("case", CONTINUOUS[2:3], indirect=True)
def test_where_a_robot_cannot_turn_it_must_not_be_told_to(case):
    still = dataclasses.replace(case.blueprint, game=dataclasses.replace(UNEQUAL, evader=Unicycle(u2_max=0.0)))
    seen = (case.states[:1], np.float32([[0.5, 1.0]]))
    assert largest_difference(scripted([(0.15, 0.0)]), still, *seen) < 1e-6
    assert largest_difference(scripted([(0.15, 0.1)]), still, *seen) > 1


def test_each_is_timed_over_its_own_states():
    seen = {"few": [], "many": []}
    states = {"few": np.arange(3), "many": np.arange(1000)}
    times = microseconds({name: seen[name].append for name in seen}, states, calls=950)
    assert all(len(taken) == 1000 and 0 < np.median(taken) < 1000 for taken in times.values())
    assert seen["few"][:4] == [0, 1, 2, 0]
    assert sorted(set(seen["many"])) == [*range(1000)]
    assert len(seen["few"]) == len(seen["many"]) == 1100
