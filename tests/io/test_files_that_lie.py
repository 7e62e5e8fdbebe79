"""Files that lie: damaged, crafted and huge ones are refused in one line, before anything large is built or read, or
are sound; never anything else."""

import json
import math
import os
import platform
import tomllib
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tomli_w
from safetensors.numpy import load, save

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, load_header, save_agent
from apollonius.agents.trained import trained_elsewhere
from apollonius.arenas.file import find_game, load_game, save_game, to_dict
from apollonius.arenas.map_file import load_map
from apollonius.catalogue import find_player, loss_value
from apollonius.cli.values import existing_agent, existing_game
from apollonius.evaluate.result import MatchResult
from apollonius.export.player import training_game
from apollonius.game.outcome import counts_by_name
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.io.document import parse_json
from apollonius.io.errors import InvalidInput
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import FORMAT as CHECKPOINT
from apollonius.learn.folder import (
    CheckpointMeta,
    Evaluation,
    load_checkpoint,
    load_checkpoint_meta,
    load_config,
    save_checkpoint,
)
from apollonius.learn.metrics import MetricsLine, load_metrics
from apollonius.learn.progress import ProcessStatus, load_status
from apollonius.play.replay import Replay, load_replay, save_replay
from apollonius.show.report import load_matches
from apollonius.solve.store import Problem, Solution, load_solution, save_solution

PAPER = make_game("paper")
GAME = replace(PAPER, arena=replace(PAPER.arena, polygons=(Polygon(((1.0, 6.0), (2.0, 6.0), (1.5, 8.0))),)))
COUNTS = counts_by_name([0, 2, 0, 0, 0, 0, 0, 2, 0])
RESULT = MatchResult(COUNTS, 500.0, 20.0)
STATE = {"weights": jnp.arange(6, dtype=jnp.float32).reshape(2, 3), "key": jax.random.key(0), "steps": jnp.int32(7)}
STANDING = CheckpointMeta("self-play", 3, 1.5, Evaluation(8, 2, COUNTS), 9)


def write_agent(path):
    save_agent(
        describe(make_network("paper", 4, 2, jax.random.key(0)), Role.EVADER, to_dict(GAME), {}, loss_value=3.0), path
    )


def read_agent(path):
    """What is done with an agent's header after it has been read."""
    player = find_player(str(path), Role.EVADER, PAPER)
    with suppress(InvalidInput):
        training_game(str(path))
    return loss_value(player, PAPER), trained_elsewhere(player, PAPER)


def read_replay(path):
    """What every command does with a replay; it plays a game again that is shaped like the sound one."""
    replay = load_replay(path)
    shaped = replay.states.shape == (4, 8) and replay.actions.shape == (3, 2) and to_dict(replay.game) == to_dict(GAME)
    return replay.ending(), replay.in_play(), replay.trajectory(), replay.first_difference() if shaped else None


def write_table(path):
    problem = Problem("reach", "pursuer", to_dict(GAME), [4, 3, 2, 5], 5, [0.5, 1.0])
    save_solution(Solution(problem, 12, 3e-5, jnp.arange(120, dtype=jnp.float32).reshape(2, 5, 4, 3)), path)


def write_replay(path):
    states, actions = np.ones((4, 8), np.float32), np.full((3, 2), 4)
    save_replay(Replay(GAME, "you", "still", 1, 5, 2, states, actions, Outcome.CAPTURED), path)


def write_map(path):
    path.with_suffix(".pgm").write_bytes(b"P5\n8 5\n255\n" + bytes([254] * 40))
    header = {"image": f"{path.stem}.pgm", "resolution": 0.5, "origin": [-1, 2, 0], "negate": 0, "mode": "trinary"}
    path.with_suffix(".yaml").write_text(json.dumps(header | {"occupied_thresh": 0.65, "free_thresh": 0.196}))


def write_metrics(path):
    line = MetricsLine("self-play", 8, 2, 1, 0.5, 16, COUNTS, 1.5, -2.0, {"pursuer": 0.1}, STANDING.best)
    path.write_text(json.dumps(asdict(line)) + "\n")


