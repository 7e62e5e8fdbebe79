"""OpenSpiel's interface: its own tests pass, games go by the rules, and its solver agrees with the package's."""

import jax.numpy as jnp
import numpy as np
import pytest
import tomli_w

from apollonius.arenas.file import find_game
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.play.replay import as_rows, as_state, play_actions
from apollonius.solve.cop_number import solve_chase
from tests.acting import observe

pyspiel = pytest.importorskip("pyspiel", reason="needs OpenSpiel: pip install open_spiel")
games_sim_test = pytest.importorskip("open_spiel.python.tests.games_sim_test")
mcts = pytest.importorskip("open_spiel.python.algorithms.mcts")
observation = pytest.importorskip("open_spiel.python.observation")
pytest.importorskip("apollonius.envs.open_spiel")

DUEL = "apollonius_duel(hold=0.5,time_limit=10.0)"
GRAPH = "apollonius_graph(cells=12,pursuers=2,turns=5)"
GO_ON, STILL = 7, 4
"""Actions: accelerate straight on, and keep speed straight on."""
WON = Outcome.CAPTURED, Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE
"""By the pursuer."""


def apply(state, *moves):
    """The state after moves, of which those of both players at once are pairs."""
    for move in moves:
        state.apply_action(move) if isinstance(move, int) else state.apply_actions(list(move))
    return state


@pytest.mark.parametrize("name", [DUEL, GRAPH, f"turn_based_simultaneous_game(game={DUEL})"])
def test_games_pass_the_tests_of_open_spiel(name):
    """Those of its C++, which compare observations and histories, and those of its Python, which copy and pickle."""
    game = pyspiel.load_game(name)
    pyspiel.random_sim_test(game, num_sims=2, serialize=True, verbose=False)
    np.random.seed(0)  # noqa: NPY002 (OpenSpiel draws from it)
    games_sim_test.GamesSimTest().sim_game(game)


@pytest.mark.parametrize(("seed", "hold"), [(0, 0.5), (3, 1.0), (5, 0.1)])
def test_duel_goes_by_the_rules(seed, hold):
    """The same states as by the game's own loop, hold by hold, to the same end."""
    game = pyspiel.load_game("apollonius_duel", {"seed": seed, "hold": hold})
    rules, state, repeats = find_game("paper"), game.new_initial_state(), round(10 * hold)
    moves = [(GO_ON, 8), (5, GO_ON)] * 100
    start = as_state(jnp.asarray(state.robots), jnp.int32(0))
    actions = np.repeat(np.array(moves, np.int32), repeats, axis=0)
    states, outcomes = play_actions(rules, start, jnp.asarray(actions))
    rows, outcomes = as_rows(states), np.asarray(outcomes)
    end = int(np.argmax(outcomes != Outcome.ONGOING)) + 1
    for number, move in enumerate(moves):
        if state.is_terminal():
            break
        np.testing.assert_allclose(state.robots, rows[number * repeats], atol=1e-5)
        apply(state, move)
    assert (state.steps, state.outcome) == (end, outcomes[end - 1])
    assert state.returns() == ([1, -1] if state.outcome in WON else [-1, 1])


@pytest.mark.parametrize(("name", "value"), [("paper", 0), ("zero-sum", -1)])
def test_time_limit_is_worth_what_the_rules_say(name, value):
    game = pyspiel.load_game("apollonius_duel", {"game": name, "time_limit": 0.7})
    state = apply(game.new_initial_state(), (STILL, STILL))
    assert not state.is_terminal()
    assert state.returns() == [0, 0]
    apply(state, (STILL, STILL))
    assert (state.steps, state.outcome, game.max_game_length()) == (7, Outcome.NO_RESULT, 2)
    assert state.returns() == [value, -value]


def test_seed_draws_the_start():
    starts = [pyspiel.load_game("apollonius_duel", {"seed": seed}).start for seed in (0, 0, 1)]
    assert np.array_equal(starts[0], starts[1])
    assert not np.allclose(starts[0], starts[2])


def test_each_robot_observes_itself_first():
    game = pyspiel.load_game(DUEL)
    state, observer = apply(game.new_initial_state(), (GO_ON, STILL), (8, 6)), observation.make_observation(game)
    truth = as_state(jnp.asarray(state.robots), jnp.int32(state.steps))
    for role in Role:
        observer.set_from(state, int(role))
        expected = observe(find_game("paper"), truth, role, "paper")
        np.testing.assert_allclose(observer.dict["robots"], expected, atol=1e-6)
        assert observer.dict["time"] == pytest.approx(0.1)
        assert observer.tensor.tolist() == state.observation_tensor(int(role))
    history = observation.make_observation(game, observation.INFO_STATE_OBS_TYPE).string_from(state, 0)
    assert history == "7, 4, 8, 6"
    assert state.action_to_string(1, 6) == "evader: accelerate, right"


