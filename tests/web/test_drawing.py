"""Arenas drawn on the page are the package's: their files, their rules, what a survey says of them, links to them."""

import json
import shutil
import subprocess
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

from apollonius.agents.trained import ZOO
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game, load_game
from apollonius.arenas.map_file import load_map
from apollonius.arenas.record import to_dict
from apollonius.arenas.survey import survey
from apollonius.catalogue import find_player
from apollonius.game.game import reset_batch
from apollonius.game.starts import Starts
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.registry import observe
from apollonius.play.replay import as_rows, as_state, play_actions
from apollonius.web.site import PAGE
from tests.web.test_parity import TOLERANCE, any_actions, apart
from tests.web.test_parity import ask as ask_rules

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
STEPS = 10


def ask(**question):
    program = ["node", str(Path(__file__).with_name("check_drawing.mjs"))]
    question = json.dumps({"page": str(PAGE)} | question)
    answer = subprocess.run(program, input=question, capture_output=True, text=True, check=True, timeout=500)
    return json.loads(answer.stdout)


def drawn_games(count, seed, folder):
    """Games drawn by a fuzzer on the page, as the page has them and as the package reads the files that it saves."""
    pairs = []
    for number, drawing in enumerate(ask(fuzz={"count": count, "seed": seed})["fuzz"]):
        assert drawing["isSame"], "a link brings the same game"
        path = folder / f"drawn-{number}.json"
        path.write_text(drawing["file"])
        pairs.append((drawing["game"], load_game(path)))
    return pairs


@partial(jax.jit, static_argnums=2)
def begin(game, key, count):
    return reset_batch(replace(game, starts=Starts(speed="moving", clearance=0.02)), key, count)


def starts_close_by(game, key, count):
    """States of robots that move, close to obstacles, as rows."""
    return np.asarray(as_rows(begin(game, key, count)))


@jax.jit
def play(game, row, actions):
    return play_actions(game, as_state(row, jnp.asarray(0)), actions)


