"""Distillation: queries, the teacher's values, and a student that learns them and is resumed."""

import functools
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.agents.pool import single_player
from apollonius.agents.store import load_agent
from apollonius.agents.trained import Greedy
from apollonius.game.arena import Arena
from apollonius.game.presets import in_arenas, make_game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.types import NUM_ACTIONS, BySide, Role
from apollonius.io.errors import InvalidInput
from apollonius.learn import distillation
from apollonius.learn.config import RunConfig
from apollonius.learn.distillation import DistillationConfig, Labels, distillation_tasks
from apollonius.learn.dqn import DQNConfig
from apollonius.learn.run import TrainingRun
from apollonius.learn.states_to_label import fresh_starts, starts_of, states_near, states_to_label
from apollonius.learn.teacher import COSTLIEST, DEEPEST, STEEPNESS, Clearance, DistillationTask
from apollonius.play.rollout import collect
from apollonius.play.rollout import init_games as begin_games
from apollonius.solve.grid import Solved
from apollonius.solve.motion import motion_of
from apollonius.solve.solving import reference_grid
from tests.acting import identical, of_views
from tests.learn.test_run import agents, assert_same_end, begin, metrics, stop_after
from tests.solve.small import FEW, SMALL

GAME = replace(SMALL, max_steps=60)
STAGE = DistillationConfig(
    env_steps=40_960, evaluations=2, evaluation_games=32, opponents=("table", "random"), near_sighted=16,
    far_sighted=4, grid=FEW, updates=4,
)  # fmt: skip
FITTING = DQNConfig(
    width=32, depth=1, learning_rate=3e-3, final_learning_rate=1e-3, averaging=0.1, batch=64, games=128,
    env_steps_per_update=640, replay_capacity=20_000,
)  # fmt: skip
RUN = RunConfig(game=GAME, algorithm=FITTING, stages=(STAGE,))
SEEING = replace(
    STAGE, role="pursuer", teacher="P_curriculum", opponents=("still", "flee"), near_sighted=0, far_sighted=0,
    clearance=0.0, informed=0.35, evaluations=1,
)  # fmt: skip


@pytest.fixture(scope="module")
def visited_states():
    return jax.jit(fresh_starts, static_argnames="games")(GAME, games=400, key=jax.random.key(0))


def test_opponents_of_unequal_shares_play_all_games(monkeypatch):
    """109 for two, and those of both attackers; games of training have their own time limit."""
    for part in ("joint", "safety"):  # the tables' values do not matter here
        monkeypatch.setattr(
            f"apollonius.solve.{part}.iterate_values", lambda sweep, table, *rest: Solved(table, 1, 0.0)
        )
    stage = replace(STAGE, time_limit=20).make(FITTING, GAME)
    (task,) = stage.tasks
    assert (task.game.max_steps, stage.evaluation_game.max_steps) == (20, GAME.max_steps)
    assert stage.evaluation_game.reward == GAME.reward
    config = replace(STAGE, near_sighted=15)
    network = make_network("encoded", 32, 1, jax.random.key(0))
    players = distillation._players(config, FITTING, network, task, jax.random.key(1))
    assert players[config.side.other].games == (55, 54, 15, 4)


def test_states_near_are_visited_perturbed_close_and_random_ones(visited_states):
    assert np.sum(np.asarray(visited_states.evader.v) == 0) == 200, "every other start is the game's own"
    asked, visited_states = jax.tree.map(
        np.asarray, (jax.jit(states_near)(GAME, visited_states, jax.random.key(1)), visited_states)
    )
    same, around, close, anywhere = np.split(np.arange(len(asked.steps)), [400, 800, 900])
    assert len(anywhere) == 100
    for before, after in zip(jax.tree.leaves(visited_states), jax.tree.leaves(asked), strict=True):
        np.testing.assert_array_equal(before, after[same])
    moved = np.hypot(asked.evader.x[around] - visited_states.evader.x, asked.evader.y[around] - visited_states.evader.y)
    assert 0.1 < np.median(moved) < 0.5
    for robot in (asked.pursuer, asked.evader):
        assert np.all((robot.x > -1) & (robot.x < 2) & (robot.y > 0) & (robot.y < 4))
        assert np.all((robot.v >= 0) & (robot.v <= 0.6) & (np.abs(robot.heading) <= np.pi + 1e-6))
    for block in (close, anywhere):
        assert np.ptp(asked.pursuer.v[block]) > 0.4, "they move"
    beside = np.array([asked.pursuer.x - asked.evader.x, asked.pursuer.y - asked.evader.y])
    assert np.all(np.abs(np.sign(beside[:, close]).mean(axis=1)) < 0.5), "on all sides"
    apart = np.hypot(*beside)
    assert np.median(apart[close]) < np.median(apart[anywhere])


@pytest.fixture(scope="module")
def student():
    return Greedy(make_network("paper", 4, 1, jax.random.key(3)))


