"""The page's moments against the planner's: what is compared, and whom the planner knows."""

import importlib.util
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.policy import AbstractPolicy
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import from_dict
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, Outcome, Role
from apollonius.observe.view import look
from tests.web.test_parity import needs_node

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def benchmark():
    sys.path.insert(0, str(FOLDER))
    try:
        spec = importlib.util.spec_from_file_location("coach", FOLDER / "coach.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(FOLDER))
    return module


class TellsX(AbstractPolicy):
    """Acts by where it sees its opponent."""

    def __call__(self, view, memory, bits):
        return view.opponent.state.x.astype(jnp.int32), memory


def record(steps):
    """A lost game in which the evader is at x = 1 + its step."""
    rows = [[0.0, 0.0, 0.0, 0.0, 1.0 + step, 5.0, 0.0, 0.0] for step in range(steps + 1)]
    return {"states": rows, "moment": 2}


@pytest.mark.parametrize("late", [1, 3])
def test_opponent_sees_the_evader_some_steps_late(benchmark, late):
    game, player = make_game("paper"), benchmark.SeesLate(TellsX(), late)
    lost = benchmark.LostGame(record(8), late)
    _, memory = lost.at(2)
    answers = []
    for step in range(2, 8):
        robots, remembered = lost.at(step)
        assert np.array_equal(remembered, memory), "as if it had played from the start"
        view = look(game, GameState.of_two(*robots, steps=jnp.int32(0)), Role.PURSUER)
        action, memory = player(view, memory, jnp.uint32(0))
        answers.append(int(action))
    assert answers == [1 + max(step - late, 0) for step in range(2, 8)]


def test_moments_agree_within_half_a_second(benchmark):
    pairs = [(2.0, 2.0), (2.5, 2.0), (1.5, 2.0), (None, None), (3.0, 2.0), (None, 20.0), (1.0, 2.0)]
    found = benchmark.count(pairs)
    assert (found["agreeing"], found["page_earlier"], found["page_later"]) == (4, 2, 1)
    assert found["interval"][0] < 4 / 7 < found["interval"][1]
    assert benchmark.LostGame(record(7), 0).page_seconds == 0.5


def test_trial_goes_back_until_it_is_saved(benchmark):
    lost = benchmark.LostGame(record(12), 0)
    trial = benchmark.Trial(lost, max_steps=9, steps=40)
    caught = trial.played._replace(outcome=jnp.int32(Outcome.CAPTURED))
    assert trial.played.robots[1].x == 1 + 7
    trial.go_on(caught, trial.previous)
    assert trial.played.robots[1].x == 1 + 2
    ongoing = trial.played
    trial.go_on(ongoing, trial.previous)
    assert not trial.is_over
    trial.go_on(ongoing, trial.previous)
    assert (trial.is_over, trial.seconds) == (True, 1.0), "the time limit is 7 steps later"
    lost_everywhere = benchmark.Trial(lost, max_steps=100, steps=40)
    lost_everywhere.go_on(caught, trial.previous)
    lost_everywhere.go_on(caught, trial.previous)
    assert (lost_everywhere.is_over, lost_everywhere.seconds) == (True, None)


@needs_node
@pytest.mark.slow
def test_planner_knows_the_opponent_of_the_page(benchmark):
    people = [{"name": "flee", "share_blunders": 0.2}]
    level = {"arena": "paper", "difficulty": "fair", "seconds": 100, "seed": 3, "number": 2, "most": 20}
    (played,) = benchmark.play_on_page([level | {"people": people}])
    rules = with_chart(from_dict(Game, played["game"], "a game"))
    assert len(played["lost"]) == 2
    for late in (0.5, 0.0):
        lost = [benchmark.LostGame(loss, round(10 * late)) for loss in played["lost"]]
        share = benchmark.share_same(benchmark.make_planner(rules, late, 1), lost)
        assert share == 1 if late else share < 0.95
