"""One site and one browser for all tests of the page, with a tab at a desk and one on a phone."""

from pathlib import Path

import numpy as np
import pytest

from apollonius.arenas.file import find_game
from apollonius.web.site import FirstMatch, write_site
from tests.arenas.test_file import write
from tests.web.test_server import serving


@pytest.fixture(scope="package")
def address(tmp_path_factory):
    """Of the page, with a game on a map, and a player of a user's own."""
    folder = tmp_path_factory.mktemp("page")
    pixels = np.full((80, 120), 254)
    pixels[46:50, :90] = 0
    write(folder, pixels, resolution="0.1")
    (folder / "hall.toml").write_text('[arena]\nmap = "floor.yaml"\n')
    games = {"hall": find_game(str(folder / "hall.toml"))}
    spiral = {"spiral": Path(__file__).with_name("spiral.wasm")}
    chosen = FirstMatch("shielded:pursuer", "you", difficulty="sharp", agents=spiral, games=games)
    write_site(folder / "site", chosen)
    with serving(folder / "site") as server:
        yield f"http://localhost:{server.server_port}/"


@pytest.fixture(scope="package")
def tabs(browser, address):
    from tests.web.browser import DESK, PHONE, Tab

    return {name: Tab(browser, address, **screen) for name, screen in (("desk", DESK), ("phone", PHONE))}


def open_tab(name):
    """A tab on such a screen; what it opens complains about nothing."""

    @pytest.fixture
    def tab(tabs):
        yield tabs[name]
        assert tabs[name].complaints == []

    return tab


desk, phone = open_tab("desk"), open_tab("phone")
