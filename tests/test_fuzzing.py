"""Files of all kinds that strangers can write, changed at random: each is sound and can be used, or is refused in one
line; there is never another exception."""

import gc
import json
import random
import shutil
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
import tomli_w
import yaml
from matplotlib.figure import Figure
from PIL import Image

from apollonius.agents.network import make_actor, make_network
from apollonius.agents.store import describe, load_header, save_agent
from apollonius.arenas.file import find_game, from_dict, load_game, to_dict
from apollonius.arenas.map_file import load_map
from apollonius.arenas.survey import map_notes, survey
from apollonius.benchmark import track
from apollonius.benchmark.card import FORMAT, SuiteCard, load_card
from apollonius.benchmark.scenarios import FOLDER as SCENARIOS
from apollonius.benchmark.scenarios import load_scenario
from apollonius.benchmark.track import ROUNDS, Benchmark, Round
from apollonius.catalogue import find_player
from apollonius.cli.terminal import runs_table
from apollonius.evaluate.match import Match
from apollonius.export.bag import bag_of, load_bag, recompute_decisions
from apollonius.game.arena import Arena
from apollonius.game.game import Game, sample_starts
from apollonius.game.types import Role
from apollonius.io.document import to_json
from apollonius.io.errors import InvalidInput, require
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import METRICS, load_checkpoint_meta, load_config, save_checkpoint
from apollonius.learn.metrics import MetricsLine, begin_metrics
from apollonius.learn.progress import STATE, progress_of
from apollonius.observe.view import look
from apollonius.play.replay import load_replay
from apollonius.show.animation import save_animation
from apollonius.show.report import for_page, render, report_of
from apollonius.simulate.drive import RobotHardware, load_drive
from apollonius.simulate.drive_record import load_drive_record
from apollonius.simulate.simulation import simulate_match
from apollonius.solve.grid import make_grid
from apollonius.solve.store import Problem, Solution, is_solution, load_solution, save_solution
from tests.acting import robot, state
from tests.damage import mutated
from tests.documents import REPOSITORY
from tests.export.bags import write_bag, write_drive
from tests.export.test_bag import BRAKED, EXPORT, SOUND
from tests.io.test_files_that_lie import COUNTS, GAME, KINDS, PAPER, STANDING, read_agent, read_replay, write_map
from tests.simulate.recorded import Robot, record_of

DRAWN = set()
"""Shapes of games for which starts have been drawn."""
MOST_DRAWN = 12
"""Most of these: each takes seconds to compile."""


@jax.jit
def action_of(player, seen, bits):
    return player(seen, player.memory, bits)[0]


def act(path, game, role):
    """Ask the player of a file for an action at the start of a game."""
    player, start = find_player(str(path), role, game).policy, state((2, 2), (8, 8))
    action = action_of(player, player.observation(look(game, start, role)), np.uint32(0))
    assert np.isfinite(action).all()
    assert np.all(action < 9)


def agents(folder):
    """Return agents that value actions, and one that draws them."""
    path, key = folder / "another.safetensors", jax.random.key(0)
    found = of("agent")(folder)
    for network in (make_network("encoded", 4, 2, key), make_actor("paper", 4, 2, key)):
        save_agent(describe(network, Role.PURSUER, to_dict(GAME), {"seed": 3}), path)
        found.append(path.read_bytes())
    return found


def use_agent(path):
    role = Role[load_header(path).role.upper()]
    act(path, PAPER, role)
    if role is Role.EVADER:
        read_agent(path)


def use_replay(path):
    read_replay(path)
    replay = load_replay(path)
    to_json(for_page(replay))
    save_animation(replay, path.with_suffix(".png"), 1.0)


def write_duel(path):
    problem = Problem("game", "evader", to_dict(PAPER), [2, 2, 2, 3], 5)
    save_solution(Solution(problem, 12, 3e-5, jnp.zeros((1, 24, 24), jnp.float16)), path)


def use_table(path):
    solution = load_solution(path)
    assert is_solution(path)
    problem = solution.problem
    if problem.kind == "game":
        act(path, PAPER, Role[problem.role.upper()])
    else:
        grid = make_grid(GAME.arena, GAME.pursuer, tuple(problem.counts))
        assert np.isfinite(grid.interpolate(solution.table, robot(5, 5)))


