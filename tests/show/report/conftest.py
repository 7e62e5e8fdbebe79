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
from apollonius.solve import viability
from apollonius.solve.grid import make_grid
from apollonius.solve.solving import reference_grid
from tests.learn.tiny import RUN


@pytest.fixture(scope="package")
def coarsely_viable_starts():
    """Robots that cannot stop take hundreds of sweeps; on a coarse grid they are quick, and do for games to show."""

    def coarse(game, role):
        grid, hold = reference_grid(game, role)
        return make_grid(game.arena, game.body(role), (9, 9, 2, grid.counts[3])), hold

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(viability, "reference_grid", coarse)
        jax.config.update("jax_disable_most_optimizations", False)  # it runs for longer than it takes to compile well
        viability.solve_viability(RUN.game)
        jax.config.update("jax_disable_most_optimizations", True)
        yield


@pytest.fixture(scope="package")
def finished_run(tmp_path_factory, coarsely_viable_starts):
    """The smallest training of both stages, judged in one match. Not to be written into."""
    folder = tmp_path_factory.mktemp("runs") / "tiny"
    create_run(RUN, folder)
    with jax.numpy_dtype_promotion("standard"):
        assert Run(RUN, folder).execute()
    pursuer = find_player(str(last_agents(folder)["P_curriculum"]), Role.PURSUER)
    result = play_match(Match(RUN.game, BySide(pursuer, find_player("random", Role.EVADER)), games=150, seed=1))
    (folder / "evaluation.json").write_text(json.dumps({"P_curriculum against random": result.to_dict()}))
    return folder
