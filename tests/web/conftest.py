"""One site and one browser for all tests of the page, with a tab at a desk and one on a phone."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.arena import Arena
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.web.site import Choice, write_site
from tests.web.test_server import serving


@pytest.fixture(scope="package")
def address(tmp_path_factory):
    """Of the page, with a game on a map, and a player of a user's own."""
    folder = tmp_path_factory.mktemp("page")
    occupied = np.zeros((80, 120), bool)
    occupied[30:34, :90] = True
    field = jnp.asarray(distance_field(occupied, 0.1))
    floor = OccupancyMap(field, -1.0, 2.0, 0.1, str(folder / "floor.yaml"), "0" * 64)
    games = {"hall": Game(arena=Arena(-1.0, 11.0, 2.0, 10.0, map=floor))}
    spiral = {"spiral": Path(__file__).with_name("spiral.wasm")}
    chosen = Choice("shielded:P_optimal", "you", difficulty="sharp", agents=spiral, games=games)
    write_site(folder / "site", chosen)
    with serving(folder / "site") as server:
        yield f"http://localhost:{server.server_port}/"


@pytest.fixture(scope="package")
def tabs(browser, address):
    from tests.web.browser import DESK, PHONE, Tab

    return {name: Tab(browser, address, **screen) for name, screen in (("desk", DESK), ("phone", PHONE))}


def opened(name):
    """A tab on such a screen; what it opens complains about nothing."""

    @pytest.fixture
    def tab(tabs):
        yield tabs[name]
        assert tabs[name].complaints == []

    return tab


desk, phone = opened("desk"), opened("phone")
