"""Batched play: `collect` with its auto-reset, `play_out`; and a game step by step, whose file plays again alike.

All plays have the same shapes and the same kinds of players, so that few programs are compiled.
"""

import functools
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from scipy import stats

from apollonius.agents.classical import uniform_action
from apollonius.agents.network import make_actor
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import single_player, stack
from apollonius.agents.source import NamedPlayer
from apollonius.agents.trained import SquashedGaussian
from apollonius.evaluate.match import Match, play_games, record_game
from apollonius.game.arena import Arena, Disc
from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.presets import in_teams, make_game, randomised
from apollonius.game.scenario import Spread
from apollonius.game.types import BySide, Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.paper import ENCODED, PAPER
from apollonius.play.autoreset import autoreset
from apollonius.play.playout import play_out
from apollonius.play.replay import as_rows, as_state, load_replay, play_actions, save_replay
from apollonius.play.rollout import collect, init_games
from tests.acting import identical, observe, state

AGILE = Unicycle(v_max=2.0, u1_max=4.0, u2_max=3.0)
GAME = Game(AGILE, AGILE, Arena(0.0, 4.0, 0.0, 4.0, discs=(Disc(2.0, 2.0, 0.3),)), max_steps=25)
GAMES, ROWS, STEPS = 64, 3, 60

step_many = jax.jit(jax.vmap(Game.step, in_axes=(None, 0, 0, 0)))
observe_many = jax.jit(jax.vmap(observe, in_axes=(None, 0, None, None)), static_argnames=("role", "name"))


class Scripted(AbstractPolicy):
    """Plays one action always, or a random one if that is negative."""

    action: Array
    observation: AbstractObservation = eqx.field(static=True, default=PAPER)

    def __call__(self, observation, memory, bits):
        return jnp.where(self.action < 0, uniform_action(bits), self.action), memory


RANDOM = -1


def scripted_policy(observation, *actions):
    return stack([Scripted(jnp.asarray(action), observation) for action in actions])


pursuers, evaders = (functools.partial(scripted_policy, seen) for seen in (PAPER, ENCODED))


@jax.jit
def play_from_starts(game, players, starts, key):
    """Games that begin at row 0 of their starts, played on for a while."""
    word_key, play_key = jax.random.split(key)
    bits = jax.random.bits(word_key, (2, GAMES), jnp.uint32)
    games = init_games(GAME, row(starts, 0), players, bits)
    return collect(game, players, games, starts, play_key, STEPS)


def numpy(tree):
    return jax.tree.map(np.asarray, tree)


@functools.cache
def random_starts():
    starts = numpy(jax.jit(reset_batch, static_argnames="games")(GAME, jax.random.key(0), ROWS * GAMES))
    return jax.tree.map(lambda leaf: leaf.reshape(ROWS, GAMES), starts)


def random_play():
    players = BySide(pursuers(8, 4, 6), evaders(RANDOM, RANDOM))
    return numpy(play_from_starts(GAME, players, random_starts(), jax.random.key(1)))


def row(tree, index):
    return jax.tree.map(lambda leaf: leaf[index], tree)


def over(transitions):
    return transitions.terminated | transitions.truncated


def test_collect_matches_stepping_and_resetting_by_hand():
    games, transitions = random_play()
    state = row(random_starts(), 0)
    returns = np.zeros((2, GAMES), np.float32)
    for t in range(STEPS):
        now = row(transitions, t)
        after = numpy(step_many(GAME, state, *(side.action for side in now.sides)))
        rewards = np.stack([*after.reward])
        returns += rewards
        for side, role, name in zip(now.sides, Role, ("paper", "encoded"), strict=True):
            np.testing.assert_allclose(side.observation, observe_many(GAME, state, role, name), atol=1e-5)
            np.testing.assert_allclose(side.next_observation, observe_many(GAME, after.state, role, name), atol=1e-5)
            np.testing.assert_allclose(side.reward, rewards[role], atol=1e-5)
            np.testing.assert_allclose(side.episode_return, returns[role], atol=1e-4)
        for name in ("outcome", "terminated", "truncated"):
            np.testing.assert_array_equal(getattr(now, name), getattr(after, name))

        ended = over(now)
        fresh = row(random_starts(), t % ROWS)
        state = jax.tree.map(lambda new, old: np.where(ended, new, old), fresh, after.state)  # noqa: B023
        returns[:, ended] = 0
    np.testing.assert_allclose(games.state.evader.x, state.evader.x, atol=1e-5)
    np.testing.assert_array_equal(games.state.steps, state.steps)


