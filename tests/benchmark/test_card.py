"""The benchmark: its cards come out bit for bit or are refused; an agent from outside costs itself its own games."""

import json
import pickle
import re
import resource
import time
from dataclasses import asdict, replace
from hashlib import sha256

import numpy as np
import pytest

from apollonius.agents import onnx_agent
from apollonius.agents.names import ZOO
from apollonius.agents.onnx_agent import OnnxAgent
from apollonius.agents.onnx_process import LIMITS, parse_actions
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.benchmark import card as card_file
from apollonius.benchmark import track
from apollonius.benchmark.card import judge_agent, verify
from apollonius.benchmark.scenarios import find_scenarios
from apollonius.benchmark.track import FORFEIT, Benchmark, digest_of
from apollonius.cli.main import main
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput

ARENAS = "fences-00", "fences-01", "floors-00"
PROGRAM = """
import os, sys, time
import numpy as np
def read(count): return sys.stdin.buffer.read(count)
model = read(int.from_bytes(read(4), "little"))
os.write(0, np.array([8, LEVELS], "<u4").tobytes())
answer = lambda actions: os.write(0, np.asarray(actions).tobytes())
step = 0
while rows := int.from_bytes(read(4), "little"):
    seen = np.frombuffer(read(32 * rows), np.float32).reshape(rows, 8)
    assert np.isfinite(seen).all()
    step += 1
    ACT
"""
"""What stands in for onnxruntime where it is missing, and where a process does what no model does."""
GOOD = "answer(np.full(rows, step % 9, np.int32))"
COMPILED = {}
"""The processes for which games have been compiled: each becomes that of any agent that acts in the same way."""


@pytest.fixture(scope="module", autouse=True)
def small():
    """Three arenas, short games, two opponents."""
    game = with_chart(replace(find_game(",".join([f"suite-v2/{ARENAS[0]}", *ARENAS[1:]])), max_steps=60))
    panel = {"pursuer": ("pure-pursuit", "random"), "evader": ("still", "random")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Benchmark, "game", game)
        patch.setattr(Benchmark, "arenas", ARENAS)
        patch.setattr(onnx_agent, "missing_extra", lambda *_: None)
        patch.setattr(track, "PANELS", {"full": panel})
        yield


@pytest.fixture(scope="module")
def card_text():
    return json.dumps(asdict(judge_agent(Benchmark("full", Role.PURSUER), "intercept")))


@pytest.fixture
def card(card_text, tmp_path):
    path = tmp_path / "card.json"
    path.write_text(card_text)
    return path


@pytest.fixture
def enter_agent(tmp_path, monkeypatch):
    """A function that returns a benchmark and an agent whose process runs another program."""

    def enter(act, role=Role.PURSUER, levels=1):
        (tmp_path / "program.py").write_text(PROGRAM.replace("ACT", act).replace("LEVELS", str(levels)))
        (tmp_path / "mine.onnx").write_text(act)
        monkeypatch.setattr(onnx_agent, "_PROGRAM", tmp_path / "program.py")
        one = Benchmark("full", role)
        process = one.find(str(tmp_path / "mine.onnx")).policy.process
        shared = COMPILED.setdefault(process.brake.ndim, process)
        vars(shared).update(vars(process))
        return one, NamedPlayer("mine.onnx", OnnxAgent(shared))

    return enter


def test_verify_reproduces_a_card(card):
    found = verify(card, None, every=True)
    assert found.score.opponent in ("still", "random")
    assert -1 <= found.score.worst_tenth <= found.score.net_win_rate <= 1


@pytest.mark.slow
def test_rounds_run_as_jobs_give_the_same_card(card_text, enter_agent, tmp_path):
    def elsewhere(jobs):
        return pickle.loads(pickle.dumps([job.run()[1] for job in pickle.loads(pickle.dumps(jobs))]))

    one, any_time = Benchmark("full", Role.PURSUER), {"decision_us": 0.0}
    card = asdict(judge_agent(one, "intercept", run=elsewhere))
    assert json.dumps(card | any_time) == json.dumps(json.loads(card_text) | any_time)
    enter_agent(GOOD)
    card = judge_agent(one, str(tmp_path / "mine.onnx"), run=elsewhere)
    assert card.score.forfeits == 0
    assert card.sha256 == sha256(GOOD.encode()).hexdigest()


def test_agent_digest_is_the_same_under_every_name_of_its_file():
    names = "pursuer", "zoo/pursuer", "shielded:searching:pursuer", str(ZOO / "pursuer.safetensors")
    assert {digest_of(name)[1] for name in names} == {sha256((ZOO / "pursuer.safetensors").read_bytes()).hexdigest()}


