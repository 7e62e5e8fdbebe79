"""Outside agents: their networks as the package's, their opponents, and the ladder's counts."""

import ast
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius import BySide, MatchResult, Role, find_player, load_agent, look, reset_batch, save_agent
from apollonius.evaluate.tournament import Tournament
from benchmarks.entrants import game, ladder, train
from tests.documents import REPOSITORY

SIZES = (17, 5, 4, 9)


@pytest.fixture
def layers():
    draw = np.random.default_rng(0)
    return [(draw.normal(size=(outputs, inputs)), draw.normal(size=outputs)) for inputs, outputs in pairwise(SIZES)]


def test_network_has_the_outputs_of_the_weights(layers):
    observations = np.random.default_rng(1).normal(size=(20, 17)).astype(np.float32)
    hidden = observations
    for weight, bias in layers[:-1]:
        hidden = np.maximum(hidden @ weight.T + bias, 0)
    weight, bias = layers[-1]
    np.testing.assert_allclose(
        game.network_of(layers).batch(jnp.asarray(observations)), hidden @ weight.T + bias, rtol=1e-4, atol=1e-4
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda layers: layers[:-1],
        lambda layers: layers[::-1],
        lambda layers: [(weight.T, bias) for weight, bias in layers],
    ],
)
def test_weights_that_make_no_action_are_refused(layers, change):
    with pytest.raises(ValueError, match="make no action"):
        game.network_of(change(layers))


def test_saved_entrant_plays_the_largest_output(layers, tmp_path):
    path = tmp_path / train.file_of("some-ppo", Role.EVADER, 2)
    save_agent(
        game.agent_of(
            [*layers[:1], (np.ones((5, 5)), np.zeros(5)), (np.eye(9, 5), np.arange(9.0))], Role.EVADER, {"seed": 2}
        ),
        path,
    )
    assert load_agent(path).header.training == {"seed": 2}
    policy = find_player(str(path), Role.EVADER, game.GAME).policy
    state = game.GAME.reset(jax.random.key(0))
    observation = game.OBSERVATION(look(game.GAME, state, Role.EVADER))
    action, _ = policy(observation, policy.memory, jnp.uint32(0))
    assert action == np.argmax(policy.network(observation))
    assert ladder.learner_of(path.stem) == "some-ppo"


@pytest.mark.parametrize("role", Role)
def test_opponent_is_either_player_for_a_whole_game(role):
    opponent = game.opponent_of(role)
    players = [find_player(name, role.other, game.GAME).policy for name in game.OPPONENTS[role]]
    states = reset_batch(game.GAME, jax.random.key(0), 40)
    views = jax.vmap(lambda state: look(game.GAME, state, role.other))(states)

    def actions(player):
        return np.asarray(
            jax.vmap(lambda view: player(player.observation(view), player.memory, jnp.uint32(0))[0])(views)
        )

    either = [actions(player) for player in players]
    assert (either[0] != either[1]).any()
    for bits in (0, 1 << 16):
        acted, memory = jax.vmap(lambda view: opponent(view, opponent.memory, jnp.uint32(bits)))(views)  # noqa: B023
        again, _ = jax.vmap(lambda view, memory: opponent(view, memory, jnp.uint32(1 << 16 ^ bits)))(views, memory)  # noqa: B023
        np.testing.assert_array_equal(acted, either[bits >> 16])
        np.testing.assert_array_equal(again, acted)


def result(captured, evader_fails, pursuer_fails, out_of_time):
    return MatchResult(
        {
            "captured": captured,
            "evader_hit_obstacle": evader_fails,
            "evader_out_of_range": 0,
            "pursuer_hit_obstacle": 0,
            "pursuer_out_of_range": pursuer_fails,
            "both_failed": 0,
            "no_result": out_of_time,
            "territory_reached": 0,
        },
        10.0,
        None,
    )


@pytest.fixture
def tournament():
    """Two trainings of a learner and a rule, against one evader's two trainings and a rule."""
    rows = (
        (result(6, 2, 1, 1), result(4, 2, 3, 1), result(1, 0, 9, 0)),
        (result(2, 0, 8, 0), result(2, 2, 2, 4), result(5, 0, 2, 3)),
        (result(10, 0, 0, 0), result(10, 0, 0, 0), result(2, 1, 7, 0)),
    )
    pursuers = "a-pursuer-0", "a-pursuer-1", "intercept"
    return Tournament(pursuers, ("b-evader-0", "b-evader-1", "flee"), rows)


def test_trainings_of_a_learner_are_counted_as_one_player(tournament):
    pooled = ladder.pool_trainings(tournament)
    assert (pooled.pursuers, pooled.evaders) == (("a", "intercept"), ("b", "flee"))
    np.testing.assert_allclose(pooled.win_rates, [[20 / 40, 6 / 20], [1.0, 0.3]])
    assert pooled.matches[0][0].outcomes["pursuer_out_of_range"] == 14


def test_standings_are_means_of_trainings_with_the_interval_of_the_next(tournament):
    rows = ladder.standings(tournament, Role.PURSUER)
    assert list(rows) == ["a", "intercept"]
    wins = rows["a"]["wins against ours"]
    assert wins["trainings"] == [0.1, 0.5]
    assert wins["mean"] == 0.3
    assert wins["next"] == [0.0, 1.0]  # two trainings say little of a third
    assert rows["a"]["undefeated"]["trainings"] == [round(1 - 13 / 30, 4), round(1 - 12 / 30, 4)]
    assert rows["a"]["own failures"]["trainings"] == [0.9, 0.2]
    assert rows["a"]["time-outs"]["trainings"] == [0.0, 0.3]
    assert rows["a"]["captures"]["mean"] == 0.3
    assert "next" not in rows["intercept"]["own failures"]


def test_evaders_are_ranked_by_the_games_that_they_do_not_lose(tournament):
    rows = ladder.standings(tournament, Role.EVADER)
    assert list(rows) == ["flee", "b"]
    assert rows["flee"]["undefeated against ours"]["mean"] == 0.7
    assert rows["flee"]["own failures"]["mean"] == 0.1
    assert rows["b"]["undefeated"]["trainings"] == [round(1 - 20 / 30, 4)] * 2


def test_every_learner_has_its_function():
    folder = REPOSITORY / "benchmarks" / "entrants"
    for module, function, _ in train.LEARNERS.values():
        tree = ast.parse((folder / f"{module}.py").read_text())
        assert function in [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]


def test_players_of_the_ladder_exist():
    sides = BySide(*Role)
    assert all(find_player(name, sides[role], game.GAME) for role in Role for name in ladder.OURS[role])