def games(folder):
    """Return games that have all that a game can have."""
    write_map(folder / "m.yaml")
    seeing = {"sensors": {"pursuer": {"range": 3.0}}, "drives": {"evader": {"lag": 2}}}
    mapped = {"arena": {"map": "m.yaml"}, "starts": {"clearance": 0.2}} | seeing
    several = {"scenario": "suite-v1/racks-07,racks-01", "pursuers": 2}
    names = "office", "team-3v2", "lidar", "territory", "zero-sum"
    return [*(to_dict(find_game(name)) for name in names), mapped, several]


def use_game(path):
    game = load_game(path)
    record = to_dict(game)
    to_json(record)
    assert to_dict(from_dict(Game, record, "it")) == record
    shapes = jax.tree.structure(game), *map(np.shape, jax.tree.leaves(game))
    if shapes in DRAWN or len(DRAWN) < MOST_DRAWN:
        DRAWN.add(shapes)
        assert np.isfinite(jax.tree.leaves(sample_starts(game, jax.random.key(0), 2))).all()
    if game.scenario is None:
        survey(game)


def yaml_maps(folder):
    write_map(folder / "m.yaml")
    record = json.loads((folder / "m.yaml").read_bytes())
    return [yaml.safe_dump(record | more).encode() for more in ({}, {"negate": "no", "least_obstacle": 0.5})]


def images(kinds, form, folder):
    """Return a floor as an image of each of some kinds."""
    write_map(folder / "m.yaml")
    record = json.loads((folder / "m.yaml").read_bytes())
    (folder / "m.yaml").write_bytes(json.dumps(record | {"image": f"m.{form}"}).encode())
    grey = np.full((5, 8), 254, np.uint8)
    grey[:2, :3], grey[4, 4] = 0, 205
    return [encode_image(grey, kind, {"pgm": "PPM"}.get(form, form)) for kind in kinds]


def encode_image(grey, kind, form):
    file = BytesIO()
    image = Image.fromarray(grey.astype(np.uint16) * 257) if kind == "I;16" else Image.fromarray(grey).convert(kind)
    image.save(file, form)
    return file.getvalue()


def pgm_images(folder):
    return [*images(("L", "RGB"), "pgm", folder), b"P2\n# plain\n4 2\n255\n254 0 254 254\n254 254 205 254\n"]


def use_map(path):
    one = load_map(path.with_suffix(".yaml"))
    one.occupied()
    map_notes(Arena(float(one.x), float(one.x_max), float(one.y), float(one.y_max), map=one))


def decisions(folder):
    """Return what a robot records: an export, and what was decided in its game, a text in each line."""
    team = EXPORT | {"game": to_dict(find_game("team-2v1"))}
    three = SOUND | {"states": [[1, 2, 0.5, 0.1]] * 3, "active": [True, True, False]}
    return [b"\n".join(json.dumps(one).encode() for one in bag) for bag in ((EXPORT, SOUND, BRAKED), (team, three))]


def use_bag(bag):
    recompute_decisions(bag, bag.player, bag.game)
    assert bag.side in Role


def use_decisions(path):
    texts = path.read_bytes().splitlines()
    use_bag(bag_of({"export": texts[:1], "decisions": texts[1:]}, "a bag"))


def bag_files(name, folder):
    """Return a file of a bag that a robot recorded."""
    pytest.importorskip("rosbags", reason="needs rosbags: pip install rosbags")
    write_bag(folder / "bag", json.dumps(EXPORT), [json.dumps(one) for one in (SOUND, BRAKED)])
    return [(folder / "bag" / name).read_bytes()]


def drive_bags(folder):
    """Return a file of a bag of a robot that turns on the spot."""
    pytest.importorskip("rosbags", reason="needs rosbags: pip install rosbags")
    record = record_of(Robot(rate=10.0), [(0, 0, 4), (0, 1, 3), (0, -1, 3), (0, 0, 3)])
    write_drive(folder / "drive", record, stamped=True)
    return [(folder / "drive" / "drive.mcap").read_bytes()]


