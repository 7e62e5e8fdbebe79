"""The page's classical players are those of the package, and its difficulties make opponents easier and harder."""

import shutil
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.built_in import PLAYERS
from apollonius.agents.classical import AbstractClassical
from apollonius.agents.trained import ZOO
from apollonius.arenas.file import find_game
from apollonius.arenas.record import to_dict
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.game.types import Role
from apollonius.observe.view import look
from apollonius.replay import as_rows, as_state
from tests.web.test_rules_in_javascript import as_on_the_page, ask, on_a_floor

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
LEVEL = 1e-3
"""Values that differ by no more are as good as equal."""
MOST_FLIPPED = 0.02
"""Share of states at an edge: which obstacle is nearest, or which way round, is decided by the last bit there."""
GAMES = {
    "territory": lambda: make_game("territory"),
    "courtyard": lambda: find_game("courtyard"),
    "map": lambda: Game(arena=on_a_floor(), evader=Unicycle(v_max=1.0, radius=0.1)),
}


def classical(role, game):
    """The package's players of a side that fit a game, by name."""
    fitting = [(name, policy) for name, (policy, sides) in PLAYERS.items() if role in sides]
    rules = [(name, policy) for name, policy in fitting if issubclass(policy, AbstractClassical) and policy.fits(game)]
    return {name: policy.for_side(game, role) for name, policy in rules}


def choose_alike(game, role, names):
    """Whether both sides' copies of these players take the same actions, but for ties, in some hundred states."""
    starts = replace(game, starts=Starts(speed="moving", clearance=0.05))
    rows = np.asarray(as_rows(reset_batch(starts, jax.random.key(2), 200)))
    views = jax.vmap(lambda row: look(game, as_state(row, jnp.asarray(0)), role))(jnp.asarray(rows))
    asked = {"game": as_on_the_page(game), "role": role.name.lower(), "positions": rows.tolist()}
    theirs = ask(rules=asked)["rules"]
    players = classical(role, game)
    assert set(theirs) == set(players)
    for name in names or players:
        values = np.asarray(jax.jit(jax.vmap(players[name].values))(views))
        chosen = np.argmax(theirs[name], axis=1)
        loss = values.max(axis=1) - np.take_along_axis(values, chosen[:, None], axis=1)[:, 0]
        assert np.mean(loss > LEVEL) <= MOST_FLIPPED, name
        assert len(np.unique(chosen)) > 1, name


def test_classical_players_are_alike():
    choose_alike(make_game("territory"), Role.PURSUER, ["intercept", "territory"])


@pytest.mark.slow
@pytest.mark.parametrize("name", GAMES)
def test_all_classical_players_are_alike(name):
    for role in Role:
        choose_alike(GAMES[name](), role, None)


def chases(difficulty, **changes):
    """How a shielded pursuit of a fleeing robot ends in a dozen games: captures."""
    question = {"pursuer": "P_any", "evader": "flee-aware", "difficulty": difficulty, "seed": 1, "count": 12} | changes
    return ask(chases=question | {"game": to_dict(make_game("paper")), "agents": str(ZOO)})["chases"].count("captured")


@pytest.mark.slow
def test_difficulties_are_in_order():
    gentle, fair, sharp = (chases(difficulty) for difficulty in ("gentle", "fair", "sharp"))
    assert gentle + 3 <= fair <= sharp
    assert gentle <= 5
    assert sharp >= 11
    best = {"pursuer": "P_optimal", "evader": "E_any", "count": 20}
    assert chases("told", **best) >= chases("sharp", **best) + 2


def test_who_sees_late_sees_the_past_and_who_is_told_sees_the_next_step():
    seen = ask(sights=True)["sights"]
    assert seen == {"late": [0, 0, 1], "own": [10, 11, 12], "told": [5, 4]}