def test_autoreset_returns_final_states_and_cycles_through_starts():
    """The pursuers drive on; evaders stand. Games that end take their own starts in turn, and then the first again."""
    batch, step = autoreset(GAME, jax.random.key(4), GAMES, starts=ROWS)
    step_once, firsts, turns = jax.jit(step), [np.asarray(batch.state.evader.x)], []
    for turn in range(STEPS):
        before, accelerate = batch.state, np.full(GAMES, 7)
        batch, now = numpy(step_once(batch, (accelerate, 4)))
        after = numpy(step_many(GAME, before, accelerate, np.full(GAMES, 4)))
        np.testing.assert_allclose(now.state.pursuer.x, after.state.pursuer.x, atol=1e-6)
        np.testing.assert_allclose(now.reward.evader, after.reward.evader, atol=1e-5)
        np.testing.assert_array_equal(now.outcome, after.outcome)
        ended = now.terminated | now.truncated
        np.testing.assert_array_equal(batch.state.steps, np.where(ended, 0, now.state.steps))
        np.testing.assert_array_equal(batch.state.pursuer.x[~ended], now.state.pursuer.x[~ended])
        turns += [((turn + 1) % ROWS, game, batch.state.evader.x[game]) for game in np.flatnonzero(ended)]
    starts = dict.fromkeys((row, game) for row, game, _ in turns)
    assert len({(row, game, float(x)) for row, game, x in turns}) == len(starts) > GAMES
    assert all(x == firsts[0][game] for row, game, x in turns if row == 0)
    assert len({float(x) for _, _, x in turns}) == len(starts)


def test_autoreset_step_works_in_a_scan_and_refuses_bad_arguments():
    batch, step = autoreset(GAME, jax.random.key(4), GAMES, starts=ROWS)
    actions = jax.random.randint(jax.random.key(0), (5, 2, GAMES), 0, 9)
    last, told = jax.jit(functools.partial(jax.lax.scan, step))(batch, actions)
    for one in actions:
        batch, now = step(batch, BySide(*one))
    np.testing.assert_allclose(last.state.evader.y, batch.state.evader.y, atol=1e-6)
    np.testing.assert_allclose(told.reward.pursuer[-1], now.reward.pursuer, atol=1e-6)
    for wrong, said in (
        (lambda: autoreset(GAME, jax.random.key(0), 0), "games = 0 "),
        (lambda: autoreset(GAME, jax.random.key(0), 4, starts=0), "starts = 0 "),
        (lambda: step(batch, (9, 4)), "action = 9 .* from 0 to 8"),
        (lambda: step(batch, (np.zeros(3, int), 4)), r"actions = of shape \(3,\) .* of 64 games"),
    ):
        with pytest.raises(InvalidInput, match=said):
            wrong()


def test_pool_member_plays_its_game_to_the_end():
    transitions = random_play()[1]
    side, ended = transitions.sides.pursuer, over(transitions)[:-1]
    np.testing.assert_array_equal(np.array([8, 4, 6])[side.member], side.action)
    changed = side.member[1:] != side.member[:-1]
    assert not np.any(changed & ~ended)
    assert np.any(changed & ended)


