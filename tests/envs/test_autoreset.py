"""Gymnasium's three ways to begin ended games again: each as its own `SyncVectorEnv` does it."""

import gymnasium
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import apollonius.envs.gymnasium  # noqa: F401 (registers the environments)
from apollonius.envs.gymnasium import OneSide
from apollonius.envs.vector import ManyGames
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.game.types import GameState, Outcome, RobotState, Role
from apollonius.io.errors import InvalidInput

GAMES = 3
MODES = list(AutoresetMode)
ZERO, ONE = np.float32(0), np.float32(1)


class OneStart(Starts):
    """Every game begins with the pursuer in front of a wall, so that whoever draws it, draws the same."""

    def sample(self, key, arena, bodies):
        places = [RobotState(*(jnp.float32(number) for number in place)) for place in ((0.2, 5, 0, 3.1), (7, 7, 0, 0))]
        return GameState.of_two(*places, jnp.int32(0))


GAME = Game(arena=make_game("paper").arena, max_steps=13, starts=OneStart())
OPTIONS = {"opponent": "still", "game": GAME, "observation": "paper"}


@pytest.fixture(scope="module")
def one_by_one():
    return [OneSide(Role.PURSUER, **OPTIONS) for _ in range(GAMES)]


def many(mode, games=GAMES):
    return ManyGames(Role.PURSUER, games, autoreset_mode=mode, **OPTIONS)


def same(ours, theirs):
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.parametrize("mode", MODES)
def test_every_step_tells_what_gymnasiums_own_vector_tells(mode, one_by_one):
    ours = many(mode)
    theirs = SyncVectorEnv([lambda env=env: env for env in one_by_one], autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"] == mode
    same(ours.reset(seed=0)[:1], theirs.reset(seed=0)[:1])
    rng, terminations, truncations = np.random.default_rng(0), 0, 0
    for turn in range(120):
        actions = rng.choice([5, 7, 7, 8], GAMES)
        *told, infos = ours.step(actions)
        *expected, their_infos = theirs.step(actions)
        same(told, expected)
        over = told[2] | told[3]
        terminations, truncations = terminations + told[2].sum(), truncations + told[3].sum()
        if mode == AutoresetMode.SAME_STEP:
            assert ("final_obs" in infos) == ("final_obs" in their_infos) == over.any()
            if over.any():
                assert (infos["_final_obs"] == their_infos["_final_obs"]).all()
                assert (infos["_final_info"] == their_infos["_final_info"]).all()
                same(infos["final_obs"][over], their_infos["final_obs"][over])
                assert names(infos["final_info"]["outcome"])[over].tolist() == (
                    their_infos["final_info"]["outcome"][over].tolist()
                )
        else:
            assert (infos["_outcome"] == their_infos["_outcome"]).all()
            assert names(infos["outcome"]).tolist() == their_infos["outcome"].tolist()
        again = over.copy() if mode == AutoresetMode.DISABLED else np.zeros(GAMES, bool)
        if turn % 20 == 5:
            again[turn // 20 % GAMES] = True  # one that goes on begins again too
        if again.any():
            seen = [env.reset(options={"reset_mask": again.copy()})[0] for env in (ours, theirs)]
            same(seen[:1], seen[1:])
    assert terminations > 3
    assert truncations > 3


def names(outcomes):
    return np.array([Outcome(outcome).name.lower() for outcome in outcomes], object)


def test_nothing_begins_again_by_itself_where_that_is_disabled():
    env = many("Disabled")
    env.reset(seed=0)
    while not (over := np.logical_or(*env.step(np.array([7, 4, 4]))[2:4])).any():
        pass
    assert over.tolist() == [True, False, False]
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"1 games have ended; reset\(options=\{'reset_mask'"):
        env.step(np.full(GAMES, 4))
    before = env.reset(options={"reset_mask": over})[0]
    same(env.step(np.full(GAMES, 4))[0], before)  # all at rest


def test_starts_are_used_once_when_games_begin_again_one_by_one():
    env = ManyGames(Role.PURSUER, 4, opponent="still", observation="paper", autoreset_mode="Disabled")
    first, _ = env.reset(seed=0)
    starts = [*first]
    for turn in range(40):
        mask = np.arange(4) == turn % 4
        seen, _ = env.reset(options={"reset_mask": mask})
        starts.append(seen[turn % 4])
    assert len(np.unique(starts, axis=0)) == 44
    assert (env.reset(seed=0)[0] == first).all()


def test_gymnasium_makes_each_mode_by_name():
    env = gymnasium.make_vec("apollonius/Evasion-v0", num_envs=2, autoreset_mode="NextStep", **OPTIONS)
    assert env.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP


def test_bad_modes_and_masks_are_refused():
    with pytest.raises(InvalidInput, match=r"autoreset_mode = sometimes.*NextStep, SameStep, Disabled"):
        many("sometimes")
    env = many("Disabled")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.reset(options={"reset_mask": np.array([True, False, False])})
    env.reset()
    for mask, why in (
        ([1, 0, 0], "number type of reset_mask"),
        ([True, False], r"shape of reset_mask = \(2,\)"),
        ([False] * 3, "games in reset_mask = 0"),
    ):
        with pytest.raises(InvalidInput, match=why):
            env.reset(options={"reset_mask": np.array(mask)})
