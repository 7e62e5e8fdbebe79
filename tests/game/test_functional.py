"""The game as pure functions: one compilation serves all physics, and a sweep over physics is a `vmap`."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome

PAPER = make_game("paper")
ACCELERATE = jnp.int32(7)


def other_physics(index):
    """The paper's game with other limits, discs, walls and time step; the arena's structure is the same."""
    rng = np.random.default_rng(index)
    discs = tuple(Disc(float(x), float(y), float(r)) for x, y, r in rng.uniform([2, 2, 0.2], [8, 8, 0.6], (3, 3)))
    body = Unicycle(v_max=float(rng.uniform(0.5, 2)), u1_max=float(rng.uniform(0.2, 1)), radius=0.1)
    return Game(
        pursuer=body, evader=Unicycle(u2_max=float(rng.uniform(0.3, 1))), arena=Arena(-1.0, 11.0, -1.0, 11.0, discs),
        dt=float(rng.uniform(0.05, 0.2)), capture_distance=0.4, max_steps=int(rng.integers(50, 500)),
    )  # fmt: skip


def test_one_compilation_serves_all_speeds_discs_walls_and_time_steps():
    traces = []

    @eqx.filter_jit
    def play(game, key):
        traces.append(game)
        return game.step(game.reset(key), ACCELERATE, ACCELERATE)

    games = [jax.tree.map(jnp.asarray, other_physics(index)) for index in range(5)]
    speeds = {float(play(game, jax.random.key(0)).state.pursuer.v) for game in games}
    assert len(traces) == 1
    assert len(speeds) == 5
    four_discs = jax.tree.map(jnp.asarray, make_game("four-small"))
    play(four_discs, jax.random.key(0))
    assert len(traces) == 2  # only the number of discs and the named profiles are static
    play(jax.tree.map(jnp.asarray, make_game("zero-sum")), jax.random.key(0))
    assert len(traces) == 3


def test_a_jitted_step_takes_games_of_python_numbers_without_compiling_again():
    step = jax.jit(lambda *given: Game.step(*given))  # of its own: jitted again, a function keeps its compilations
    state = PAPER.reset(jax.random.key(0))
    for index in range(4):
        step(other_physics(index), state, ACCELERATE, ACCELERATE)
    assert step._cache_size() == 1


def test_a_sweep_over_physics_is_a_vmap():
    games = [other_physics(index) for index in range(6)]
    batch = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *games)
    state = PAPER.reset(jax.random.key(1))
    swept = jax.jit(jax.vmap(Game.step, in_axes=(0, None, None, None)))(batch, state, ACCELERATE, ACCELERATE)
    for index, game in enumerate(games):
        alone = jax.jit(Game.step)(game, state, ACCELERATE, ACCELERATE)
        for one, other in zip(jax.tree.leaves(swept), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(one[index], other, atol=1e-5)


def test_one_number_of_a_game_is_swept_as_an_array():
    def top_speed_after(v_max):
        game = replace(PAPER, pursuer=replace(PAPER.pursuer, v_max=v_max))
        state = PAPER.reset(jax.random.key(2))
        return jax.lax.fori_loop(0, 60, lambda _, s: game.step(s, ACCELERATE, ACCELERATE).state, state).pursuer.v

    speeds = jnp.array([0.3, 0.9, 1.5])
    np.testing.assert_allclose(jax.jit(jax.vmap(top_speed_after))(speeds), speeds, atol=1e-6)


@pytest.mark.parametrize(("name", "terminated"), [("paper", False), ("zero-sum", True)])
def test_terminated_and_truncated_are_told_apart_and_never_both(name, terminated):
    """The time limit is a truncation where the game's value goes on beyond it, and the evader's win in `zero-sum`."""
    game = replace(make_game(name), max_steps=1)
    starts = jax.vmap(game.reset)(jax.random.split(jax.random.key(0), 50))
    after = jax.vmap(game.step, in_axes=(0, None, None))(starts, jnp.int32(4), jnp.int32(4))
    assert (after.outcome == Outcome.NO_RESULT).all()
    assert after.terminated.tolist() == [terminated] * 50
    assert after.truncated.tolist() == [not terminated] * 50
