"""Bags of the ROS 2 node: their decisions taken again, and the refusal of all that the node does not write."""

import json
from dataclasses import asdict

import jax
import numpy as np
import pytest

from apollonius.arenas.file import find_game, to_dict
from apollonius.cli.main import main
from apollonius.export import writing
from apollonius.export.bag import bag_of, recompute_decisions
from apollonius.export.player import find_exportable
from apollonius.export.writing import write_c
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput
from tests.documents import REPOSITORY
from tests.export.bags import write_bag

SOUND = {
    "time": 100.5, "step": 3, "trouble": "", "states": [[1, 2, 0.5, 0.1], [3.0, 4.0, 0.0, 1.0]],
    "active": [True, True], "bits": 7, "action": [8], "controls": [0.3, 0.8], "latency": 0.001, "ages": [0.0, None],
}  # fmt: skip
BRAKED = SOUND | {"trouble": "robot2: never seen", "states": [], "active": [], "controls": []}
EXPORT = {"player": "intercept", "side": "pursuer", "game": to_dict(find_game("paper")), "dt": 0.1}


def texts(export=EXPORT, *decisions):
    return {"export": [json.dumps(export).encode()], "decisions": [json.dumps(one).encode() for one in decisions]}


def test_export_names_a_map_without_its_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "_check", lambda *_: [])
    game = find_game(str(REPOSITORY / "examples" / "dodecahedron.toml"))
    write_c(find_exportable("intercept", Role.PURSUER, game), tmp_path / "robot.c")
    text = (tmp_path / "robot.robot.json").read_text()
    assert str(REPOSITORY) not in text
    bag = bag_of(texts(json.loads(text), SOUND), "a bag")
    with pytest.raises(InvalidInput, match="give --game"):
        assert bag.game
    monkeypatch.chdir(REPOSITORY / "examples")
    assert bag.game.arena.map.digest == game.arena.map.digest


def random_bag(name, game, steps):
    """A bag of decisions in states at random, some of them braking, in two games."""
    player, rng = find_exportable(name, Role.PURSUER, game), np.random.default_rng(0)
    decisions, memory, decide = [], player.memory, jax.jit(player.decide)
    for step in range(steps):
        told = {"time": 100 + 0.1 * step, "step": step % 10, "trouble": "late" if step % 4 == 3 else ""}
        if not told["trouble"]:
            states, bits = rng.uniform(1, 4, (player.robots, 4)), int(rng.integers(2**32))
            active = [True] * player.robots
            memory = player.memory if step % 10 == 0 else memory
            given = np.array(active) if player.robots > 2 else None
            made = decide(player.policy, player.game, states.astype(np.float32), given, None, memory, np.uint32(bits))
            memory = made["memory"]
            told |= {"states": states.tolist(), "active": active, "bits": bits}
            told |= {"controls": np.asarray(made["controls"]).astype(float).tolist()}
        decisions.append(told)
    return EXPORT | {"player": name, "game": to_dict(game)}, decisions


@pytest.mark.parametrize(
    ("name", "game", "other", "refused"),
    [("random", "paper", "team-3v1", "2 .* 4, as in 3 v 1"), ("intercept", "team-3v1", "paper", "4 .* 2, as in 1 v 1")],
)
def test_recomputed_decisions_differ_only_where_they_were_changed(name, game, other, refused):
    export, decisions = random_bag(name, find_game(game), 20)
    bag = bag_of(texts(export, *decisions), "a bag")
    assert recompute_decisions(bag, name, bag.game) == []
    then = decisions[12]["controls"]
    then[1] += 0.1
    bag = bag_of(texts(export, *decisions), "a bag")
    assert len(bag.player_decisions) == 15
    (one,) = recompute_decisions(bag, name, bag.game)
    assert (one["time"], one["step"], one["recorded"]) == (pytest.approx(1.2), 2, then)
    assert one["recomputed"][1] == pytest.approx(then[1] - 0.1)
    with pytest.raises(InvalidInput, match=f"robots in the bag = {refused}"):
        recompute_decisions(bag, name, find_game(other))