KINDS: dict[str, tuple[Any, Any, str]] = {
    "agent": (write_agent, read_agent, "a.safetensors"),
    "table": (write_table, load_solution, "t.safetensors"),
    "checkpoint": (
        lambda path: save_checkpoint(path, STATE, STANDING),
        lambda path: (load_checkpoint_meta(path), load_checkpoint(path, STATE)),
        "c.safetensors",
    ),
    "replay": (write_replay, read_replay, "r.json"),
    "game": (partial(save_game, to_dict(GAME)), load_game, "g.toml"),
    "json game": (partial(save_game, to_dict(GAME)), load_game, "g.json"),
    "map": (write_map, load_map, "m.yaml"),
    "image": (write_map, lambda path: load_map(path.with_suffix(".yaml")), "m.pgm"),
    "config": (lambda path: path.write_text(tomli_w.dumps(to_dict(RunConfig(game=GAME)))), load_config, "config.toml"),
    "metrics": (write_metrics, load_metrics, "metrics.jsonl"),
    "state": (
        lambda path: path.write_text(json.dumps(asdict(ProcessStatus("running", platform.node(), os.getpid(), "1_3")))),
        load_status,
        "state.json",
    ),
    "evaluation": (
        lambda path: path.write_text(json.dumps({"P_scratch against random": RESULT.to_dict()})),
        load_matches,
        "evaluation.json",
    ),
}
"""How a small file of each kind is written and read."""
ARRAYS = {"agent": "header", "table": "header", "checkpoint": CHECKPOINT}
"""Kinds of files in safetensors, and what their headers are called."""


TOML = ("game", "config")


def header_of(kind, path):
    """What a file says of itself, as data."""
    content = path.read_bytes()
    if kind in ARRAYS:
        size = int.from_bytes(content[:8], "little")
        told = json.loads(content[8 : 8 + size])["__metadata__"]
        return json.loads(told[ARRAYS[kind]])
    return tomllib.loads(content.decode()) if kind in TOML else json.loads(content)  # JSON is YAML


def with_header(kind, path, header):
    """The same file with other words about itself: data, or a text that is no data."""
    text = header if isinstance(header, str) else json.dumps(header)
    content = path.read_bytes()
    path.unlink()  # a file that is written over goes to the disk at once, which takes longer than all else
    if kind in ARRAYS:
        path.write_bytes(save(load(content), {ARRAYS[kind]: text}))
    else:
        path.write_text(text if kind not in TOML or isinstance(header, str) else tomli_w.dumps(header))


def refusal_of(kind, path):
    """How a file is refused; None where it is sound."""
    said = None
    try:
        KINDS[kind][1](path)
    except InvalidInput as refusal:
        said = str(refusal)
    assert said is None or len(said.splitlines()) == 1
    return said


@pytest.fixture
def file(tmp_path):
    """A function that writes a sound file of a kind."""

    def write(kind):
        path = tmp_path / KINDS[kind][2]
        KINDS[kind][0](path)
        assert refusal_of(kind, path) is None
        return path

    return write