def cards(folder):
    """Return the card of an agent whose games have been made up."""
    one = Benchmark("full", Role.PURSUER)
    rounds = tuple(Round(seed, (1, 7), (9, 60), (0, 0), "0" * 16, "") for seed in range(ROUNDS))
    opponents = dict.fromkeys(one.panel, rounds)
    card = SuiteCard(
        "intercept", "0" * 64, "pursuer", "full", one.score(opponents), 3.0, "a machine", one.digests, opponents, FORMAT
    )
    return [to_json(asdict(card)).encode()]


def scenarios(folder):
    """Return the sound scenarios of a game, which lies beside them."""
    shutil.copy(SCENARIOS / "late_brake.toml", folder / "mine.toml")
    return [(SCENARIOS / "late_brake.json").read_bytes()]


def drives(folder):
    return [tomli_w.dumps(asdict(RobotHardware())).encode(), b"mass = 30\nfriction = 0.4\nlatency = 0.1\n"]


def use_drive(path):
    drive = load_drive(path)
    if find_spec("mujoco"):
        simulate_match(Match.of_names(replace(PAPER, max_steps=3), "intercept", "still", 2), drive)


def configs(folder):
    place = REPOSITORY / "examples" / "recipes"
    recipes = [place / f"{name}.toml" for name in ("optimal_evader", "response", "robust")]
    return [tomli_w.dumps(to_dict(RunConfig(game=GAME))).encode(), *(path.read_bytes() for path in recipes)]


def use_config(path):
    config = load_config(path)
    copy = path.with_name("copy.toml")
    copy.write_bytes(tomli_w.dumps(to_dict(config)).encode())
    assert to_dict(load_config(copy)) == to_dict(config)
    assert {name: plan.chunks for name, plan in config.by_name.items()}


def metrics_of(chunks):
    """Return the metrics of a run of two stages."""
    many = [("fixed-target", 1), *(("self-play", chunk) for chunk in range(1, chunks + 1))]
    values = [(COUNTS, 1 / chunk, -2.0, {"pursuer": 1 / chunk}, STANDING.best) for _, chunk in many]
    records = [MetricsLine(*one, 2, 9, 0.5, 16, *rest) for one, rest in zip(many, values, strict=True)]
    return b"".join(to_json(asdict(one)).encode() + b"\n" for one in records)


def run_file(name, folder):
    """Return a file of a run's folder, in which all others are; curves, which take a second, if it is of metrics."""
    for kind in ("config", "evaluation", "state"):
        KINDS[kind][0](folder / KINDS[kind][2])
    chunks = 3 if name == METRICS else 1
    metrics = metrics_of(chunks)
    (folder / METRICS).write_bytes(metrics)
    standing = replace(STANDING, chunks=chunks, metrics_bytes=len(metrics))
    save_checkpoint(folder / "checkpoint.safetensors", {}, standing)
    return [(folder / name).read_bytes()]


def use_run(path):
    """Do what the commands do that list, resume and report a run, short of training and playing."""
    run = path.parent
    progress = progress_of(run)
    table = runs_table([progress], run.parent).split("\n")
    assert len(table) == 2 + bool(progress.state.error)
    assert all(line.isprintable() for line in table)
    to_json(asdict(progress) | {"folder": str(run)})
    require(not progress.state.error, "run", progress.state.error, "whole")
    config = load_config(run / "config.toml")
    standing = load_checkpoint_meta(run / "checkpoint.safetensors", config)
    with suppress(InvalidInput):  # of other metrics
        begin_metrics(shutil.copy(run / METRICS, run / "copy.jsonl"), standing)
    render(report_of(run))


def of(kind):
    """Return the sound file of one of the kinds that other tests write."""

    def sound(folder):
        KINDS[kind][0](folder / KINDS[kind][2])
        return [(folder / KINDS[kind][2]).read_bytes()]

    return sound


def tables(folder):
    write_duel(folder / "duel.safetensors")
    return [*of("table")(folder), (folder / "duel.safetensors").read_bytes()]


class Kind(NamedTuple):
    """A kind of file: its name, its form, what returns sound ones beside which all is that they need, and their use."""

    file: str
    form: str
    sound: Callable[[Path], list[bytes]]
    use: Callable[[Path], object]


