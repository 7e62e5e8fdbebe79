"""Games in many arenas of a suite, by name: what files say, who plays, and how a match is counted by arenas."""

import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.file import find_game
from apollonius.arenas.record import from_dict, to_dict
from apollonius.arenas.scenarios import OTHERS, PAPERS_OWN, each_alone, find_scenario, makes
from apollonius.arenas.suite import suite_arena
from apollonius.catalogue import find_player
from apollonius.cli import main
from apollonius.errors import InvalidInput
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.result import ByArena, count_by_arena
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, reset_batch, sample_starts
from apollonius.game.scenario import in_arenas
from apollonius.game.types import ROLES, Outcome, Role
from apollonius.playout import Results

THREE = "suite-v1/discs-01,racks-07,caves-07"


@pytest.fixture(scope="module")
def three():
    return find_game(THREE)


def test_a_list_of_arenas_is_a_game_in_each_of_them(three):
    assert three.scenario.count == three.scenario.size == 3
    for number, alone in enumerate(each_alone(three)):
        name = THREE.split("/")[1].split(",")[number]
        arena = suite_arena("suite-v1", name)
        assert to_dict(alone.arena) == to_dict(arena)
        x, y = np.random.default_rng(0).uniform(0, [[arena.x_max], [arena.y_max]], (2, 300)).astype(np.float32)
        padded = three.scenario.arena(jnp.asarray(number))
        found, known = (np.asarray(jax.vmap(one.clearance)(x, y)) for one in (padded, arena))
        np.testing.assert_allclose(found, known, atol=1e-5)


def test_a_record_names_it(three):
    record = to_dict(three)
    assert record["scenario"] == THREE
    again = from_dict(Game, json.loads(json.dumps(record)), "a record")
    assert again.scenario is find_scenario(THREE)
    with pytest.raises(InvalidInput, match=r"scenario = suite-v1/nothing .* one of suite-v1/train, suite-v1/held-out"):
        from_dict(Game, record | {"scenario": "suite-v1/nothing"}, "a record")
    with pytest.raises(InvalidInput, match="arena of suite-v1 = no-such"):
        find_game("suite-v1/discs-01,no-such")


def test_robots_of_many_makes_are_around_the_papers():
    found = makes()
    assert len(found) == PAPERS_OWN + OTHERS
    for role in Role:
        bodies = found.every(role)
        for body in bodies[:PAPERS_OWN]:
            assert (body.v_max, body.u1_max, body.u2_max, body.radius) == pytest.approx((1.2, 0.3, 0.8, 0.0))
        numbers = np.array([(body.v_max, body.u1_max, body.u2_max, body.radius) for body in bodies[PAPERS_OWN:]])
        assert (numbers.min(axis=0) >= [0.6 - 1e-5, 0.15 - 1e-5, 0.4 - 1e-5, 0]).all()
        assert (numbers.max(axis=0) <= [2 + 1e-5, 1.2 + 1e-5, 2 + 1e-5, 0.25 + 1e-5]).all()
        assert (numbers.max(axis=0) > [1.6, 0.9, 1.5, 0.15]).all()
    gaps = np.asarray(found.capture_distance - found.pursuer.radius - found.evader.radius)
    assert gaps.min() >= 0.2 - 1e-5
    assert gaps.max() <= 0.4 + 1e-5


def test_each_game_has_the_robots_of_its_make():
    """Two arenas, three makes: who is fast is where the state says."""
    some = jax.tree.map(lambda leaf: leaf[PAPERS_OWN - 1 : PAPERS_OWN + 2], makes())
    game = in_arenas(Game(), [suite_arena("suite-v1", name) for name in ("discs-01", "discs-03")], some)
    assert game.scenario.size == 6
    states = jax.jit(reset_batch, static_argnames="games")(game, jax.random.key(0), 64)
    assert set(np.asarray(states.place).tolist()) == set(range(6))
    straight = jnp.full(64, 7, jnp.int32)
    for _ in range(3):
        states = jax.vmap(lambda state, action: game.step(state, action, action).state)(states, straight)
    gained = np.asarray(some.pursuer.u1_max)[np.asarray(states.place) // 2] * 0.3
    np.testing.assert_allclose(states.pursuer.v, gained, rtol=1e-4)


def test_matches_take_turns_between_arenas_and_makes(three):
    starts = sample_starts(three, jax.random.key(0), 7)
    assert np.asarray(starts.place).tolist() == [0, 1, 2, 0, 1, 2, 0]
    with_makes = replace(three.scenario, makes=makes())
    places = with_makes.place_of(np.arange(3 * 64))
    assert sorted(places) == list(range(3 * 64)), "every arena with every make once"


def test_wins_are_counted_by_arenas(three):
    outcome = jnp.asarray([Outcome.CAPTURED, Outcome.NO_RESULT, Outcome.EVADER_OUT_OF_RANGE] * 3 + [1])
    found = count_by_arena(three.scenario, Results(outcome, jnp.ones(10, jnp.int32)))
    assert found == ByArena((4, 0, 3), (4, 3, 3))
    assert (found.rates, found.mean, found.least) == ([1.0, 0.0, 1.0], pytest.approx(2 / 3), 0.0)
    assert found.worst == 0.0
    assert found.interval == (0.0, 1.0)


def test_the_interval_over_few_arenas_is_students():
    reach = 4.302653 * 0.1 / np.sqrt(3)  # Student's t, two degrees of freedom
    assert ByArena((6, 5, 7), (10, 10, 10)).interval == pytest.approx((0.6 - reach, 0.6 + reach))
    assert ByArena((6,), (10,)).interval == (0.0, 1.0)


@pytest.mark.slow
def test_a_shield_holds_in_every_arena():
    """Robots that drive at random crash, and behind their shields they do not."""
    game = replace(find_game("suite-v1/discs-01,racks-07"), max_steps=200)
    for names in (BySide("random", "random"), BySide("shielded:random", "shielded:random")):
        players = ROLES.map(lambda role, names=names: find_player(names[role], role, game))
        result = play_match(Match(game, players, 16), slots=16)
        crashed = sum(count for name, count in result.outcomes.items() if "hit" in name or "out_of" in name)
        assert (crashed == 0) == names.pursuer.startswith("shielded")
        assert result.arenas is not None
        assert result.arenas.games == (8, 8)


def test_a_match_in_several_arenas_tells_of_them(capsys):
    assert main(["evaluate", "intercept", "still", "--game", THREE, "--games", "12"]) == 0
    out = capsys.readouterr().out
    assert "pursuer, by arenas" in out
    assert "mean of 3, 95 % interval" in out
    assert "in the worst tenth" in out