def values_of(lessons, states):
    """What a teacher says of an evader's actions."""
    return eqx.filter_jit(lessons.values)(states, Role.EVADER)


def test_teacher_values_are_those_of_its_player_clipped_below(student, visited_states):
    blank, says = jax.tree.map(np.zeros_like, student), jnp.array([5, 4, 3, 2, 1, 0, -1, -10, 4.5])
    player = eqx.tree_at(lambda one: one.network.layers[-1].bias, blank, says)
    values = values_of(DistillationTask(GAME, (), player, 10.0, None, None), visited_states)
    expected = 5 - np.minimum(np.array([0, 1, 2, 3, 4, 5, 6, 15, 0.5]), 10 * DEEPEST)
    np.testing.assert_allclose(values, np.tile(expected, (400, 1)), atol=1e-6)


LEFT = np.linspace(0.005, 0.025, NUM_ACTIONS)


def test_teacher_preferences_scale_with_the_remaining_clearance(visited_states, monkeypatch):
    """A quarter of the wanted room is left at best, so that a quarter of each difference remains."""
    monkeypatch.setattr(Clearance, "after", lambda *_: jnp.float32(LEFT))
    grid, _ = reference_grid(GAME, Role.EVADER)
    room = Clearance(motion_of(GAME, Role.EVADER, 2), grid, jnp.zeros(grid.shape), 0.1)
    behind = -np.arange(9, dtype=np.float32) / 10
    cost = np.minimum(STEEPNESS * (0.025 - LEFT), COSTLIEST)
    np.testing.assert_allclose(
        eqx.filter_jit(room.weigh_against)(behind, visited_states.evader), behind / 4 - cost, atol=1e-6
    )


def test_clearance_margin_needs_an_observation_with_braking_clearance():
    blind, careful = replace(FITTING, observation="encoded"), replace(SEEING, clearance_margin=0.05)
    with pytest.raises(InvalidInput, match=r"observation = encoded is not possible.*egocentric or team"):
        replace(RUN, algorithm=blind, stages=(careful,))


@pytest.mark.slow
def test_clearance_margin_is_in_the_header_and_not_in_the_weights(tmp_path):
    fitting = replace(FITTING, observation="egocentric", games=32, env_steps_per_update=32)
    short = replace(SEEING, env_steps=8192, evaluation_games=8)
    daring = replace(RUN, algorithm=fitting, stages=(short,))
    careful = replace(daring, stages=(replace(short, clearance_margin=0.06),))
    folders = begin(tmp_path / "daring", daring), begin(tmp_path / "careful", careful)
    assert all(TrainingRun(config, folder).execute() for config, folder in zip((daring, careful), folders, strict=True))
    plain, wary = (load_agent(folder / "agents" / "P_distilled.safetensors") for folder in folders)
    assert (plain.header.clearance_margin, wary.header.clearance_margin) == (0.0, 0.06)
    assert plain.header.loss_value == wary.header.loss_value == 10.0, "the reward of a failure, by which it is taught"
    assert identical(plain.network, wary.network)


@pytest.fixture(scope="module")
def setting():
    return distillation_tasks(STAGE, GAME, None)[0]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    folder = begin(tmp_path_factory.mktemp("run") / "uninterrupted", RUN)
    assert TrainingRun(RUN, folder).execute()
    return folder


@pytest.mark.slow
def test_each_of_several_arenas_has_its_own_teacher(setting, visited_states, monkeypatch):
    """All have one shape, so that compiled steps serve all; what is taught is the arena's own."""
    arenas = [GAME.arena, Arena(x_min=-1.0, x_max=2.0, y_max=4.0)]
    monkeypatch.setattr(
        "apollonius.learn.distillation.single_arena_games", lambda game: [replace(GAME, arena=one) for one in arenas]
    )
    settings = distillation_tasks(STAGE, in_arenas(GAME, arenas), None)
    assert len(settings) == 2
    assert len({jax.tree.structure(one) for one in settings}) == 1
    assert len({tuple(map(np.shape, jax.tree.leaves(one))) for one in settings}) == 1
    here, there = (values_of(one, visited_states) for one in settings)
    alone = values_of(setting, visited_states)
    np.testing.assert_allclose(here, alone, atol=1e-4)
    assert np.abs(there - here).max() > 0.01


@pytest.mark.slow
def test_distillation_run_learns_the_values_of_the_table(uninterrupted, setting, visited_states):
    assert list(agents(uninterrupted)) == ["E_distilled"]
    assert len(list((uninterrupted / "tables").iterdir())) == 2
    agent = load_agent(uninterrupted / "agents" / "E_distilled.safetensors")
    assert agent.header.role == "evader"
    assert agent.header.training["config"]["stages"][0]["teacher"] == "table"
    assert agent.header.loss_value == 1.0
    losses = [line["losses"]["evader"] for line in metrics(uninterrupted)]
    assert losses[-1] < losses[0] / 2
    asked = jax.jit(states_near)(GAME, visited_states, jax.random.key(5))
    values = np.asarray(values_of(setting, asked))

    def lost(network):
        """What the best action by a network costs by what the teacher says."""
        chosen = np.argmax(network.batch(of_views(network.observation, GAME, asked, Role.EVADER)), axis=1)
        return np.mean(values.max(axis=1) - values[np.arange(len(values)), chosen])

    assert lost(agent.network) < 0.6 * lost(make_network("encoded", 32, 1, jax.random.key(0)))


