"""A finished training run to report on."""

import json

import jax
import pytest

from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.pairings import last_agents
from apollonius.game.by_side import BySide
from apollonius.game.types import Role
from apollonius.learn.folder import create_run
from apollonius.learn.run import Run
from tests.learn.tiny import RUN


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory):
    """The smallest training of both stages, judged in one match. Not to be written into."""
    folder = tmp_path_factory.mktemp("runs") / "tiny"
    create_run(RUN, folder)
    with jax.numpy_dtype_promotion("standard"):
        assert Run(RUN, folder).execute()
    pursuer = find_player(str(last_agents(folder)["P_curriculum"]), Role.PURSUER)
    result = play_match(Match(RUN.game, BySide(pursuer, find_player("random", Role.EVADER)), games=150, seed=1))
    (folder / "evaluation.json").write_text(json.dumps({"P_curriculum against random": result.to_dict()}))
    return folder
