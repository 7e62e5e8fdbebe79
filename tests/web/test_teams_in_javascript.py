"""The page plays games of teams as the package does: rules robot by robot, what each sees, and what it then does."""

import shutil
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.file import find_game
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import reset_batch
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams
from apollonius.game.types import Outcome, RobotStatus
from apollonius.replay import as_rows, as_state, play_actions
from tests.web.test_rules_in_javascript import TOLERANCE, apart, as_on_the_page, ask

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
GAMES_PLAYED, STEPS, HELD = 80, 45, 5


def crowd():
    """Three pursuers of different makes and two evaders, whose bodies touch."""
    wide, quick = Unicycle(radius=0.25), Unicycle(v_max=1.8, u1_max=0.9, radius=0.1)
    teams = Teams((wide, quick), (Unicycle(v_max=1.0, radius=0.15),), mates_collide=True)
    return replace(make_game("paper"), capture_distance=0.6, teams=teams)


GAMES = {
    "team-2v1": lambda: make_game("team-2v1"),
    "team-3v1": lambda: make_game("team-3v1"),
    "team-3v2": lambda: make_game("team-3v2"),
    "team-3v2/office": lambda: find_game("team-3v2/office"),
    "crowd": crowd,
}


def statuses_of(states):
    """Of each robot, the pursuers first, in every state."""
    names = [status.name.lower() for status in RobotStatus]
    numbers = np.stack([np.asarray(leaf) for leaf in jax.tree.leaves(states.status)], axis=-1)
    return np.asarray(names)[numbers]


@pytest.mark.parametrize("name", [*(pytest.param(name, marks=pytest.mark.slow) for name in [*GAMES][:-1]), "crowd"])
def test_games_of_teams_come_out_the_same(name):
    """Random play: states, the status of every robot after every step, outcomes."""
    game = GAMES[name]()
    pursuers, robots = len(game.bodies.pursuer), sum(map(len, game.bodies))
    starts = replace(game, starts=Starts(speed="moving", clearance=0.1, separation=game.capture_distance))
    rows = as_rows(reset_batch(starts, jax.random.key(1), GAMES_PLAYED))
    random = np.random.default_rng(1)
    actions = random.integers(9, size=(GAMES_PLAYED, STEPS // HELD, robots), dtype=np.int32).repeat(HELD, axis=1)
    play = jax.jit(jax.vmap(lambda row, taken: play_actions(game, as_state(row, jnp.asarray(0), pursuers), taken)))
    states, outcomes = play(jnp.asarray(rows), jnp.asarray(actions))
    outcomes = np.asarray(outcomes)
    expected = np.stack([np.asarray(leaf) for leaf in jax.tree.leaves(states.robots)], axis=-1)
    statuses, record = statuses_of(states), as_on_the_page(game)
    lengths = [int(np.argmax(over)) + 1 if over.any() else STEPS for over in outcomes != Outcome.ONGOING]
    told = [
        {"game": record, "states": [row.tolist()], "actions": taken[:length].tolist()}
        for row, taken, length in zip(rows, actions, lengths, strict=True)
    ]
    for index, (played, length) in enumerate(zip(ask(games=told)["games"], lengths, strict=True)):
        assert apart(played["rows"], expected[index, : length + 1]) <= TOLERANCE
        assert played["statuses"] == statuses[index, 1 : length + 1].tolist()
        assert played["outcomes"] == [Outcome(int(one)).name.lower() for one in outcomes[index, :length]]
    met = {status for index, length in enumerate(lengths) for status in statuses[index, length]}
    assert met == {status.name.lower() for status in RobotStatus} - (set() if name == "crowd" else {"hit_mate"})
    lasted = [length for index, length in enumerate(lengths) if (statuses[index, length - 1] != "active").any()]
    assert len(lasted) > 5, "some games go on without some of their robots"