def first(data):
    return data["opponents"]["still"][0]


def lie_well(data):
    """An outcome that was not, and the score that follows from it."""
    outcomes = data["opponents"]["still"][0]["outcomes"]
    outcomes[0] = 3 if outcomes[0] != 3 else 2
    found = card_file.from_dict(card_file.SuiteCard, data, "it")
    data["score"] = asdict(found.benchmark.score(found.opponents))


@pytest.mark.parametrize(
    ("change", "naming"),
    [
        (lambda data: data["score"].update(net_win_rate=0.99), "score"),
        *[(lambda data, bad=bad: first(data)["outcomes"].__setitem__(0, bad), "outcomes") for bad in (99, -1, 10**30)],
        *[(lambda data, bad=bad: first(data)["steps"].__setitem__(0, bad), "steps") for bad in (0, -5, 61, 10**9)],
        *[(lambda data, bad=bad: first(data)["crashed"].__setitem__(0, bad), "crashed") for bad in (-1, 2, 10**9)],
        *[(lambda data, bad=bad: first(data).update(course=bad), "course") for bad in ("", "A" * 16, "0" * 17, 0)],
        (lambda data: first(data).update(seed=1), "rounds against 'still'"),
        (lambda data: first(data).update(other=1), "other"),
        (lambda data: first(data)["steps"].pop(), "rounds against 'still'"),
        (lambda data: data["opponents"]["still"].pop(), "rounds against 'still'"),
        (lambda data: data["opponents"].pop("still"), "opponents"),
        (lambda data: data["opponents"].update(x=[]), "opponents"),
        *[(lambda data, bad=bad: data.update(decision_us=bad), "decision_us") for bad in (-1e-9, 0, "fast", True)],
        (lambda data: data.update(format=2), "format"),
        (lambda data: data.update(format=True), "whole number"),
        (lambda data: first(data).update(failure="an excuse"), "failure"),
        (lambda data: first(data)["outcomes"].__setitem__(0, FORFEIT), "failure"),
        (lambda data: first(data).pop("failure"), "failure"),
        *[(lambda data, bad=bad: data.pop(bad), bad) for bad in ("format", "versions", "decision_us")],
        (lambda data: data.update(isolated=True), "isolated"),
        (lambda data: data.update(side="evader"), "opponents"),
        (lambda data: data["digests"].update(panel="0" * 64), "digest of the panel"),
        (lambda data: data["digests"].update(more="0" * 64), "digest of the more"),
        (lambda data: data.update(agent="no-such"), "no-such"),
        (lambda data: data.update(agent="still"), "still"),
        (lambda data: data.update(agent="x" * 10_000), "x"),
        (lambda data: data.update(sha256="0" * 64), "SHA-256 of the agent"),
        (lambda data: data["opponents"]["still"][1]["steps"].__setitem__(2, 1), "seed 1 against 'still'"),
        (lambda data: data["opponents"]["random"][0].update(course="0" * 16), "seed 0 against 'random'"),
        (lambda data: data.update(track="none"), "track"),
        (lie_well, "seed 0 against 'still'"),
    ],
)
def test_tampered_card_is_refused(card, change, naming):
    data = json.loads(card.read_text())
    change(data)
    card.write_text(json.dumps(data))
    with pytest.raises(InvalidInput, match=naming):
        verify(card, None, every=True)


@pytest.mark.parametrize("seed", [0, 1])
def test_verify_draws_a_seed_for_each_opponent(card, seed, monkeypatch):
    drawn = iter([seed, 1 - seed])
    monkeypatch.setattr(card_file.secrets, "randbelow", lambda _: next(drawn))
    data = json.loads(card.read_text())
    data["opponents"]["random"][1 - seed]["course"] = "0" * 16
    card.write_text(json.dumps(data))
    with pytest.raises(InvalidInput, match=f"seed {1 - seed} against 'random'"):
        verify(card, None, every=False)