def test_graph_game_moves_in_turns_to_neighbours_until_one_is_caught_or_time_is_up():
    game = pyspiel.load_game(GRAPH)
    state, observer = game.new_initial_state(), observation.make_observation(game)
    players = []
    for place in (0, 0, 5):
        assert state.legal_actions() == list(range(len(game.around)))
        players.append(state.current_player())
        apply(state, place)
    assert players == [0, 0, 1]
    assert state.legal_actions() == [0, *np.flatnonzero(game.tiling.adjacency[0])]
    near = state.legal_actions()[-1]
    apply(state, 0, near)
    assert (state.places, state.current_player()) == ((0, near, 5), 1)
    observer.set_from(state, 1)
    np.testing.assert_array_equal(observer.dict["places"].argmax(axis=1), state.places)
    assert observer.dict["places"].sum() == 3
    assert observer.dict["mover"].tolist() == [0, 0, 1]
    while not state.is_terminal():
        apply(state, state.places[state.mover])
    assert (state.returns(), state.moves) == ([-1, 1], 3 * 6)
    assert apply(game.new_initial_state(), 0, 3, 3).returns() == [1, -1]


@pytest.mark.parametrize(
    ("cells", "pursuers", "turns", "won", "starts"),
    [pytest.param(4, 1, 5, 85, 225, marks=pytest.mark.slow), (1, 1, 4, 27, 36), (1, 2, 3, 216, 216)],
)
def test_solver_of_open_spiel_agrees_from_every_start(cells, pursuers, turns, won, starts, tmp_path):
    """Around one large disc; and who chooses the places first wins where the number of pursuers is enough."""
    solver = pytest.importorskip("open_spiel.python.algorithms.value_iteration", reason="needs cvxpy")
    ring = tmp_path / "ring.toml"
    ring.write_text(tomli_w.dumps({"arena": {"discs": [{"x": 5.0, "y": 5.0, "radius": 4.0}]}}), encoding="utf-8")
    options = {"game": str(ring), "cells": cells, "pursuers": pursuers, "turns": turns}
    game = pyspiel.load_game("apollonius_graph", options)
    # a state's text has all of it, so that each is solved once
    values = solver.value_iteration(game, depth_limit=-1, threshold=1e-6, cyclic_game=True)
    caught = solve_chase(game.tiling.adjacency, pursuers)
    assert (caught.sum(), caught.size) == (won, starts)
    for evader, *team in np.ndindex(caught.shape):
        state = apply(game.new_initial_state(), *team, evader)
        assert values[str(state)] == (1 if caught[(evader, *team)] else -1)
    assert values[str(game.new_initial_state())] == (1 if won == starts else -1)


def search(game, simulations):
    """OpenSpiel's tree search."""
    random = np.random.RandomState(0)
    return mcts.MCTSBot(game, 1.4, simulations, mcts.RandomRolloutEvaluator(1, random), random_state=random)


def test_tree_search_catches_the_evader_beside_it():
    game = pyspiel.load_game(GRAPH)
    state = apply(game.new_initial_state(), 0, 1, int(np.flatnonzero(game.tiling.adjacency[1])[-1]))
    bot = search(game, 200)
    while not state.is_terminal():
        state.apply_action(bot.step(state))
    assert (state.returns(), state.places[1]) == ([1, -1], state.places[2])
    assert state.moves == 5


def test_tree_search_drives_the_pursuer_into_reach():
    """By an action that does not brake: there is time for one."""
    game = pyspiel.load_game("apollonius_duel", {"hold": 1.0, "time_limit": 1.0})
    game.start = np.float32([1.0, 5.0, 0.3, 0.0, 1.55, 5.0, 0.0, 0.0])
    turns = pyspiel.convert_to_turn_based(game)
    state = turns.new_initial_state()
    state.apply_action(search(turns, 300).step(state))
    assert apply(state, STILL).returns() == [1, -1]
    assert apply(turns.new_initial_state(), 0, STILL).returns() == [0, 0], "braking does not come within reach"


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("duel", {"game": "lidar"}, "game = lidar .* without limited sensors"),
        ("duel", {"game": "chess"}, "unknown game 'chess'"),
        ("duel", {"game": "team-2v1"}, "robots = 2 v 1"),
        ("duel", {"hold": 0.55}, r"hold = 0.55 s .* steps of 0.1 s"),
        ("duel", {"hold": float("nan")}, "hold = nan s"),
        ("duel", {"time_limit": 0.0}, "time_limit = 0 s"),
        ("duel", {"seed": -1}, "seed = -1 .* at least 0"),
        ("graph", {"cells": 0}, "cells = 0 .* at least 1"),
        ("graph", {"pursuers": 17}, "pursuers = 17 .* at most 16"),
        ("graph", {"turns": 0}, "turns = 0 .* at least 1"),
    ],
)
def test_impossible_parameters_are_refused_in_one_line(name, options, said):
    with pytest.raises(InvalidInput, match=said) as refusal:
        pyspiel.load_game(f"apollonius_{name}", options)
    assert "\n" not in str(refusal.value)


def test_observers_have_no_parameters():
    with pytest.raises(InvalidInput, match=r"params = .* left out"):
        observation.make_observation(pyspiel.load_game(GRAPH), params={"size": 3})
