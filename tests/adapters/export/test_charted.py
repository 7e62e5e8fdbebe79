"""Policies that play by a chart do as the package does, on the map they were made for and on another."""

import ctypes
import dataclasses
import subprocess
from functools import cache
from shutil import which

import jax
import jax.numpy as jnp
import numpy as np
import onnxruntime
import pytest
from onnx import helper

from apollonius.adapters.export import c, chart_file, onnx
from apollonius.adapters.export.blueprint import Blueprint, make_blueprint
from apollonius.adapters.export.egocentric import egocentric
from apollonius.adapters.export.features import INPUTS
from apollonius.adapters.export.graph import Graph, matrix
from apollonius.adapters.export.nearby import _seen
from apollonius.adapters.export.parity import compare, largest_difference
from apollonius.agents.store import describe
from apollonius.agents.trained import greedy
from apollonius.arenas.charting import charted
from apollonius.game.arena import Arena, Disc
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.types import Role
from tests.adapters.export.conftest import UNEQUAL, small_actor, small_network, some_states
from tests.adapters.export.test_c import MATHEMATICS
from tests.adapters.export.test_formats import broken

HERE = dataclasses.replace(
    UNEQUAL,
    arena=Arena(
        -4.0, 8.0, 1.0, 6.0, (Disc(0.0, 3.0, 0.4),), (Polygon(((4.0, 2.5), (5.0, 2.5), (5.0, 5.0), (4.0, 4.5))),)
    ),
    capture_distance=0.5,
)
"""Wider than high, and not where the axes begin, with robots that differ in everything."""
THERE = dataclasses.replace(HERE, arena=Arena(0.0, 7.0, -3.0, 6.0, (Disc(3.0, 2.0, 1.0), Disc(5.0, 4.0, 0.7))))
"""Another map for the same robots."""
ROLES_ = [Role.PURSUER, Role.EVADER]


def states_in(game: Game) -> np.ndarray:
    """In and around the walls, and on edges: of cells, of the walls, in the middle between stops, at the same place."""
    states, arena = some_states(game, 400), game.arena
    side = max(arena.x_max - arena.x_min, arena.y_max - arena.y_min)
    for row in range(40):
        cell = side * (5 * row + row % 5) / 192
        states[row, [0, 4]] = arena.x_min + cell, arena.x_min + side * (row + 0.5) / 40
        states[row, [1, 5]] = arena.y_min + cell / 2, arena.y_min + side * row / 40
    states[40:44, 0], states[44:48, 5] = arena.x_min, arena.y_max
    states[48:50, 4:6] = states[48:50, :2]
    return states


@dataclasses.dataclass(frozen=True)
class Played:
    """A policy made for a game, and what the package's player sees and does in states of another."""

    blueprint: Blueprint
    elsewhere: Blueprint
    states: np.ndarray
    seen: np.ndarray
    actions: np.ndarray


@cache
def played(role: Role, continuous: bool, game: Game = HERE) -> Played:
    network = (small_actor if continuous else small_network)("egocentric")
    blueprint, elsewhere = (make_blueprint("small", describe(network, role, {}, {}), made) for made in (HERE, game))
    states = states_in(game)
    seen = _seen(charted(game), jnp.asarray(states), role, "egocentric")
    actions = jax.vmap(greedy(network), in_axes=(0, None))(seen, jnp.uint32(0))
    return Played(blueprint, elsewhere, states, np.asarray(seen), np.asarray(actions))


def chart_of(blueprint, folder, suffix=chart_file.SUFFIX):
    (folder / f"there{suffix}").write_bytes(chart_file.chart_bytes(blueprint.chart, suffix))
    return folder / f"there{suffix}"


def source(blueprint, folder, name="small"):
    """The C source, and the header and the chart beside it."""
    for path, content in c.make_files(blueprint, folder / f"{name}.c").items():
        path.write_bytes(content)
    return folder / f"{name}.c"


