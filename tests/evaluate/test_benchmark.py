"""The benchmark: its cards come out bit for bit or are refused; an agent from outside costs itself its own games."""

import json
import pickle
import re
import sys
from dataclasses import asdict, replace

import pytest

from apollonius.agents import entrant
from apollonius.agents.entrant import Entrant
from apollonius.agents.kind import Named
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.evaluate import benchmark, suite_card
from apollonius.evaluate.benchmark import FORFEIT, Benchmark
from apollonius.evaluate.suite_card import judge, verify
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput

ARENAS = "fences-00", "fences-01", "floors-00"
GOOD = """
def act(seen, slots, steps, arenas):
    assert seen.shape == (len(slots), 12) and (arenas == slots).all()
    return (steps % 9).astype("int32")
"""


COMPILED = {}
"""The processes for which games have been compiled: each becomes that of any agent that reads and does the same."""


@pytest.fixture(scope="module", autouse=True)
def small():
    """Three arenas, short games, two opponents."""
    game = charted(replace(find_game(",".join([f"suite-v2/{ARENAS[0]}", *ARENAS[1:]])), max_steps=60))
    panel = {"pursuer": ("pure-pursuit", "random"), "evader": ("still", "random")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Benchmark, "game", game)
        patch.setattr(Benchmark, "arenas", ARENAS)
        patch.setattr(entrant, "DECISION_SECONDS", 10.0)  # other tests keep the cores busy
        patch.setattr(benchmark, "PANELS", {"full": panel})
        yield


@pytest.fixture(scope="module")
def judged():
    return json.dumps(asdict(judge(Benchmark("full", Role.PURSUER), "intercept", sys.executable)))


@pytest.fixture
def card(judged, tmp_path):
    path = tmp_path / "card.json"
    path.write_text(judged)
    return path


def entered(tmp_path, code, role=Role.PURSUER):
    path = tmp_path / "mine.py"
    path.write_text(code)
    one = Benchmark("full", role)
    process = one.find(str(path), sys.executable).policy.process
    shared = COMPILED.setdefault((process.observation, process.is_discrete), process)
    vars(shared).update(vars(process))
    return one, Named("mine.py", Entrant(shared))


def test_a_card_comes_out_again(card):
    found = verify(card, None, sys.executable, every=True)
    assert found.score.against in ("still", "random")
    assert -1 <= found.score.worst_tenth <= found.score.worth <= 1


def test_rounds_as_jobs_make_the_same_card(judged, tmp_path):
    def elsewhere(jobs):
        return pickle.loads(pickle.dumps([job.run()[1] for job in pickle.loads(pickle.dumps(jobs))]))

    one, any_time = Benchmark("full", Role.PURSUER), {"decision_us": 0.0}
    card = asdict(judge(one, "intercept", sys.executable, run=elsewhere))
    assert json.dumps(card | any_time) == json.dumps(json.loads(judged) | any_time)
    (tmp_path / "mine.py").write_text(GOOD)
    card = judge(one, str(tmp_path / "mine.py"), sys.executable, run=elsewhere)
    assert card.decision_us > 0
    assert (card.failure, card.score.forfeits) == ("", 0)


def lie_well(data):
    """An outcome that was not, and the score that follows from it."""
    outcomes = data["opponents"]["still"][0]["outcomes"]
    outcomes[0] = 3 if outcomes[0] != 3 else 2
    found = suite_card.from_dict(suite_card.SuiteCard, data, "it")
    data["score"] = asdict(found.benchmark.score(found.opponents))


@pytest.mark.parametrize(
    ("change", "naming"),
    [
        (lambda data: data["score"].update(worth=0.99), "score"),
        (lambda data: data["opponents"]["still"][0]["outcomes"].__setitem__(0, 99), "score"),
        (lambda data: data["opponents"]["still"].pop(), "opponents"),
        (lambda data: data["digests"].update(panel="0" * 64), "digest of the panel"),
        (lambda data: data.update(sha256="0" * 64), "SHA-256 of the agent"),
        (lambda data: data["opponents"]["still"][1]["steps"].__setitem__(2, 1), "seed 1 against 'still'"),
        (lambda data: data["opponents"]["random"][0].update(course="0" * 16), "seed 0 against 'random'"),
        (lambda data: data.update(track="none"), "track"),
        (lie_well, "seed 0 against 'still'"),
    ],
)
def test_a_tampered_card_is_refused(card, change, naming):
    data = json.loads(card.read_text())
    change(data)
    card.write_text(json.dumps(data))
    with pytest.raises(InvalidInput, match=naming):
        verify(card, None, sys.executable, every=True)