SHORT_SIGHTED = replace(GAME, sensors=Sensing(pursuer=Sensors(range=1.5)))


def learning(game, student):
    """The setting of a student with that game, and a function from starts that says what it is asked after a time."""
    (setting,) = distillation_tasks(SEEING, game, None)
    players = BySide(single_player(student), single_player(setting.opponents[1]))

    @functools.partial(jax.jit, static_argnames="steps")
    def asked(starts, steps):
        games = begin_games(game, starts, players, jnp.zeros((2, len(starts.steps)), jnp.uint32))
        key, again = jax.random.key(1), jax.tree.map(lambda leaf: leaf[None], starts)
        games, _ = collect(game, players, games, again, key, steps) if steps else (games, None)
        known, states, learns = states_to_label(Role.PURSUER, SEEING.informed, setting, games, key)
        return games, known, states, learns, setting.values(states, Role.PURSUER)

    return setting, asked


def test_student_with_sensors_learns_in_states_with_a_recent_sighting(student):
    setting, asked = learning(SHORT_SIGHTED, student)
    assert setting.table is None
    games, known, states, learns, _ = asked(jax.jit(starts_of, static_argnums=1)(setting, 64, jax.random.key(0)), 12)
    assert np.all(np.asarray(games.state.pursuer.x) == states.pursuer.x)
    (age,), sight = known.ages, np.hypot(states.pursuer.x - states.evader.x, states.pursuer.y - states.evader.y)
    np.testing.assert_array_equal(np.asarray(age) == 0, sight <= 1.5)
    np.testing.assert_array_equal(learns, np.asarray(age) < 0.35)
    hidden = np.asarray((age > 0) & (age < 0.35))
    assert hidden.any()
    assert np.all(np.asarray(known.robots.evader[0].x != states.evader.x)[hidden]), "the teacher sees where it went"


def test_only_active_robots_of_a_team_learn(student):
    setting, asked = learning(make_game("team-2v1"), student)
    starts = jax.jit(starts_of, static_argnums=1)(setting, 16, jax.random.key(0))
    *_, learns, values = asked(eqx.tree_at(lambda one: one.status.pursuer[1], starts, jnp.int32(np.arange(16) == 3)), 0)
    np.testing.assert_array_equal(np.flatnonzero(~np.asarray(learns)), [16 + 3])
    assert values.shape == (32, 9)


def test_distillation_error_ignores_rows_without_teacher_values(student):
    rows, values = jax.random.normal(jax.random.key(1), (8, 8)), jax.random.normal(jax.random.key(2), (8, 9))
    half = values.at[::2].set(jnp.nan)
    slope = jax.jit(jax.grad(distillation._error))
    some = slope(student.network, Labels(rows, half))
    all_known = slope(student.network, Labels(rows[1::2], values[1::2]))
    for one, other in zip(jax.tree.leaves(some), jax.tree.leaves(all_known), strict=True):
        np.testing.assert_allclose(one, other / 2, atol=1e-6)


@pytest.mark.slow
def test_distillation_with_sensors_lowers_the_loss(tmp_path):
    longer = replace(SEEING, updates=24, env_steps=163_840)
    wider = replace(FITTING, width=64, depth=2)
    run = replace(RUN, game=SHORT_SIGHTED, algorithm=wider, stages=(longer,))
    folder = begin(tmp_path / "run", run)
    assert TrainingRun(run, folder).execute()
    losses = [line["losses"]["pursuer"] for line in metrics(folder)]
    assert losses[-1] < 0.8 * max(losses)
    assert not (folder / "tables").exists()


@pytest.mark.slow
def test_stopped_distillation_resumes_to_the_same_end(uninterrupted, tmp_path):
    folder = begin(tmp_path / "run", RUN)
    assert not TrainingRun(RUN, folder, should_stop=stop_after(3)).execute()
    assert agents(folder) == {}
    assert TrainingRun(RUN, folder).execute()
    assert_same_end(folder, uninterrupted)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"teacher": "P_smooth"}, "one that values the nine actions"),
        ({"opponents": ("nobody",)}, "agent 'nobody'"),
    ],
)
def test_unsuitable_teachers_and_opponents_are_refused(change, message):
    with pytest.raises(InvalidInput, match=message):
        distillation_tasks(replace(SEEING, **change), SHORT_SIGHTED, None)