def test_control_characters_of_a_card_do_not_reach_the_terminal(card, capsys):
    data = json.loads(card.read_text())
    words = "\x1b[2Jok\nit comes out: "
    first(data).update(failure=words)
    for change in ({}, {"agent": words}, {"versions": words}, {"track": words}, {words: words}):
        card.write_text(json.dumps(data | change))
        assert main(["suite", "verify", str(card)]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert error.strip().isprintable()


FAILING = {
    "time.sleep(100)": "no answer",
    "raise ZeroDivisionError('mine')": "ZeroDivisionError: mine",
    "os._exit(3)": "status 3",
    "os.kill(os.getpid(), 9)": "signal 9",
    "os.write(0, b'x'); time.sleep(100)": "no answer",
    "os.fork() or (os.setsid(), time.sleep(20)); os._exit(0)": "no answer",
}
"""What a process does, and how its failure is told."""


def test_failing_agent_forfeits_its_own_games_only(enter_agent, monkeypatch):
    for act, reason in FAILING.items():
        one, agent = enter_agent(act)
        monkeypatch.setattr(onnx_agent, "ROUND_SECONDS", 2.0 if reason == "no answer" else 100.0)
        began = time.monotonic()
        played = one.play(agent, "still", 0)
        assert time.monotonic() - began < 60  # with the compilation
        assert played.outcomes == (FORFEIT,) * 3
        assert re.search(reason, agent.policy.process.reason)
        assert one.score({"still": [played]}).net_win_rate == -1
        monkeypatch.undo()
    healthy = one.play(one.find("intercept"), "still", 0)
    assert FORFEIT not in healthy.outcomes


def test_agent_with_long_error_output_plays_on(enter_agent):
    one, agent = enter_agent("sys.stderr.write('warning ' * 10_000); sys.stderr.flush(); " + GOOD)
    assert FORFEIT not in one.play(agent, "still", 0).outcomes


@pytest.mark.parametrize(
    ("answer", "role", "levels"),
    [
        ("np.where((step == 1) & (np.arange(rows) == 1), -1, 4).astype(np.int32)", Role.PURSUER, 1),
        ("np.where((step == 1) & (np.arange(2 * rows) == 3), np.nan, 0).astype(np.float32)", Role.EVADER, 2),
    ],
    ids=["beyond", "no number"],
)
def test_impossible_action_forfeits_that_game_only(enter_agent, answer, role, levels):
    one, agent = enter_agent(f"answer({answer})", role, levels)
    outcomes = one.play(agent, "random", 0).outcomes
    assert [outcome == FORFEIT for outcome in outcomes] == [False, True, False]
    assert agent.policy.process.reason == "an answer that is no action"


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("print('no answer')", "status 0"),
        ("syntax error", "SyntaxError"),
        ("import os; os.write(0, b'1234' * 2)", "numbers"),
    ],
)
def test_agent_that_does_not_start_is_refused_with_the_reason(enter_agent, tmp_path, program, reason):
    enter_agent(GOOD)
    (tmp_path / "program.py").write_text(program)
    with pytest.raises(InvalidInput, match=rf"mine\.onnx.*{reason}"):
        Benchmark("full", Role.PURSUER).find(str(tmp_path / "mine.onnx"))


def test_agent_process_that_fails_to_restart_forfeits_its_round(enter_agent, tmp_path):
    one, agent = enter_agent(GOOD)
    (tmp_path / "program.py").write_text("raise MemoryError")
    assert one.play(agent, "still", 0).outcomes == (FORFEIT,) * 3
    assert agent.policy.process.reason == "MemoryError"


NO_ACTION = -1
ANSWERS = [
    (np.array([[np.nan] * 9, [0, 0, 1, 0, 0, 0, 0, 0, 0]], np.float32), [NO_ACTION, 2]),
    (np.array([2**32 + 4, 8]), [NO_ACTION, 8]),
    (np.array([9, -1], np.int8), [NO_ACTION, NO_ACTION]),
    (np.array([[0.5, 1], [-1, 2]]), [[0.5, 1], [-1, 2]]),
]
"""What a model answers, and what is made of it."""


@pytest.mark.parametrize(("answer", "actions"), ANSWERS)
def test_parse_actions_converts_answers_to_actions(answer, actions):
    made = parse_actions(answer, 2)
    assert made.tolist() == actions
    assert made.dtype == (np.float32 if made.ndim == 2 else np.int32)


@pytest.mark.parametrize("answer", [np.zeros((2, 8)), np.array([1.0, 2.0]), np.array(["4", "4"]), np.zeros((3,), int)])
def test_parse_actions_refuses_other_shapes_and_types(answer):
    with pytest.raises(SystemExit, match="give"):
        parse_actions(answer, 2)


