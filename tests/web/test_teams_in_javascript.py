"""The page plays games of teams as the package does: rules robot by robot, what each sees, and what it then does."""

import shutil
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.trained import ZOO
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import reset_batch
from apollonius.game.presets import make_game
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams
from apollonius.game.types import ROLES, Outcome, RobotStatus, Role
from apollonius.observe.view import look
from apollonius.replay import as_rows, as_state, play_actions
from tests.web.test_rules_in_javascript import TOLERANCE, apart, as_on_the_page, ask

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
GAMES_PLAYED, STEPS, HELD = 80, 45, 5
STATES = 200
LEVEL = 1e-3
"""Values of actions that differ by no more are as good as equal."""
MOST_FLIPPED = 0.02
"""Share of states at an edge, where the last bit decides what is seen or done."""
STATUSES = [status.name.lower() for status in RobotStatus]


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
    return np.asarray(STATUSES)[np.stack([np.asarray(leaf) for leaf in jax.tree.leaves(states.status)], axis=-1)]


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
    assert met == {*STATUSES} - (set() if name == "crowd" else {"hit_mate"})
    lasted = [length for index, length in enumerate(lengths) if (statuses[index, length - 1] != "active").any()]
    assert len(lasted) > 5, "some games go on without some of their robots"


@pytest.fixture(
    scope="module",
    params=[
        ("crowd", Role.PURSUER, 1),
        pytest.param(("crowd", Role.EVADER, 1), marks=pytest.mark.slow),
        pytest.param(("team-3v2/office", Role.PURSUER, 2), marks=pytest.mark.slow),
    ],
    ids=lambda asked: "-".join(map(str, asked)),
)
def watched(request):
    """States with some robots out of play, and what one robot sees in them: the question to the page, and views."""
    name, role, number = request.param
    game = charted(GAMES[name]())
    counts = [len(side) for side in game.bodies]
    starts = replace(game, starts=Starts(speed="moving", clearance=0.05))
    rows = np.asarray(as_rows(reset_batch(starts, jax.random.key(3), STATES)))
    statuses = np.where(np.random.default_rng(3).random((STATES, sum(counts))) < 0.3, RobotStatus.CAPTURED, 0)
    statuses[:, [number + role * counts[0], 0 if role == Role.EVADER else counts[0]]] = RobotStatus.ACTIVE

    def view(row, status):
        robots = {Role.PURSUER: tuple(status[: counts[0]]), Role.EVADER: tuple(status[counts[0] :])}
        state = as_state(row, jnp.asarray(0), counts[0])
        return look(game, replace(state, status=ROLES.map(robots.__getitem__)), role, number)

    views = jax.jit(jax.vmap(view))(jnp.asarray(rows), jnp.asarray(statuses))
    record = as_on_the_page(replace(game, arena=replace(game.arena, chart=None)))
    asked = {"game": record, "role": role.name.lower(), "number": number}
    return game, role, views, asked | {"statuses": np.asarray(STATUSES)[statuses].tolist()}, rows.tolist()


@pytest.mark.parametrize("name", [pytest.param("any", marks=pytest.mark.slow), "team"])
def test_networks_see_the_same_in_teams_and_do_the_same(watched, name):
    game, role, views, asked, rows = watched
    if (file := f"{role.name[0]}_{name}") == "E_team":
        pytest.skip("there is no such agent")
    agent = find_player(file, role, game).policy
    seen = np.asarray(jax.jit(jax.vmap(agent.observation))(views))
    answer = ask(agent=asked | {"path": str(ZOO / f"{file}.safetensors")}, positions=rows)
    is_alike = np.abs(np.asarray(answer["observed"]) - seen).max(axis=1) <= 1e-3
    assert np.mean(~is_alike) <= MOST_FLIPPED
    values = np.asarray(jax.vmap(agent.network)(jnp.asarray(seen)))
    best, second = np.sort(values, axis=1)[:, :-3:-1].T
    is_clear = is_alike & (best - second > LEVEL)
    chosen = np.argmax(values, axis=1)
    gears = np.stack([chosen // 3, chosen % 3], axis=1) - 1
    np.testing.assert_array_equal(np.asarray(answer["gears"])[is_clear], gears[is_clear])
    assert is_clear.mean() > 0.9
    assert len(np.unique(chosen)) > 4


def test_classical_players_do_the_same_in_teams(watched):
    game, role, views, asked, rows = watched
    theirs = ask(rules=asked | {"positions": rows})["rules"]
    names = {"intercept", "voronoi-pursuit", "encirclement"} if role == Role.PURSUER else {"flee-aware"}
    assert names <= theirs.keys()
    for name in names:
        values = np.asarray(jax.jit(jax.vmap(find_player(name, role, game).policy.values))(views))
        chosen = np.argmax(theirs[name], axis=1)
        loss = values.max(axis=1) - np.take_along_axis(values, chosen[:, None], axis=1)[:, 0]
        assert np.mean(loss > LEVEL) <= MOST_FLIPPED, name
        assert len(np.unique(chosen)) > 1, name
