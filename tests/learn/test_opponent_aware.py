"""An evader that is told what the pursuer does next: it learns beside a pursuer that is not, and plays in matches."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.network import make_network
from apollonius.agents.shield import shielded
from apollonius.agents.store import describe, save_agent
from apollonius.agents.trained import greedy
from apollonius.catalogue import find_player
from apollonius.errors import InvalidInput
from apollonius.evaluate.match import play_match
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.learn.self_play import start_self_play
from apollonius.learn.stage_config import SelfPlayConfig
from apollonius.learn.train_state import Plan
from apollonius.learn.train_step import play_and_learn
from tests.learn.tiny import CHUNK, DQN, GAME
from tests.matches import a_match

STAGE = SelfPlayConfig(env_steps=4 * CHUNK, evader_observation="opponent-aware")


@pytest.mark.slow
def test_it_learns_from_more_than_the_pursuer_reads():
    plan = Plan(replace(DQN, learning_starts=CHUNK // 2), STAGE)
    state = start_self_play(plan, GAME, jax.random.key(0), BySide(None, None))
    before = np.array(state.learners[Role.EVADER].learner.network.layers[0].weight)
    state, metrics = play_and_learn(plan, STAGE.rewarded(GAME), state, {})
    seen = BySide(*(np.asarray(state.learners[role].buffer.rows.observation) for role in Role))
    assert (seen.pursuer.shape, seen.evader.shape) == ((128, 64, 8), (128, 64, 36))
    done = np.asarray(jax.vmap(jax.vmap(GAME.pursuer.controls))(state.learners[Role.PURSUER].buffer.rows.action))
    limits = np.array([GAME.pursuer.u1_max, GAME.pursuer.u2_max])
    np.testing.assert_allclose(seen.evader[..., -2:], np.moveaxis(done, 0, -1) / limits, atol=1e-6)
    assert all(np.isfinite(loss) and loss > 0 for loss in metrics.losses)
    after = np.asarray(state.learners[Role.EVADER].learner.network.layers[0].weight)
    assert (before != after)[:, -2:].any()


def test_it_is_kept_in_a_file_and_plays_in_matches_only(tmp_path):
    game, file = Game(max_steps=20), tmp_path / "E.safetensors"
    network = make_network("opponent-aware", 16, 1, jax.random.key(0))
    save_agent(describe(network, Role.EVADER, {}, {}), file)
    evader = find_player(str(file), Role.EVADER, game).policy
    pursuer = greedy(make_network("paper", 16, 1, jax.random.key(1)))
    assert play_match(a_match(game, pursuer, evader, games=8)).outcomes["no_result"] > 0
    with pytest.raises(InvalidInput, match="'opponent-aware' reads what the opponent does next"):
        play_match(a_match(game, Still(), shielded(evader, game, Role.EVADER), games=8))
