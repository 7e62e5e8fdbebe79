"""The page's charts are those of the package, and so is what a robot sees by them, and what it does."""

import shutil
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import QNetwork, make_network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.arenas.random_arena import random_arena
from apollonius.game.arena import Arena
from apollonius.game.chart import NO_WAY, STOP_BITS, STOPS, Chart
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.game.types import Role
from apollonius.observe.registry import observe
from apollonius.play.replay import as_rows, as_state
from tests.web.test_parity import as_on_the_page, ask, on_a_floor

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
SOME_STOPS = [*range(0, STOPS**2, 97)]
NARROW = Unicycle(v_max=1.5, u1_max=0.4, u2_max=0.7, radius=0.05)
WIDE = Unicycle(v_max=1.0, u1_max=0.2, u2_max=0.9, radius=0.15)
MOST_ON_TIES = 1e-3
"""Share of the cells whose nearest stop may be another: two of their stops are equally far, to the last bit."""
LEVEL = 1e-4
"""Values of actions that differ by no more are as good as equal."""
MOST_FLIPPED = 0.01
"""Share of the states that may be seen otherwise: a ray just passes an obstacle, or two stops are equally near."""


def robots_of_two_sizes(game):
    return replace(game, pursuer=NARROW, evader=WIDE)


GAMES = {
    "paper": lambda: make_game("paper"),
    "office": lambda: find_game("office"),
    "courtyard": lambda: robots_of_two_sizes(find_game("courtyard")),
    "random maze": lambda: robots_of_two_sizes(Game(arena=random_arena("maze", 5, width=12.0))),
    "map": lambda: robots_of_two_sizes(Game(arena=on_a_floor())),
}


@dataclass(frozen=True)
class Case:
    """A game, the package's chart of its arena, some states, and the side that looks."""

    game: Game
    chart: Chart
    states: np.ndarray
    role: Role


MORE = ("office", "courtyard", "paper", "map")
"""Games that are compared where slow tests are run; the rest are in every run."""


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=pytest.mark.slow if name in MORE else ()) for name in GAMES]
)
def case(request):
    """One game of many kinds; robots are fast and close to obstacles."""
    game = GAMES[request.param]()
    starts = replace(game, starts=Starts(speed="moving", clearance=0.05))
    role = Role.EVADER if request.param in ("office", "random maze", "map") else Role.PURSUER
    states = np.asarray(as_rows(reset_batch(starts, jax.random.key(1), 500)))
    return Case(game, charted(game).arena.chart, states, role)


def test_charts_are_alike(case):
    (drawn,) = ask(charts=[{"game": as_on_the_page(case.game), "stops": SOME_STOPS}])["charts"]
    field, beside, ways = (np.asarray(leaf[0]) for leaf in (case.chart.field, case.chart.beside, case.chart.ways))
    np.testing.assert_allclose(drawn["field"], field.ravel(), atol=1e-4)
    theirs = np.asarray(drawn["beside"])
    np.testing.assert_array_equal(theirs >> STOP_BITS, beside.ravel() >> STOP_BITS)
    assert np.mean(theirs != beside.ravel()) <= MOST_ON_TIES
    some = ways[SOME_STOPS].astype(int)
    np.testing.assert_array_equal(np.asarray(drawn["ways"]) == NO_WAY, some == NO_WAY)
    np.testing.assert_allclose(drawn["ways"], some, atol=1)
    is_open = (ways < NO_WAY).sum(axis=1) > 1
    assert 0.2 < is_open.mean() < 1.0


def test_robots_see_the_same_and_do_the_same(case, tmp_path):
    network = make_network("egocentric", width=32, depth=2, key=jax.random.key(0))
    seen = np.asarray(looked(case))
    network = levelled(network, seen)
    values = np.asarray(jax.vmap(network)(jnp.asarray(seen)))
    save_agent(describe(network, case.role, {}, {}), tmp_path / "small.safetensors")
    agent = {
        "path": str(tmp_path / "small.safetensors"),
        "game": as_on_the_page(case.game),
        "role": case.role.name.lower(),
    }
    answer = ask(agent=agent, positions=case.states.tolist())
    is_alike = np.abs(np.asarray(answer["observed"]) - seen).max(axis=1) <= 1e-3
    assert np.mean(~is_alike) <= MOST_FLIPPED
    best, second = np.sort(values, axis=1)[:, :-3:-1].T
    is_clear = is_alike & (best - second > LEVEL)
    chosen = np.argmax(values, axis=1)[is_clear]
    np.testing.assert_array_equal(
        np.asarray(answer["gears"])[is_clear], np.stack([chosen // 3, chosen % 3], axis=1) - 1
    )
    assert is_clear.mean() > 0.9
    assert len(np.unique(chosen)) > 5


def looked(case):
    """The package's numbers; of the arena they are made of nothing but its chart."""
    game = replace(case.game, arena=Arena(chart=case.chart))

    @jax.jit
    def look(game, rows):
        return jax.vmap(lambda row: observe(game, as_state(row, jnp.asarray(0)), case.role, "egocentric"))(rows)

    return look(game, jnp.asarray(case.states))


def levelled(network: QNetwork, seen) -> QNetwork:
    """The same, where no action is the better one on average, so that all are chosen."""
    means = jnp.mean(jax.vmap(network)(jnp.asarray(seen)), axis=0)
    return eqx.tree_at(lambda network: network.layers[-1].bias, network, network.layers[-1].bias - means)
