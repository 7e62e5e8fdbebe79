"""The scenarios: their lines win against every reply, and agents that play them are counted honestly."""

import json
import runpy
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.source import NamedPlayer
from apollonius.benchmark.scenarios import FOLDER, NAMES, BenchmarkScenario, find_scenarios, load_scenario
from apollonius.catalogue import find_player
from apollonius.cli.main import main
from apollonius.game.types import BySide, Outcome, Role
from apollonius.io.errors import InvalidInput
from tests.documents import REPOSITORY

prove = runpy.run_path(str(REPOSITORY / "benchmarks" / "scenarios.py"))["prove"]


class Line(AbstractPolicy):
    """The player that follows the line of one robot, whatever happens."""

    actions: jnp.ndarray

    @property
    def memory(self):
        return jnp.zeros((), jnp.int32)

    def __call__(self, observation, memory, bits):
        return self.actions[memory], memory + 1


def scenario_of(name):
    return load_scenario(FOLDER / f"{name}.json")


def follower(scenario):
    (line,) = scenario.line
    return NamedPlayer("line", Line(jnp.repeat(jnp.asarray(line, jnp.int32), scenario.hold)))


@jax.jit
def play_step(game, state, actions):
    return game.step(state, *actions)


def outcome_of(scenario, reply, hold):
    """How the line ends against one reply, step by step by the rules."""
    state, outcome = scenario.start, Outcome.ONGOING
    line = np.repeat(np.array(scenario.line), scenario.hold, axis=1)
    for step, own in enumerate(line.T):
        if outcome == Outcome.ONGOING:
            other = (reply[min(step // hold, len(reply) - 1)],)
            after = play_step(scenario.game, state, BySide.of(scenario.role, tuple(own), other))
            state, outcome = after.state, Outcome(int(after.outcome))
    return outcome


def test_there_is_a_scenario_of_each_kind():
    kinds = "door pillar corner dead_end two_against_one hidden_corner head_on late_brake"
    assert set(NAMES) == set(kinds.split())


@pytest.mark.parametrize("name", NAMES)
def test_stored_line_wins_against_every_coarse_reply(name):
    one = scenario_of(name)
    proof = prove(one, one.coarse_hold)
    assert proof.refutation is None
    assert proof.replies == len(one.replies) == 9 ** (int(one.game.max_steps) // one.coarse_hold)


def test_published_proofs_are_those_of_the_stored_lines():
    path = REPOSITORY / "docs" / "results" / "tables" / "scenarios.json"
    proofs = {proof["scenario"]: proof for proof in json.loads(path.read_text())["proofs"]}
    assert set(proofs) == set(NAMES)
    for name, proof in proofs.items():
        one = scenario_of(name)
        assert (proof["goal"], proof["line"]) == (one.goal, [list(robot) for robot in one.line])
        assert proof["replies"] == 9 ** len(one.line[0])


@pytest.mark.parametrize(
    "name", ["corner", *(pytest.param(name, marks=pytest.mark.slow) for name in ("late_brake", "pillar"))]
)
def test_claim_is_proved_again_for_replies_of_half_a_second(name):
    one = scenario_of(name)
    assert one.hold * one.game.dt == pytest.approx(0.5)
    proof = prove(one, one.hold)
    assert proof.refutation is None
    assert proof.replies == 9 ** len(one.line[0])


MUTANTS = {
    "late_brake": lambda one: replace(one, line=((4,) * 6,)),
    "corner": lambda one: replace(
        one, game=replace(one.game, max_steps=15), line=(one.line[0][:3],), coarse_hold=one.hold
    ),
    "dead_end": lambda one: replace(one, line=((1,) * 8,)),
}
"""Another line, a time limit that is too short, a pursuer that brakes."""


@pytest.mark.parametrize("name", MUTANTS)
def test_wrong_claim_is_refuted_by_a_reply_that_beats_it(name):
    wrong = MUTANTS[name](scenario_of(name))
    refutation = prove(wrong, wrong.coarse_hold).refutation
    assert refutation
    assert not wrong.wins(np.array([outcome_of(wrong, refutation, wrong.coarse_hold)])).any()
    assert wrong.play(follower(wrong)).won < len(wrong.replies)


def test_line_as_an_agent_wins_every_game_and_each_game_has_a_reply_of_its_own():
    one = scenario_of("late_brake")
    result = one.play(follower(one))
    assert (result.won, result.is_solved) == (result.replies, True)
    wrong = replace(scenario_of("pillar"), line=((8,) * 6,))
    vars(wrong)["replies"] = wrong.replies[::20]
    beaten = [not wrong.wins(np.array([outcome_of(wrong, reply, wrong.coarse_hold)])).all() for reply in wrong.replies]
    assert 0 < sum(beaten) < len(beaten)
    assert wrong.play(follower(wrong)).won == len(beaten) - sum(beaten)


def test_agents_that_do_not_play_a_game_are_refused_only_without_any_other():
    with pytest.raises(InvalidInput, match="territory"):
        find_player("territory", Role.EVADER, scenario_of("late_brake").game)


def written(tmp_path, **changes):
    """A scenario's files, some values changed."""
    data = json.loads((FOLDER / "late_brake.json").read_text())
    (tmp_path / "mine.toml").write_text((FOLDER / "late_brake.toml").read_text())
    (tmp_path / "mine.json").write_text(json.dumps(data | changes))
    return str(tmp_path / "mine.json")


def test_command_counts_the_scenarios_that_an_agent_solves(tmp_path, capsys):
    words = ["suite", "scenarios", "still", "--side", "evader", "--only", written(tmp_path)]
    assert main([*words, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["agent"], record["solved"]) == ("still", 1)
    (result,) = record["scenarios"]
    assert (result["scenario"], result["won"], result["replies"]) == ("mine", 729, 729)
    assert main(words) == 0
    assert "evader survives 3 s" in capsys.readouterr().out


REFUSED = {
    "nobody": "unknown agent 'nobody'",
    "still": "side = missing",
    "mine.onnx": "no such file: 'mine.onnx'",
    "evader --only nowhere": "scenario = nowhere is not possible",
    "evader --only corner": "with one at least that the evader wins",
    "evader --only nowhere.json": "no such file: 'nowhere.json'",
    "territory --side evader --only late_brake": "territory",
}


@pytest.mark.parametrize("words", REFUSED)
def test_command_refuses_wrong_input_in_one_line(words, capsys):
    try:
        status = main(["suite", "scenarios", *words.split()])
    except SystemExit as stop:
        status = stop.code
    captured = capsys.readouterr()
    assert (status, captured.out, captured.err.count("\n")) == (2, "", 1)
    assert REFUSED[words] in captured.err


WRONG = {
    "hold": {"hold": 7},
    "hold = 1": {"hold": 1},
    "coarse_hold": {"coarse_hold": 3, "hold": 3},
    "line": {"line": [[0, 0, 0]]},
    "lists of 6 actions": {"line": [[0, 0, 0, 0, 0, 9]]},
    "robots": {"evaders": []},
    r"robot's number = 1e\+39 .* within 1e\+06": {"evaders": [[1e39, 0.5, 0.0, 0.0]]},
    "side": {"side": "referee"},
    "task": {"task": "two\nlines"},
    "in free space": {"evaders": [[9.0, 0.5, 0.0, 0.0]]},
}


@pytest.mark.parametrize("about", WRONG)
def test_impossible_scenario_is_refused(about, tmp_path):
    with pytest.raises(InvalidInput, match=about):
        load_scenario_of(tmp_path, WRONG[about])


def load_scenario_of(tmp_path, changes) -> BenchmarkScenario:
    (one,) = find_scenarios(Role.EVADER, [written(tmp_path, **changes)])
    return one