def model(*nodes, weights=(), reads=(8,), whole=False):
    """An ONNX model that reads numbers and answers `y`."""
    onnx = pytest.importorskip("onnx", reason="needs onnx: pip install onnx")
    pytest.importorskip("onnxruntime", reason="needs onnxruntime: pip install onnxruntime")
    make, real = onnx.helper, onnx.TensorProto.FLOAT
    kind = onnx.TensorProto.INT64 if whole else real
    inputs = [make.make_tensor_value_info(f"x{place}", real, ["rows", size]) for place, size in enumerate(reads)]
    graph = make.make_graph(
        [make.make_node(kind, read, ["y"], **options) for kind, read, options in nodes],
        "model", inputs, [make.make_tensor_value_info("y", kind, None)], list(weights),
    )  # fmt: skip
    return make.make_model(graph, opset_imports=[make.make_opsetid("", 21)], ir_version=10)


def weights(**external):
    """Weights from the numbers to nine values, which lie in another file where external data are given."""
    onnx = pytest.importorskip("onnx", reason="needs onnx: pip install onnx")
    matrix = onnx.numpy_helper.from_array(np.eye(8, 9, dtype=np.float32), "w")
    if external:
        matrix.ClearField("raw_data")
        matrix.data_location = onnx.TensorProto.EXTERNAL
        for key, value in external.items():
            matrix.external_data.add(key=key, value=value)
    return matrix


def test_onnx_model_plays_within_its_resource_limits(tmp_path):
    path = tmp_path / "mine.onnx"
    path.write_bytes(model(("MatMul", ["x0", "w"], {}), weights=[weights()]).SerializeToString())
    one = Benchmark("full", Role.PURSUER)
    agent = one.find(str(path))
    played = one.play(agent, "still", 0)
    assert FORFEIT not in played.outcomes
    assert played == one.play(agent, "still", 0)
    process = agent.policy.process
    process.start_round(1)
    number = process._running[0].pid
    assert {kind: resource.prlimit(number, kind)[0] for kind in LIMITS} == LIMITS
    process.stop()


def test_onnx_models_that_cannot_play_are_refused_with_the_reason(tmp_path):
    (tmp_path / "beside.bin").write_bytes(bytes(4 * 72))
    multiply = "MatMul", ["x0", "w"], {}
    onnx = pytest.importorskip("onnx", reason="needs onnx: pip install onnx")
    size = onnx.numpy_helper.from_array(np.array([2, 1 << 36]), "w")
    refused = {
        "without external data": model(
            multiply, weights=[weights(location=str(tmp_path / "beside.bin"), length="288")]
        ),
        "without external data ": model(multiply, weights=[weights(location="*/_ORT_MEM_ADDR_/*", offset="4194304")]),
        "one input": model(("Add", ["x0", "x1"], {}), reads=(8, 8)),
        "numbers that it reads = 7": model(("ArgMax", ["x0"], {"axis": 1, "keepdims": 0}), reads=(7,), whole=True),
        r"give \[rows\] actions": model(("Identity", ["x0"], {})),
        "does not start": model(("Expand", ["x0", "w"], {}), weights=[size]),
    }
    for reason, one in refused.items():
        (tmp_path / "mine.onnx").write_bytes(one.SerializeToString())
        with pytest.raises(InvalidInput, match=rf"mine\.onnx.*{reason.strip()}"):
            Benchmark("full", Role.PURSUER).find(str(tmp_path / "mine.onnx"))


def test_agent_from_outside_plays_scenarios_and_loses_those_in_which_it_fails(enter_agent):
    (late_brake,) = find_scenarios(Role.EVADER, ["late_brake"])
    _, braking = enter_agent("answer(np.full(rows, 1, np.int32))", Role.EVADER)
    result = late_brake.play(braking)
    assert (result.won, result.failure) == (len(late_brake.replies), "")
    _, failing = enter_agent("sys.exit(3) if step == 9 else answer(np.full(rows, 1, np.int32))", Role.EVADER)
    result = late_brake.play(failing)
    assert result.won == 0
    assert "status 3" in result.failure


def test_net_win_rate_counts_the_time_limit_for_the_evader():
    outcomes = (1, 2, 3, 4, 5, 6, 7, FORFEIT)
    one = track.Round(0, outcomes, (1,) * 8, (0,) * 8, "0" * 16, "it failed")
    pursuer = Benchmark("full", Role.PURSUER)._net_win_rates(one)
    assert pursuer.tolist() == [1, -1, 1, -1, 1, 0, -1, -1]
    assert Benchmark("full", Role.EVADER)._net_win_rates(one).tolist() == [-1, 1, -1, 1, -1, 0, 1, -1]