LIES = [
    ("agent", {"observation": "lidar"}, "lidar (8 numbers); this program has paper (8), encoded (17)"),
    ("agent", {"observation_size": 10}, "observation paper (10 numbers)"),
    *[("agent", lie, "do not fit its header") for lie in ({"width": 7}, {"depth": 3}, {"depth": 1})],
    ("agent", {"symmetric": True}, "symmetric = true is not possible: it must be false where a network is of 'paper'"),
    *[("agent", {"version": version}, f"version {version}") for version in (2, 0, "1")],
    ("agent", {"network": "gaussian"}, "do not fit"), ("agent", {"network": "sideways"}, "of the kind sideways"),
    ("agent", {"depth": 10**6}), ("agent", {"depth": 1e300}), ("agent", {"width": True}),
    ("agent", {"observation": {}}), ("agent", {"observation_size": None}), ("agent", {"role": "referee"}),
    *[
        ("agent", {"loss_value": value}, "loss_value")
        for value in ("x", {}, [], True, 0, -1.0, 1e300, float("nan"), 10**400)
    ],
    *[
        ("agent", {"clearance_margin": margin}, "clearance_margin")
        for margin in ("x", {}, [], True, None, -1.0, 1e300, float("nan"), 10**400)
    ],
    ("agent", {"clearance_margin": 0.05}, "0 where a network does not value actions, or reads 'paper'"),
    ("agent", {"game": 3}), ("agent", {"num_actions": 8}), ("agent", {"version": 10**4000}),
    ("table", {"format": "another"}), ("table", {"version": 99}),
    ("table", {"problem": None}), ("table", {"sweeps": -1}), ("table", {"residual": float("nan")}),
    *[("table", {"problem": {**to_dict(Problem("safety", "pursuer", {}, [4, 3, 2, 5], 5)), **lie}}) for lie in (
        {"hold": 0}, {"hold": 10**18}, {"role": "both"}, {"kind": "chess"}, {"counts": [4, 3, 2]},
        {"counts": [10**13, 3, 2, 5]}, {"counts": "4325"}, {"game": []}, {"target": [1.0, 2.0]},
        {"kind": "game", "counts": [900, 900, 9, 9]},
    )],
    ("checkpoint", {"chunks": -1}), ("checkpoint", {"seconds": float("nan")}), ("checkpoint", {"best": 3}),
    ("checkpoint", {"best": {"outcomes": {"won": 1}}}), ("checkpoint", {"metrics_bytes": 2**70}),
    ("replay", {"actions": [[0.5, 1], [1, 1], [1, 1]]}), ("replay", {"actions": [[10**30, 1]] * 3}),
    ("replay", {"states": [[1e30] * 8] * 4}), ("replay", {"states": [[1] * 8, [1]] * 2}), ("replay", {"seed": -1}),
    ("replay", {"index": 5}), ("replay", {"games": 10**12}), ("replay", {"pursuer": "\x1b[31m"}),
    ("replay", {"tolerance": float("inf")}), ("replay", {"game": {"dt": True}}),
    ("replay", {"states": [["1"] * 8] * 4}), ("replay", {"format": 2}, "it must be 1, as this version reads"),
    ("replay", {"actions": [[0, 8]]}, "a row of 8 more than actions"), ("replay", "{", "is no replay"),
    ("replay", {"actions": [[0, 9]] * 3}, "from 0 to 8"), ("replay", {"states": None}, "is no replay"),
    ("replay", {"actions": [[[0.0, 0.0], [1.5, 0.0]]] * 3}, "from -1 to 1"),
    ("replay", {"outcome": "flew away"}, "flew away is not possible: it must be how a game can end"),
    ("replay", {"game": {"dt": -1.0}}, "dt = -1.0"), ("replay", {"game": {"wind": 1.0}}, "unknown key 'wind'"),
    ("game", {"dt": 10**4000}), ("json game", "{", "g.json' is no JSON file; correct it"),
    ("game", {"max_steps": 1.5}), ("config", {"evaders": 3}),
    ("config", {"fixed_target": {"evaluation_games": 10**29}}),
    ("metrics", {"episodes": -1}), ("metrics", {"outcomes": {"captured": 1}}), ("metrics", {"losses": {}}),
    ("metrics", {"seconds": 10**29}), ("metrics", {"pursuer_return": 1e300}), ("metrics", {"stage": None}),
    *[("evaluation", {"P_scratch against random": to_dict(RESULT) | lie}) for lie in (
        {"outcomes": COUNTS | {"captured": -1}}, {"outcomes": dict.fromkeys(COUNTS, 0)}, {"outcomes": {"won": 1}},
        {"mean_steps": float("nan")}, {"arenas": {"wins": [3]}}, {"robots": 3},
    )],
    ("evaluation", {"P_scratch": {}}), ("evaluation", {"a against b": 3}),
    *[("state", {"process": number}) for number in (-1, 2**31, 10**30, 1.5, True)],
    ("state", {"state": "paused"}), ("state", {"machine": None}), ("state", {"job": 3}),
    ("map", {"resolution": 10**4000}), ("map", {"mode": [[["trinary"]]]}), ("map", {"image": "x" * 5000}),
]  # fmt: skip


@pytest.mark.parametrize("told_of", LIES, ids=lambda given: f"{given[0]} {given[1]}"[:60])
def test_impossible_headers_are_refused(told_of, file):
    kind, lie, *words = told_of
    path = file(kind)
    with_header(kind, path, lie if isinstance(lie, str) else header_of(kind, path) | lie)
    said = refusal_of(kind, path)
    assert said is not None
    assert len(said) < 1_200
    assert all(word in said for word in words)


@pytest.mark.parametrize("kind", sorted({*KINDS} - {"image"}))
@pytest.mark.parametrize("text", ["{'a': 1", "", '{"version":' + "9" * 5_000 + "}", "[" * 100_000])
def test_malformed_headers_are_refused(kind, text, file):
    path = file(kind)
    with_header(kind, path, text)
    if text or kind not in ("game", "config", "metrics"):  # which may have nothing but defaults, or no line yet
        assert refusal_of(kind, path) is not None