def test_bag_is_read_as_the_node_writes_it():
    bag = bag_of(texts(EXPORT, SOUND, BRAKED), "a bag")
    assert (bag.player, bag.side, bag.game) == ("intercept", Role.PURSUER, find_game("paper"))
    assert bag.player_decisions == [bag.decisions[0]]
    assert asdict(bag.decisions[0]).items() <= (SOUND | {
        "states": ((1.0, 2.0, 0.5, 0.1), (3.0, 4.0, 0.0, 1.0)), "active": (True, True), "controls": (0.3, 0.8)
    }).items()  # fmt: skip


@pytest.mark.parametrize(
    "wrong",
    [
        {"active": 3}, {"active": [True]}, {"active": [1, 1]}, {"step": "x"}, {"step": -1}, {"step": 2**31},
        {"step": True}, {"trouble": 3}, {"states": [[1, 2], [3, 4]]}, {"states": "x"}, {"states": ["abcd", "efgh"]},
        {"states": [[1, 2, 0, 1e300]] * 2}, {"bits": -1}, {"bits": 2**40}, {"bits": 0.5}, {"controls": None},
        {"controls": [0.3]}, {"controls": [0.1, 0.2, 0.3]}, {"controls": ["a", "b"]}, {"time": None}, {"time": 1e300},
        {"time": "now"},
    ],
    ids=str,
)  # fmt: skip
def test_malformed_decision_is_refused(wrong):
    with pytest.raises(InvalidInput, match=r"^a bag"):
        bag_of(texts(EXPORT, SOUND, SOUND | wrong), "a bag")


@pytest.mark.parametrize(
    "wrong",
    [
        {"side": "x"},
        {"side": 3},
        {"side": ["pursuer"]},
        {"player": 3},
        {"player": None},
        {"game": "paper"},
        {"game": 3},
    ],
    ids=str,
)
def test_malformed_export_is_refused(wrong):
    with pytest.raises(InvalidInput, match=r"^a bag"):
        bag_of(texts(EXPORT | wrong, SOUND), "a bag")


@pytest.mark.parametrize(
    "name", ["shielded:" * 3000, "searching:" * 3000, "x" * 1000], ids=["shields", "searches", "long"]
)
def test_impossible_player_name_is_refused(name):
    bag = bag_of(texts(EXPORT | {"player": name}, SOUND), "a bag")
    with pytest.raises(InvalidInput, match=name[:9]):
        recompute_decisions(bag, bag.player, bag.game)


def test_bag_without_decisions_or_with_no_single_export_is_refused():
    sound = texts(EXPORT, SOUND)
    (export,) = sound["export"]
    for wrong in ({"decisions": []}, {"export": []}, {"export": [export] * 2}, {"export": [b"{}"]}, {"export": [b"3"]}):
        with pytest.raises(InvalidInput, match=r"^a bag"):
            bag_of(sound | wrong, "a bag")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    pytest.importorskip("rosbags", reason="needs rosbags: pip install rosbags")
    export, decisions = random_bag("intercept", find_game("paper"), 12)
    return write_bag(tmp_path_factory.mktemp("bags") / "bag", json.dumps(export), map(json.dumps, decisions))


def test_replay_command_recomputes_a_bag_and_refuses_other_files(folder, tmp_path, capsys):
    assert main(["replay", "--bag", str(folder)]) == 0
    assert "intercept in the 9 states of" in capsys.readouterr().out
    (tmp_path / "metadata.yaml").write_bytes(b"\xff")
    for wrong in (tmp_path, tmp_path / "metadata.yaml", tmp_path / "nowhere"):
        assert main(["replay", "--bag", str(wrong)]) == 2
        assert capsys.readouterr().err.count("\n") == 1