def in_onnx(case, folder):
    graph = Graph(columns={"state": INPUTS})
    features, rows = egocentric(graph, case.blueprint)
    factors, constants = matrix(graph.columns[features], rows)
    output = helper.make_tensor_value_info(features, 1, ["batch", len(factors[0])])
    session = onnx._session(onnx._model(graph, "state", len(INPUTS), [output]).SerializeToString())
    (numbers,) = session.run(None, {"state": case.states, **np.load(chart_of(case.elsewhere, folder))})
    return numbers @ factors.T + constants


SEE = """
void see(const float *s, const apollonius_chart *chart, float *seen)
{
    const robot own = {s[0], s[1], s[2], s[3]}, opponent = {s[4], s[5], s[6], s[7]};
    observe(own, opponent, chart, seen);
}
"""


def in_c(case, folder):
    file = source(case.blueprint, folder)
    file.write_text(file.read_text() + SEE)
    library = folder / "small.so"
    subprocess.run(["gcc", *c.FLAGS, "-shared", "-fPIC", str(file), "-lm", "-o", str(library)], check=True)
    see, numbers = ctypes.CDLL(str(library)).see, np.zeros((len(case.states), 92), np.float32)
    chart = ctypes.create_string_buffer(chart_of(case.elsewhere, folder, chart_file.RAW).read_bytes())
    for state, row in zip(case.states, numbers, strict=True):
        see(ctypes.c_void_p(state.ctypes.data), chart, ctypes.c_void_p(row.ctypes.data))
    return numbers


needs_gcc = pytest.mark.skipif(which("gcc") is None, reason="needs gcc")


@pytest.mark.parametrize("elsewhere", [in_onnx, pytest.param(in_c, marks=needs_gcc)])
@pytest.mark.parametrize("role", ROLES_)
@pytest.mark.parametrize("game", [HERE, THERE], ids=["here", "there"])
def test_the_observation_is_the_packages(elsewhere, role, game, tmp_path):
    case = played(role, False, game)
    seen = np.asarray(elsewhere(case, tmp_path))
    assert seen.shape == (400, 92)
    assert case.seen.std(axis=0)[23:].min() > 0.01, "rays and ways are of all kinds"
    assert 0.05 < case.seen[:, 55].mean() < 0.95, "some opponents are seen and some are not"
    away = np.abs(seen - case.seen).max(axis=1)
    assert np.median(away) < 5e-6
    assert (away > 1e-4).mean() < 0.02, "where it jumps"


def decide_in_onnx(case, folder):
    model = onnx._session(onnx.make_model(case.blueprint).SerializeToString())
    chart = dict(np.load(chart_of(case.elsewhere, folder)))
    return lambda state: [number for out in model.run(None, {"state": state[None], **chart}) for number in out.ravel()]


def decide_in_c(case, folder):
    file = source(case.blueprint, folder)
    chart_of(case.elsewhere, folder, chart_file.RAW).replace(file.with_suffix(chart_file.RAW))
    return c.load(file)


each = pytest.mark.parametrize("elsewhere", [decide_in_onnx, pytest.param(decide_in_c, marks=needs_gcc)])


@each
@pytest.mark.parametrize(("role", "game"), [(Role.PURSUER, HERE), (Role.EVADER, THERE)], ids=["here", "there"])
def test_it_decides_as_the_player_and_brakes_in_a_broken_state(elsewhere, role, game, tmp_path):
    case = played(role, False, game)
    decide = elsewhere(case, tmp_path)
    assert len(set(case.actions.tolist())) > 3
    parity = compare(decide, case.elsewhere, case.states, case.seen, case.actions)
    assert (parity.states, parity.errors) == (400, 0)
    assert parity.ties + parity.jumps < 8
    brake = [1, pytest.approx(-case.blueprint.own.u1_max), 0.0]
    assert all([*decide(state)] == brake for state in broken(case.states))
    for far in ([9e5, -3e5, 0, 9e4, -9e4, 2e5, 1, -3e4], [1, 2, 5e5, 3, 3, 3, 6e5, 1]):
        action, *_ = decide(np.float32(far))
        assert action in range(9), "far beyond the chart"


@each
def test_a_continuous_one_steers_as_the_player(elsewhere, tmp_path):
    case = played(Role.PURSUER, True, THERE)
    assert case.actions.std(axis=0).min() > 0.1
    assert largest_difference(elsewhere(case, tmp_path), case.elsewhere, case.states, case.actions) < 1e-4