@pytest.mark.parametrize(("kind", "key"), [("agent", "game"), ("metrics", "losses"), ("evaluation", "a against b")])
def test_deep_nesting_is_refused(kind, key, file):
    path = file(kind)
    deep = '{"a":' * 500 + "1" + "}" * 500
    text = json.dumps(header_of(kind, path) | {key: 0}).replace(f'"{key}": 0', f'"{key}": {deep}')
    with_header(kind, path, text)
    assert "nested too deeply" in (refusal_of(kind, path) or "")


@pytest.mark.parametrize(("kind", "bad"), [*zip(ARRAYS, (np.nan, np.inf, -np.inf), strict=True)])
def test_non_finite_numbers_are_refused(kind, bad, file):
    path = file(kind)
    text, arrays = json.dumps(header_of(kind, path)), load(path.read_bytes())
    name = next(name for name, array in arrays.items() if array.dtype == np.float32)
    arrays[name] = np.array(arrays[name])
    arrays[name].flat[-1] = bad
    path.write_bytes(save(arrays, {ARRAYS[kind]: text}))
    assert "not finite" in (refusal_of(kind, path) or "")


@pytest.mark.parametrize("shape", [(10**13,), (2, 5, 4, 10**9), (2, 5, 4, 4), (120,), ()])
def test_table_with_another_size_than_its_header_is_refused(shape, file):
    path = file("table")
    content = path.read_bytes()
    size = int.from_bytes(content[:8], "little")
    claims = json.loads(content[8 : 8 + size])
    claims["table"]["shape"] = list(shape)
    for end in (480, 4 * math.prod(shape)):
        claims["table"]["data_offsets"] = [0, end]
        header = json.dumps(claims).encode()
        path.unlink()
        path.write_bytes(len(header).to_bytes(8, "little") + header + content[8 + size :])
        assert refusal_of("table", path) is not None
    arrays = load(content)
    for wrong in ({"other": np.zeros(3, np.float32)}, {"table": arrays["table"].astype(np.float16)}):
        path.write_bytes(save(arrays | wrong, claims["__metadata__"]))
        assert "size" in (refusal_of("table", path) or "")


@pytest.mark.parametrize("kind", ["discs", "polygons"])
def test_too_many_obstacles_and_overlong_numbers_are_refused(kind, tmp_path):
    one = "x = 5\ny = 5\nradius = 0.01\n" if kind == "discs" else "vertices = [[5, 5], [6, 5], [5, 6]]\n"
    path = tmp_path / "g.toml"
    path.write_text(f"[[arena.{kind}]]\n{one}" * 1_000)
    assert "occupancy map" in (refusal_of("game", path) or "")
    path.write_text(f"[[arena.{kind}]]\n{one}" * 100_000)
    assert "bytes" in (refusal_of("game", path) or "")
    path.write_text("dt = 0x" + "f" * 6_000)
    assert refusal_of("game", path) is not None


@pytest.mark.parametrize("kind", [*TOML, "json game"])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_utf_8_byte_order_mark_is_accepted_and_utf_16_toml_is_refused(kind, encoding, file):
    path = file(kind)
    path.write_bytes(path.read_bytes().decode().encode(encoding))
    refused = encoding == "utf-16" and kind in TOML
    assert (refusal_of(kind, path) or "").endswith("(it is UTF-16: save it as UTF-8)." * refused)
    assert (refusal_of(kind, path) is None) == (not refused)


@pytest.mark.parametrize(
    ("kind", "name"), [("game", "HALL.TOML"), ("json game", "HALL.JSON"), ("agent", "P.SAFETENSORS")]
)
def test_file_suffixes_may_be_upper_case(kind, name, tmp_path):
    file, find = tmp_path / name, load_header if kind == "agent" else find_game
    KINDS[kind][0](tmp_path / KINDS[kind][2])
    (tmp_path / KINDS[kind][2]).rename(file)
    assert find(file if kind == "agent" else str(file))
    assert (existing_agent if kind == "agent" else existing_game)(str(file)) == str(file)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("kind", KINDS)
def test_pipe_in_place_of_a_file_is_refused_without_waiting(kind, file):
    path = file(kind)
    path.unlink()
    os.mkfifo(path)
    assert refusal_of(kind, path) is not None


def test_key_that_comes_twice_is_refused():
    with pytest.raises(InvalidInput, match=r"a record .*'dt' comes twice: remove one"):
        parse_json('{"dt": 0.1, "pursuer": {"radius": 1}, "dt": 0.2}', "a record")
    assert parse_json('{"a": {"dt": 1}, "b": {"dt": 2}}', "a record") == {"a": {"dt": 1}, "b": {"dt": 2}}