FAILING = {
    "import time\ndef act(*_): time.sleep(100)": "no answer",
    "def act(*_): raise ZeroDivisionError('mine')": "ZeroDivisionError: mine",
    "import os\ndef act(*_): os._exit(3)": "status 3",
    "def act(*_): return 'garbage'": "Error",
    "def act(seen, *_): return [1] * (len(seen) + 7)": "Error",
    "def act(seen, *_): return seen[:, 0]": "Cannot cast",
    "def act(*_): return bytearray(1 << 34)": "MemoryError",
    "import os\ndef act(*_):\n    for one in range(3, 9):\n        try: os.write(one, b'x' * 5000)\n"
    "        except OSError: pass": "too long|status|Error",
}
"""Agents from outside, and why they fail."""


def test_an_agent_that_fails_costs_itself_its_games_and_nothing_else(tmp_path, monkeypatch):
    for code, reason in FAILING.items():
        monkeypatch.setattr(entrant, "DECISION_SECONDS", 0.3 if reason == "no answer" else 10.0)
        one, agent = entered(tmp_path, code)
        played = one.play(agent, "still", 0)
        assert played.outcomes == (FORFEIT,) * 3
        assert re.search(reason, agent.policy.process.reason)
        assert one.score({"still": [played]}).worth == -1
    healthy = one.play(one.find("intercept", sys.executable), "still", 0)
    assert FORFEIT not in healthy.outcomes


LEVELS = (
    "import numpy as np\nACTIONS, OBSERVATION = 'continuous', 'egocentric'\n"
    "def act(seen, slots, *_): return np.where(slots[:, None] == 1, np.nan, np.zeros((len(slots), 2), 'float32'))"
)


@pytest.mark.parametrize(
    ("code", "role", "opponent"),
    [
        ("def act(seen, slots, *_): return (slots == 1).astype('int32') * 17", Role.PURSUER, "still"),
        (LEVELS, Role.EVADER, "random"),
    ],
    ids=["beyond", "no number"],
)
def test_an_impossible_action_costs_that_game_alone(tmp_path, code, role, opponent):
    one, agent = entered(tmp_path, code, role)
    assert [outcome == FORFEIT for outcome in one.play(agent, opponent, 0).outcomes] == [False, True, False]


def test_an_agent_sees_no_files_and_breaks_none(tmp_path):
    victim = tmp_path / "card.json"
    victim.write_text("precious")
    attack = (
        "import os, socket\nfailed = []\n"
        f"for crime in (lambda: open({str(victim)!r}).read(), lambda: open({str(victim)!r}, 'w'),\n"
        f"              lambda: os.remove({str(victim)!r}), lambda: open('here', 'w'),\n"
        "              lambda: os.kill(os.getppid(), 9), lambda: socket.create_connection(('127.0.0.1', 9), 1)):\n"
        "    try: crime()\n    except PermissionError: failed.append(crime)\n"
        "def act(seen, *_): return [0 if len(failed) == 6 and 'APOLLONIUS' not in os.environ else 17] * len(seen)"
    )
    one, agent = entered(tmp_path, attack)
    if not agent.policy.process.is_isolated:
        pytest.skip("this system has no Landlock")
    assert FORFEIT not in one.play(agent, "still", 0).outcomes
    assert victim.read_text() == "precious"


@pytest.mark.parametrize(
    "code", ["def nothing(): pass", "OBSERVATION = 'all'\ndef act(*_): return 0", "syntax error", "raise SystemExit(0)"]
)
def test_an_agent_that_does_not_start_is_refused_in_a_line(tmp_path, code):
    with pytest.raises(InvalidInput, match=r"mine\.py"):
        entered(tmp_path, code)


def test_worths_are_wins_less_losses_and_the_time_limit_is_the_evaders():
    outcomes = (1, 2, 3, 4, 5, 6, 7, FORFEIT)
    one = benchmark.Round(0, outcomes, (1,) * 8, (0,) * 8, "")
    pursuer = Benchmark("full", Role.PURSUER)._worths(one)
    assert pursuer.tolist() == [1, -1, 1, -1, 1, 0, -1, -1]
    assert Benchmark("full", Role.EVADER)._worths(one).tolist() == [-1, 1, -1, 1, -1, 0, 1, -1]