def test_another_action_is_an_error_unless_the_player_takes_it_next_to_the_state():
    case = played(Role.PURSUER, False, HERE)
    right = [(action, *case.blueprint.controls[action].tolist()) for action in case.actions.tolist()]
    other = (case.actions[60] + 1) % 9
    said = iter([*right[:60], (other, *case.blueprint.controls[other].tolist()), *right[61:]])
    parity = compare(lambda state: next(said), case.blueprint, case.states, case.seen, case.actions)
    assert (parity.ties, parity.jumps, parity.errors) == (0, 0, 1)
    # As if the player had been seen to take another action there than it takes all around.
    claimed = case.actions.copy()
    claimed[60] = other
    said = iter(right)
    parity = compare(lambda state: next(said), case.blueprint, case.states, case.seen, claimed)
    assert (parity.ties, parity.jumps, parity.errors) == (0, 1, 0)


def test_a_model_that_is_given_no_chart_has_its_own_for_a_batch_of_any_size(tmp_path):
    case = played(Role.EVADER, False, HERE)
    session = onnxruntime.InferenceSession(onnx.make_model(case.blueprint).SerializeToString())
    action, controls = session.run(None, {"state": case.states})
    assert (action != case.actions).sum() < 8
    np.testing.assert_array_equal(controls, case.blueprint.controls[action])
    given = {name: np.asarray(array) for name, array in case.blueprint.chart.items()}
    np.testing.assert_array_equal(session.run(None, {"state": case.states, **given})[0], action)
    assert [part.shape for part in session.run(None, {"state": case.states[:0]})] == [(0,), (0, 2)]


def test_a_file_written_again_is_the_same(tmp_path):
    blueprint = played(Role.PURSUER, False).blueprint
    for format_ in (onnx, c):
        out = tmp_path / f"small{format_.SUFFIX}"
        assert format_.make_files(blueprint, out) == format_.make_files(blueprint, out)


PROGRAM = """
#include "one.h"
#include "two.h"

#include <stdio.h>

int main(int count, char **files)
{
    static apollonius_chart chart;
    FILE *file = fopen(files[count - 1], "rb");
    if (!file || fread(&chart, sizeof chart, 1, file) != 1)
        return 1;
    fclose(file);
    for (int i = -30; i < 50; i++) {
        const float state[8] = {0.3f * (float)i, 2, 0.5f, 3, 7, 0.2f * (float)i, 0, (float)i};
        float one[2], two[2];
        if (one_decide(state, &chart, one) != two_decide(state, &chart, two))
            return 1;
    }
    return 0;
}
"""


@needs_gcc
def test_two_policies_in_one_program_read_one_chart_without_a_fault(tmp_path):
    blueprint = played(Role.PURSUER, False).blueprint
    for name in ("one", "two"):
        source(blueprint, tmp_path, name)
    (tmp_path / "main.c").write_text(PROGRAM)
    subprocess.run(["gcc", *c.FLAGS, "-g", "main.c", "one.c", "two.c", "-lm", "-o", "main"], cwd=tmp_path, check=True)
    under = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full"] if which("valgrind") else []
    subprocess.run([*under, "./main", "one.chart"], cwd=tmp_path, check=True)


@needs_gcc
def test_the_c_source_calls_nothing_but_mathematics(tmp_path):
    source(played(Role.EVADER, False).blueprint, tmp_path)
    subprocess.run(["gcc", *c.FLAGS, "-Wunused-macros", "-c", "small.c"], cwd=tmp_path, check=True)
    listed = subprocess.run(["nm", "small.o"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    symbols = [line.split() for line in listed.splitlines()]
    assert {symbol[-1] for symbol in symbols if symbol[-2] == "U"} <= MATHEMATICS | {"expf", "log1pf", "floorf"}
    assert {symbol[-1] for symbol in symbols if symbol[-2] == "T"} == {"small_decide"}
    assert not [symbol for symbol in symbols if symbol[-2] in "BbDd"], "nothing can be written to"