def test_pool_members_are_drawn_uniformly_and_independently():
    """Pursuers stand before a wall: those that accelerate leave the arena, all others stay."""
    doomed = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (ROWS, GAMES)), state((4 - 1e-6, 1), (1, 1)))
    players = BySide(pursuers(RANDOM, RANDOM, RANDOM), evaders(1, 7))
    _, transitions = numpy(play_from_starts(replace(GAME, max_steps=1000), players, doomed, jax.random.key(3)))
    drawn = [side.member[1:][over(transitions)[:-1]] for side in transitions.sides]
    pairs = np.bincount(drawn[0] * 2 + drawn[1], minlength=6)
    assert pairs.sum() > 1000
    assert stats.chisquare(pairs).pvalue > 1e-3


def random_results(slots=5, seed=0, count=37, **how):
    players, starts = BySide(pursuers(*[RANDOM] * 3), evaders(*[RANDOM] * 2)), row(random_starts(), 0)
    return numpy(play_out(GAME, players, row(starts, slice(count)), jax.random.key(seed), slots, **how))


def test_play_out_compiles_once_and_is_independent_of_slots(monkeypatch):
    traced = []
    act = Scripted.__call__
    monkeypatch.setattr(Scripted, "__call__", lambda *seen: traced.append(seen) or act(*seen))
    whole = random_results(slots=2)
    once = len(traced)
    for count in (9, 24, 36):
        assert identical(random_results(slots=2, count=count), row(whole, slice(count)))
    assert len(traced) == once > 0
    assert identical(whole, random_results())


def test_play_out_reports_progress_and_can_be_interrupted():
    """Games of one step, many for each slot: the length of a chunk can still be counted."""
    starts = jax.tree.map(lambda leaf: np.repeat(leaf[:1], 2000, axis=0), row(random_starts(), 0))
    blitz, players = replace(GAME, max_steps=1), BySide(pursuers(*[RANDOM] * 3), evaders(*[RANDOM] * 2))
    told = []
    results = play_out(blitz, players, starts, jax.random.key(0), slots=5, report=lambda *told_: told.append(told_))
    assert told == sorted(told)
    assert told[-1] == (2000, 2000)
    assert len(told) > 15, "a chunk takes at most eight starts for each slot"
    assert set(np.unique(results.steps)) == {1}

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        random_results(report=stop)


def test_play_out_ends_every_game_and_depends_on_the_key():
    results = random_results()
    assert Outcome.ONGOING not in results.outcome
    assert np.all((results.steps >= 1) & (results.steps <= GAME.max_steps))
    assert len(np.unique(results.outcome)) >= 4
    assert not identical(results, random_results(seed=1))


@functools.partial(jax.jit, static_argnums=(2, 3))
def played_at_once(game, players, count, steps):
    """Games from the same starts each time, at their beginning, and what happens in them."""
    starts, bits = reset_batch(game, jax.random.key(3), count), jax.random.bits(jax.random.key(4), (2, count))
    games = init_games(game, starts, players, bits)
    return games, collect(game, players, games, row(starts, None), jax.random.key(5), steps)[1]


def test_robots_respond_after_the_lag_of_their_game():
    """A pursuer that always speeds up stays at rest for as many steps as its commands are late."""
    game = randomised(GAME, [Spread(("drives.pursuer.lag",), 0.0, 2.0)])
    games, transitions = played_at_once(game, BySide(pursuers(7), evaders(RANDOM)), GAMES, 10)
    lags = np.asarray(jax.vmap(lambda state: game.at(state).drives.pursuer.lag)(games.state))
    at_rest = transitions.sides.pursuer.next_observation[..., 2] == -1
    assert set(lags) == {0, 1, 2}
    np.testing.assert_array_equal(np.argmin(at_rest, axis=0), lags)


class Counting(AbstractPolicy):
    """Takes the action whose index is the number of steps that it has played, and the number of its robot's side."""

    observation = PAPER

    @property
    def memory(self):
        return {"steps": jnp.int32(0)}

    def __call__(self, observation, memory, bits):
        return memory["steps"] % 9, {"steps": memory["steps"] + 1}