FUZZED = {
    "agent": Kind("a.safetensors", "arrays", agents, use_agent),
    "table": Kind("t.safetensors", "arrays", tables, use_table),
    "checkpoint": Kind("c.safetensors", "arrays", of("checkpoint"), KINDS["checkpoint"][1]),
    "replay": Kind("r.json", "json", of("replay"), use_replay),
    "game": Kind("g.toml", "toml", lambda folder: [tomli_w.dumps(one).encode() for one in games(folder)], use_game),
    "json game": Kind("g.json", "json", lambda folder: [json.dumps(one).encode() for one in games(folder)], use_game),
    "map": Kind("m.yaml", "yaml", yaml_maps, use_map),
    "pgm image": Kind("m.pgm", "bytes", pgm_images, use_map),
    "png image": Kind("m.png", "png", partial(images, ("1", "L", "LA", "RGBA", "P", "I;16"), "png"), use_map),
    "decisions": Kind("bag.jsonl", "lines", decisions, use_decisions),
    "bag": Kind("bag/bag.mcap", "bytes", partial(bag_files, "bag.mcap"), lambda path: use_bag(load_bag(path.parent))),
    "bag's metadata": Kind(
        "bag/metadata.yaml", "yaml", partial(bag_files, "metadata.yaml"), lambda path: use_bag(load_bag(path.parent))
    ),
    "drive's bag": Kind(
        "drive/drive.mcap", "bytes", drive_bags, lambda path: load_drive_record(path.parent, "odom", "cmd_vel")
    ),
    "card": Kind("card.json", "json", cards, load_card),
    "scenario": Kind("mine.json", "json", scenarios, load_scenario),
    "drive": Kind("drive.toml", "toml", drives, use_drive),
    "config": Kind("train.toml", "toml", configs, use_config),
    "run's config": Kind("config.toml", "toml", partial(run_file, "config.toml"), use_run),
    "run's state": Kind(STATE, "json", partial(run_file, STATE), use_run),
    "run's metrics": Kind(METRICS, "lines", partial(run_file, METRICS), use_run),
    "run's checkpoint": Kind("checkpoint.safetensors", "arrays", partial(run_file, "checkpoint.safetensors"), use_run),
    "run's evaluation": Kind("evaluation.json", "json", partial(run_file, "evaluation.json"), use_run),
}


@pytest.fixture(scope="module", autouse=True)
def as_shipped():
    """Nothing checks types, for their errors are refusals; nor figures, which are of odd numbers; a small benchmark."""
    jaxtyping.config.update("jaxtyping_disable", True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", Figure.savefig.__wrapped__)
        patch.setattr(Benchmark, "game", replace(find_game("suite-v2/fences-00,fences-01"), max_steps=60))
        patch.setattr(Benchmark, "arenas", ("fences-00", "fences-01"))
        patch.setattr(track, "PANELS", {"full": {"evader": ("still", "random")}})
        yield
    jaxtyping.config.update("jaxtyping_disable", False)


def refusal_of(use, path):
    """Return how a file is refused; None where it is sound."""
    try:
        use(path)
    except InvalidInput as refusal:
        return str(refusal)
    return None


@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")  # which rosbags leaves where it fails
@pytest.mark.parametrize("cases", [8, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", FUZZED)
def test_mutated_file_is_sound_or_refused_in_one_line(kind, cases, tmp_path):
    file, form, sound, use = FUZZED[kind]
    path, rng, count = tmp_path / file, random.Random(kind), Counter()
    contents = sound(tmp_path)
    for content in contents:
        path.write_bytes(content)
        use(path)
    for _ in range(cases):
        path.unlink()  # a file that is written over goes to the disk at once, which takes longer than all else
        path.write_bytes(mutated(form, rng.choice(contents), rng))
        said = refusal_of(use, path)
        assert said is None or (said.isprintable() and len(said) < 1_200)
        count["sound" if said is None else "refused"] += 1
    gc.collect()
    print(f"{kind}: {count['sound']} sound, {count['refused']} refused")
    assert min(count["sound"], count["refused"]) >= cases // 100