def play_alike(pairs, seed):
    """Random play in drawn arenas from starts close to obstacles comes out the same."""
    random, told, expected = np.random.default_rng(seed), [], []
    for number, (record, game) in enumerate(pairs):
        actions = any_actions(random, (2, 2)).repeat(STEPS // 2, axis=0)
        (row,) = starts_close_by(game, jax.random.key(number), 1)
        states, outcomes = jax.tree.map(np.asarray, play(game, jnp.asarray(row), jnp.asarray(actions)))
        told.append({"game": record, "states": [np.asarray(row).tolist()], "actions": actions.tolist()})
        expected.append((np.asarray(as_rows(states)), outcomes))
    for (states, outcomes), game in zip(expected, ask_rules(games=told)["games"], strict=True):
        length = int(np.argmax(outcomes != Outcome.ONGOING)) + 1 if outcomes.any() else STEPS
        assert apart(game["rows"][: length + 1], states[: length + 1]) <= TOLERANCE
        assert game["outcomes"][length - 1] == Outcome(int(outcomes[length - 1])).name.lower()


def test_what_is_drawn_is_what_is_saved_and_played(tmp_path):
    pairs = drawn_games(2, 1, tmp_path)
    for record, game in pairs:
        assert json.loads(json.dumps(to_dict(game))) == json.loads(json.dumps(record))
    play_alike(pairs, 1)


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_a_thousand_drawn_arenas(tmp_path):
    """10,000 states; what a survey says of ten of them."""
    pairs = drawn_games(1000, 100, tmp_path)
    play_alike(pairs, 2)
    some = pairs[::100]
    for found, (_, game) in zip(ask(surveys=[record for record, _ in some])["surveys"], some, strict=True):
        assert_said_alike(found, survey(game))


ANY = {Role.PURSUER: "P_any", Role.EVADER: "E_any"}
"""Who plays in arenas that nobody has seen."""


@eqx.filter_jit
def valued(policy, rows, game, role):
    """What a player sees in these states, and its action values."""
    seen = jax.vmap(lambda row: observe(game, as_state(row, jnp.asarray(0)), role, "egocentric"))(rows)
    return seen, jax.vmap(policy.network)(seen)


def choose_alike(pairs, states_each):
    """Who plays any arena sees and does the same in drawn ones, pursuer and evader in turn; returns in how many states
    what it sees is the same."""
    alike = []
    for number, (record, game) in enumerate(pairs):
        role = tuple(Role)[number % 2]
        agent = find_player(ANY[role], role, game)
        states = starts_close_by(game, jax.random.key(number), states_each)
        seen, values = map(np.asarray, valued(agent.policy, jnp.asarray(states), charted(game), role))
        asked = {"path": str(ZOO / f"{ANY[role]}.safetensors"), "game": record, "role": role.name.lower()}
        answer = ask_rules(agent=asked, observations=seen.tolist(), positions=states.tolist())
        is_alike = np.abs(np.asarray(answer["observed"]) - seen).max(axis=1) <= 1e-3
        best, second = np.sort(values, axis=1)[:, :-3:-1].T
        clear = is_alike & (best - second > 1e-3)
        chosen = np.argmax(values, axis=1)[clear]
        gears = np.stack([chosen // 3, chosen % 3], axis=1) - 1
        np.testing.assert_array_equal(np.asarray(answer["gears"])[clear], gears)
        assert np.mean(clear) > 0.8, "hardly a state is a tie"
        alike.append(is_alike)
    return np.mean(alike)


def test_players_of_any_arena_choose_the_same_in_drawn_ones(tmp_path):
    assert choose_alike(drawn_games(2, 5000, tmp_path), 20) >= 0.9


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_players_of_any_arena_choose_the_same_in_ten_thousand_states(tmp_path):
    assert choose_alike(drawn_games(40, 5000, tmp_path), 250) >= 0.99


def assert_said_alike(found, ours):
    """The same sentences; areas may differ by a cell's rounding in their last digit."""
    for theirs, own in ((found["wrong"], ours.wrong), (found["notes"], ours.notes)):
        assert [words(line) for line in theirs] == [words(line) for line in own]
        for line, other in zip(theirs, own, strict=True):
            np.testing.assert_allclose(numbers(line), numbers(other), rtol=0.02, atol=0.02)


def words(line):
    return " ".join(word for word in line.replace(",", "").split() if not word[0].isdigit())


def numbers(line):
    return [float(word.rstrip("%")) for word in line.replace(",", "").replace(":", "").split() if word[0].isdigit()]


WRONG = """{
  "capture_distance": 0.3,
  "arena": {
    "x_max": 8,
    "y_max": 6,
    "discs": [{ "x": 6.9, "y": 5, "radius": 0.5 }, { "x": 7.4, "y": 5, "radius": 0.7 }],
    "polygons": [
      { "vertices": [[2, 0], [2.2, 0], [2.2, 2.6], [2, 2.6]] },
      { "vertices": [[2, 3.4], [2.2, 3.4], [2.2, 6], [2, 6]] },
      { "vertices": [[4, 1], [5, 1], [5, 2], [4, 2]] },
      { "vertices": [[4.5, 1.5], [5.5, 1.5], [5.5, 2.5], [4.5, 2.5]] }
    ]
  },
  "pursuer": { "radius": 0.45 },
  "evader": { "radius": 0.2 }
}"""


def test_the_page_says_what_arena_check_says(tmp_path):
    """A passage too narrow for one robot, a haven, overlaps, a disc beyond a wall, bodies larger than the capture."""
    (tmp_path / "wrong.json").write_text(WRONG)
    game = load_game(tmp_path / "wrong.json")
    (read,) = ask(read=[WRONG])["read"]
    assert read["answer"] == json.loads(json.dumps(to_dict(game)))
    (found,) = ask(surveys=[read["answer"]])["surveys"]
    assert len(found["wrong"]) == 2
    assert len(found["notes"]) == 4
    assert_said_alike(found, survey(game))


@pytest.mark.parametrize(
    "text",
    [
        '{"arena": 3}',
        '{"arena": {"x_max": -1}}',
        '{"arena": {"colour": "red"}}',
        '{"arena": {"discs": [{"x": 1, "y": 2}]}}',
        '{"arena": {"discs": [{"x": 1, "y": 2, "radius": 0}]}}',
        '{"arena": {"discs": [{"x": 11, "y": 2, "radius": 1}]}}',
        '{"arena": {"polygons": [{"vertices": [[1, 1], [2, 2], [2, 1], [1, 2]]}]}}',
        '{"arena": {"polygons": [{"vertices": [[1, 1], [2, 2]]}]}}',
        '{"max_steps": 1.5}',
        '{"dt": true}',
        '{"capture_distance": NaN}',
        '{"capture_distance": 2}',
        '{"pursuer": {"u2_max": 30}}',
        '{"evader": {"v_min": 2}}',
        '{"starts": {"speed": "fast"}}',
        '{"starts": {"clearance": 9}}',
        '{"reward": {"profile": "__proto__"}}',
        '{"__proto__": {}}',
        '{"arena": ',
        "[1]\n",
        '"arena\nof two lines',
    ],
)
def test_what_the_package_refuses_the_page_refuses(text, tmp_path):
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(InvalidInput):
        load_game(tmp_path / "bad.json")
    (read,) = ask(read=[text])["read"]
    assert "\n" not in read["complaint"]
    assert len(read["complaint"]) < 300


def test_games_that_ship_are_read():
    files = sorted((PAGE.parents[1] / "arenas" / "gallery").glob("*.toml"))
    texts = [json.dumps(tomllib.loads(path.read_text())) for path in files]
    for path, read in zip(files, ask(read=texts)["read"], strict=True):
        assert read["answer"] == json.loads(json.dumps(to_dict(find_game(path.stem))))


def test_a_hostile_link_is_refused_in_a_line():
    said = ask(links={"count": 400, "seed": 5})["links"]
    assert {"played", "none"} < {*said}
    assert all(len(line) < 300 and "\n" not in line for line in said)


def test_shapes_stay_shapes():
    moves = ask(moves=1)["moves"]
    assert moves["door"] == [
        [[1, 0.9], [2.4, 0.9], [2.4, 1.1], [1, 1.1]],
        [[3.6, 0.9], [6, 0.9], [6, 1.1], [3.6, 1.1]],
    ]
    assert moves["room"] == 5
    assert moves["nothing"], "a block without a width is no change"
    assert moves["far"] == [[4, 0], [9, 0], [9, 0.2], [4, 0.2]]
    assert moves["small"] == 0
    assert len({x for x, _ in moves["crossed"]}) == 2


@pytest.mark.parametrize("plain", [True, False])
def test_a_ros_map_has_the_same_field(tmp_path, plain):
    shades = np.where(np.random.default_rng(3).random((30, 40)) < 0.1, 0, 254).astype(np.uint8)
    shades[10:14, 5:20] = 205
    if plain:
        rows = "\n".join(" ".join(str(shade) for shade in row) for row in shades)
        (tmp_path / "floor.pgm").write_text(f"P2\n# made by hand\n40 30\n255\n{rows}\n")
    else:
        Image.fromarray(shades).save(tmp_path / "floor.pgm")
    (tmp_path / "floor.yaml").write_text(
        "image: floor.pgm\nresolution: 0.05\norigin: [-1.5, 2.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196 # as usual\n"
    )
    ours = load_map(tmp_path / "floor.yaml")
    theirs = ask(map=[str(tmp_path / "floor.yaml"), str(tmp_path / "floor.pgm")])["map"]
    np.testing.assert_allclose(np.reshape(theirs["field"], ours.field.shape), ours.field, atol=1e-6)
    assert (theirs["x"], theirs["y"], theirs["cell"]) == (ours.x, ours.y, ours.cell)
    assert theirs["digest"] == ours.digest


@pytest.mark.parametrize("named", ["floor.yaml", {"file": "floor.yaml", "sha256": "0"}])
def test_a_game_whose_map_is_not_there_asks_for_it(named):
    (read,) = ask(read=[json.dumps({"arena": {"map": named}})])["read"]
    said = "this game is on the map floor.yaml: drop its .yaml and its image together with it"
    assert read["complaint"] == said


def test_teams_of_a_file_are_chosen_on_the_page():
    (read,) = ask(read=['{"pursuers": 3}'])["read"]
    said = "pursuers = 3 is not possible: it must be left out here: how many robots there are is chosen under Games"
    assert read["complaint"] == said