def test_policy_memory_restarts_with_each_game():
    """Each robot of a side has its own; games end after seven steps, and others begin in their places."""
    game = in_teams(replace(make_game("one-large"), max_steps=jnp.int32(7)), 2, 1)
    _, moves = played_at_once(game, BySide(single_player(Counting()), stack([Counting(), Counting()])), 5, 20)
    over, expected = np.asarray(moves.ended), np.zeros(5, int)
    for step in range(20):
        for side in moves.sides:
            actions = np.asarray(side.action)[step].reshape(5, -1)
            np.testing.assert_array_equal(actions, expected[:, None].repeat(actions.shape[1], axis=1))
        expected = np.where(over[step], 0, expected + 1)
    assert over.sum() >= 10


RECORDED = 24
MATCH = Match.of_names(make_game("paper"), "P_stage1", "random", RECORDED, seed=3)


SLOW = Drives(Drive(lag=2.0, turn_time=0.5), Drive(turn_time=0.9))


@pytest.mark.parametrize("drives", [SLOW, pytest.param(None, marks=pytest.mark.slow)], ids=["slow drives", "at once"])
def test_recorded_game_matches_the_game_played_out(drives):
    match = replace(MATCH, game=replace(MATCH.game, drives=drives))
    results = play_games(match)
    for index in range(0, RECORDED, 12):
        course = record_game(match, index)
        assert (course.outcome, len(course.actions)) == (results.outcome[index], results.steps[index])
        assert course.first_difference() is None
    assert len(set(results.steps[::12].tolist())) > 1


WILD = NamedPlayer("wild", SquashedGaussian(make_actor("paper", 8, 1, jax.random.key(0)), jnp.asarray(1.0)))


@pytest.fixture(scope="module", params=[MATCH.players.pursuer, WILD], ids=["discrete", "both kinds"])
def replay(request):
    return record_game(replace(MATCH, players=replace(MATCH.players, pursuer=request.param)), index=2)


def test_replay_survives_its_file_and_replays_exactly(replay, tmp_path):
    save_replay(replay, tmp_path / "replay.json")
    loaded = load_replay(tmp_path / "replay.json")
    assert replay.actions.shape == (len(replay.states) - 1, 2, 2)[: 3 if replay.pursuer == "wild" else 2]
    assert loaded.states.dtype == np.float32
    np.testing.assert_array_equal(loaded.states, replay.states)
    np.testing.assert_array_equal(loaded.actions, replay.actions)
    assert replace(loaded, states=replay.states, actions=replay.actions, game=replay.game) == replay
    assert loaded.first_difference() is None


def test_first_difference_is_the_first_changed_step(replay):
    states, actions = replay.states.copy(), replay.actions.copy()
    states[7, 4] = np.nextafter(states[7, 4], np.float32(99))
    assert replace(replay, states=states).first_difference() == 7
    actions[11] = -actions[11] if actions.ndim == 3 else 8 - actions[11]
    assert replace(replay, actions=actions).first_difference() == 12
    other = Outcome.NO_RESULT if replay.outcome != Outcome.NO_RESULT else Outcome.CAPTURED
    assert replace(replay, outcome=other).first_difference() == len(replay.actions)


GOLDEN = sorted((Path(__file__).parents[1] / "golden").glob("*.json"))
LONGEST = 1000
"""All are played for as many steps, so that one compilation serves those of one game."""
TOLERANCE = 1e-5
"""Another processor may round a step otherwise [m, m/s, rad]."""


@pytest.mark.parametrize("path", GOLDEN, ids=lambda path: path.stem)
def test_golden_games_replay_as_recorded(path):
    replay = load_replay(path)
    steps, actions = len(replay.actions), np.zeros((LONGEST, 2), np.int32)
    actions[:steps] = replay.actions
    start = replace(as_state(jnp.asarray(replay.states[0]), jnp.asarray(0)), movers=replay.movers)
    states, outcomes = play_actions(replay.game, start, jnp.asarray(actions))
    np.testing.assert_allclose(as_rows(states)[: steps + 1], replay.states, rtol=0, atol=TOLERANCE)
    assert outcomes[:steps].tolist() == [Outcome.ONGOING] * (steps - 1) + [replay.outcome]
