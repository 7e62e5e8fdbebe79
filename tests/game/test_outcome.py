"""Which of several events in one step counts, and who has won."""

import itertools

import jax
import jax.numpy as jnp
import pytest

from apollonius.game.outcome import counts_by_name, decide, evader_wins, is_captured, pursuer_wins
from apollonius.game.types import GameState, Outcome, RobotState
from tests.oracle.numpy_game import judge

EVENTS = ("captured", "pursuer_hit", "pursuer_out", "evader_hit", "evader_out", "territory_reached", "out_of_time")
COMBINATIONS = [dict(zip(EVENTS, flags, strict=True)) for flags in itertools.product((False, True), repeat=len(EVENTS))]


def test_of_every_combination_of_events_that_counts_which_counts_for_the_oracle():
    columns = {event: jnp.asarray([flags[event] for flags in COMBINATIONS]) for event in EVENTS}
    decided = jax.vmap(lambda flags: decide(**flags))(columns)
    for flags, outcome in zip(COMBINATIONS, decided, strict=True):
        fates = [
            "HIT_OBSTACLE" if flags[f"{side}_hit"] else "OUT_OF_RANGE" if flags[f"{side}_out"] else None
            for side in ("pursuer", "evader")
        ]
        expected = judge(flags["captured"], *fates, flags["territory_reached"], flags["out_of_time"])
        assert Outcome(int(outcome)).name == expected, flags


def test_the_pursuer_wins_by_a_capture_or_when_the_evader_fails_alone():
    winning = {outcome for outcome in Outcome if pursuer_wins(jnp.asarray(outcome))}
    assert winning == {Outcome.CAPTURED, Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE}


@pytest.mark.parametrize(("time_limit_wins", "more"), [(False, set()), (True, {Outcome.NO_RESULT})])
def test_the_evader_wins_by_the_pursuers_failure_the_territory_or_time_where_the_rules_say_so(time_limit_wins, more):
    winning = {outcome for outcome in Outcome if evader_wins(jnp.asarray(outcome), time_limit_wins)}
    always = {Outcome.PURSUER_HIT_OBSTACLE, Outcome.PURSUER_OUT_OF_RANGE, Outcome.TERRITORY_REACHED}
    assert winning == always | more


def test_a_territory_that_was_never_reached_is_no_outcome_to_report():
    counts = jnp.arange(len(Outcome)).at[Outcome.TERRITORY_REACHED].set(0)
    names = {outcome.name.lower() for outcome in Outcome} - {"ongoing"}
    assert set(counts_by_name(counts)) == names - {"territory_reached"}
    assert counts_by_name(jnp.arange(len(Outcome)))["territory_reached"] == 8


def positions(pursuer, evader):
    robots = [RobotState(*jnp.asarray([*place, 0, 0], jnp.float32)) for place in (pursuer, evader)]
    return GameState.of_two(*robots, jnp.asarray(0))


def test_capture_needs_less_than_the_capture_distance():
    meeting = positions((0, 0), (0.25, 0))
    assert not is_captured(meeting, meeting, 0.25)
    assert is_captured(meeting, meeting, 0.2500001)
