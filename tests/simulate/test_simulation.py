"""Games with bodies: moved by the physics, judged by the rules."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still, Uniform
from apollonius.agents.policy import AbstractContinuous
from apollonius.agents.pool import solo
from apollonius.arenas.file import find_game
from apollonius.evaluate.match import Match, begin, play_games
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.game.sensing import Drive as Slow
from apollonius.game.sensing import Drives, Sensing, Sensors
from apollonius.game.types import Outcome, RobotStatus
from apollonius.observe.paper import PAPER
from apollonius.play.replay import as_state, load_replay, save_replay
from apollonius.simulate.drive import Drive
from apollonius.simulate.physics import rectangles
from apollonius.simulate.simulation import compare, record_course, simulate, simulate_match
from tests.acting import a_match
from tests.simulate.test_physics import IDEAL

pytest.importorskip("mujoco")
GAME = replace(make_game("paper"), max_steps=40)
PLAYERS = BySide(solo(Uniform()), solo(Uniform()))
GAMES = 6
MATCH = a_match(GAME, Uniform(), Uniform(), GAMES)


@pytest.fixture(scope="module")
def simulated():
    starts, key = begin(MATCH)
    return simulate(GAME, PLAYERS, starts, key, Drive())


@pytest.fixture(scope="module")
def ideal():
    starts, key = begin(MATCH)
    return simulate(GAME, PLAYERS, starts, key, IDEAL)


def test_every_step_of_every_game_is_there(simulated):
    lengths = np.asarray(simulated.results.steps)
    assert np.array_equal(np.bincount(simulated.index), lengths)
    for game in range(GAMES):
        states, actions = simulated.course(game)
        assert len(states) == len(actions) + 1 == lengths[game] + 1
        assert np.array_equal(states[1:], simulated.after[simulated.index == game])
    assert np.all(np.asarray(simulated.results.outcome) != Outcome.ONGOING)


@jax.jit
@jax.vmap
def by_the_rules(row, actions):
    after = GAME.step(as_state(row, jnp.asarray(0)), actions[0], actions[1]).state
    return jnp.stack(jax.tree.leaves(after.robots), axis=-1)


def test_a_robot_without_its_imperfections_moves_as_the_rules_say(ideal, simulated):
    near, far = (
        np.sqrt(
            np.mean(((run.after - by_the_rules(run.states, run.actions) + np.pi) % (2 * np.pi) - np.pi) ** 2, axis=0)
        )
        for run in (ideal, simulated)
    )
    assert (near[[0, 1, 2]] < [0.001, 0.001, 0.004]).all()
    assert near[3] < 0.02
    assert far[3] > 2 * near[3]


def begun(*row):
    return jax.tree.map(lambda leaf: leaf[None], as_state(jnp.asarray(row, jnp.float32), jnp.asarray(0)))


def test_who_drives_into_a_wall_has_failed_and_a_replay_shows_it(tmp_path):
    start = begun(5.0, 1.0, 0.0, 0.0, 9.8, 5.0, 1.0, 0.0)
    game = simulate(GAME, BySide(solo(Still()), solo(Still())), start, jax.random.key(0), Drive())
    assert int(game.results.outcome[0]) == Outcome.EVADER_OUT_OF_RANGE
    assert int(game.results.steps[0]) == 3
    save_replay(record_course(game, a_match(GAME, Still(), Still(), 1), 0), tmp_path / "game.json")
    replay = load_replay(tmp_path / "game.json")
    assert replay.outcome == Outcome.EVADER_OUT_OF_RANGE
    assert replay.states[-1, 4] > 10
    assert replay.first_difference() == 1


class FullSpeedInACurve(AbstractContinuous):
    """Speeds up and turns left at half the largest rate."""

    observation = PAPER

    def __call__(self, observation, memory, bits):
        return jnp.asarray([1.0, 0.5]), memory


def test_players_with_continuous_actions_drive_too(tmp_path):
    start, key = begun(9.0, 9.0, 0.0, 0.0, 1.5, 5.0, 0.0, 0.0), jax.random.key(0)
    game = simulate(GAME, BySide(solo(Still()), solo(FullSpeedInACurve())), start, key, IDEAL)
    states, actions = game.course(0)
    assert actions.shape == (40, 2, 2)
    assert np.all(actions[:, 1] == [1.0, 0.5])
    turned = np.unwrap(states[:, 7])
    assert turned[-1] - turned[0] == pytest.approx(0.4 * 4.0, rel=0.02)
    assert states[-1, 6] == pytest.approx(1.2, rel=0.01)
    save_replay(record_course(game, a_match(GAME, Still(), FullSpeedInACurve(), 1), 0), tmp_path / "game.json")
    assert load_replay(tmp_path / "game.json").actions.dtype == np.float32


def test_both_plays_are_counted_and_compared(simulated):
    found = compare(MATCH, play_games(MATCH), simulated)
    assert found.rules.games == found.bodies.games == GAMES
    timeouts = np.asarray(simulated.results.outcome) == Outcome.NO_RESULT
    rate = found.differences["no result"]
    assert rate.bodies == timeouts.mean()
    assert rate.difference == pytest.approx(rate.bodies - rate.rules)
    assert rate.interval[0] <= rate.difference <= rate.interval[1]


def played(game, count=4):
    match = Match.of_names(game, "intercept", "flee-aware", count)
    return match, simulate_match(match, Drive())


def test_teams_play_on_without_those_that_are_out_and_their_replays_say_who():
    match, found = played(replace(find_game("team-2v1"), max_steps=150))
    assert found.states.shape[1] == 12
    assert found.actions.shape[1] == 3
    for index in range(4):
        replay = record_course(found, match, index)
        in_play = replay.in_play()
        status = [np.asarray(one)[index] for side in found.results.status for one in side]
        assert in_play[-1].tolist() == [one == RobotStatus.ACTIVE for one in status]
        for robot in range(3):
            out, v = np.flatnonzero(~in_play[:, robot]), replay.states[:, 4 * robot + 2]
            if len(out) > 45:
                assert abs(v[-1]) < max(0.05, abs(v[out[0]]) / 4)


def test_bodies_stop_at_the_cells_of_a_map():
    cells = np.zeros((6, 9), bool)
    cells[1:4, 2:5], cells[3, 7] = True, True
    covered = np.zeros(cells.shape, int)
    blocks = list(rectangles(cells))
    for row, column, rows, columns in blocks:
        covered[row : row + rows, column : column + columns] += 1
    assert np.array_equal(covered, cells)
    assert len(blocks) == 2


def test_sensors_and_drives_of_the_game_count_for_bodies_too():
    game = replace(GAME, max_steps=20)
    slow = replace(game, drives=Drives(Slow(lag=5.0, turn_time=2.0), None))
    start, key = begun(2.0, 2.0, 0.0, 0.0, 8.0, 8.0, 0.0, 0.0), jax.random.key(0)
    players = BySide(solo(FullSpeedInACurve()), solo(Still()))
    quick, late = (simulate(one, players, start, key, IDEAL).course(0)[0] for one in (game, slow))
    assert late[5, 2] == pytest.approx(0, abs=0.005)
    assert quick[5, 2] == pytest.approx(0.15, abs=0.01)
    assert late[-1, 2] == pytest.approx(quick[-6, 2], abs=0.01)
    turned = np.diff(late[:, 3])
    assert turned[6] == pytest.approx(0.4 * 0.1 * 0.1 * 1.5, rel=0.2)  # 0.4 rad/s^2 in its second step
    blind = replace(game, sensors=Sensing(Sensors(range=0.0), None))
    seen = simulate(blind, BySide(solo(Uniform()), solo(Still())), start, key, IDEAL).results.sightings
    assert int(seen.pursuer.first[0]) == -1
    assert seen.evader is None
