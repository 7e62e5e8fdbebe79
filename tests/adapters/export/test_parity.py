"""The judge of exported policies: it sees what is wrong, and what is only rounded otherwise."""

import dataclasses
import itertools

import numpy as np
import pytest

from apollonius.adapters.export.parity import compare, microseconds
from tests.adapters.export.conftest import ONE_OF_EACH_PROFILE

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


def test_each_is_timed_over_its_own_states():
    seen = {"few": [], "many": []}
    states = {"few": np.arange(3), "many": np.arange(1000)}
    times = microseconds({name: seen[name].append for name in seen}, states, calls=950)
    assert all(len(taken) == 1000 and 0 < np.median(taken) < 1000 for taken in times.values())
    assert seen["few"][:4] == [0, 1, 2, 0]
    assert sorted(set(seen["many"])) == [*range(1000)]
    assert len(seen["few"]) == len(seen["many"]) == 1100
