"""What the page runs does what the package's own Python does: games, what robots see, players, shields, replays."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.built_in import PLAYERS
from apollonius.agents.classical import AbstractClassical
from apollonius.agents.network import apply, make_actor, make_network
from apollonius.agents.shield import MARGIN, brakes
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.agents.trained import ZOO
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_player
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle, gears
from apollonius.game.game import Game, reset_batch
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Polygon
from apollonius.game.presets import PRESETS, make_game
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams
from apollonius.game.types import NUM_ACTIONS, ROLES, Outcome, RobotStatus, Role
from apollonius.observe.registry import find_observation
from apollonius.observe.view import look
from apollonius.play.replay import as_rows, as_state, load_replay, play_actions
from apollonius.web.site import PAGE, READS

GOLDEN = sorted((Path(__file__).parents[1] / "golden").glob("*.json"))
TOLERANCE = 1e-5
LEVEL = 1e-3
"""Values of actions that differ by no more are as good as equal."""
MOST_FLIPPED = 0.02
"""Share of states at an edge, where the last bit decides what is seen or done."""
STATUSES = np.asarray([status.name.lower() for status in RobotStatus])
pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")


def ask(**question):
    program = ["node", str(Path(__file__).with_name("check.mjs"))]
    question = json.dumps({"page": str(PAGE)} | question)
    answer = subprocess.run(program, input=question, capture_output=True, text=True, check=True)
    return json.loads(answer.stdout)


def apart(rows, others):
    """Largest difference of states; headings differ by at most half a turn."""
    away = np.abs(np.asarray(rows) - np.asarray(others))
    away[:, 3::4] = np.minimum(away[:, 3::4], 2 * np.pi - away[:, 3::4])
    return away.max()


def test_golden_games_have_every_outcome_and_every_game():
    replays = [load_replay(path) for path in GOLDEN]
    assert {replay.outcome for replay in replays} == set(Outcome) - {Outcome.ONGOING}
    assert {path.stem.rsplit("-", 1)[0] for path in GOLDEN} == set(PRESETS)
    assert max(len(replay.actions) for replay in replays) == 1000


def test_golden_games_come_out_the_same():
    played = ask(games=[json.loads(path.read_text()) for path in GOLDEN])["games"]
    for path, game in zip(GOLDEN, played, strict=True):
        replay = load_replay(path)
        assert apart(game["rows"], replay.states) <= TOLERANCE, path.name
        assert game["outcomes"][-1] == replay.outcome.name.lower()
        assert set(game["outcomes"][:-1]) <= {"ongoing"}


def among_polygons():
    """A room with a door, a notched pillar and a disc."""
    room = ((2.0, 2.0), (8.0, 2.0), (8.0, 8.0), (2.0, 8.0), (2.0, 6.0), (2.5, 6.0), (2.5, 7.5), (7.5, 7.5), (7.5, 2.5),
            (2.5, 2.5), (2.5, 4.0), (2.0, 4.0))  # fmt: skip
    pillar = ((4.0, 4.0), (5.0, 4.5), (6.0, 4.0), (5.0, 6.0))
    return Arena(discs=(Disc(1.0, 9.0, 0.4),), polygons=(Polygon(room), Polygon(pillar)))


def on_a_floor():
    """A map of twelve by nine metres with walls, blocks, a closed room, and a disc; its corner is not the origin."""
    occupied = np.zeros((90, 120), bool)
    occupied[20:23, :70] = occupied[45:48, 50:] = occupied[60:85, 20:23] = True
    occupied[60:80, 80:82] = occupied[60:80, 98:100] = occupied[60:62, 80:100] = occupied[78:80, 80:100] = True
    field = jnp.asarray(distance_field(occupied, 0.1))
    return Arena(-3.0, 9.0, 2.0, 11.0, (Disc(2.0, 9.0, 0.4),), map=OccupancyMap(field, -3.0, 2.0, 0.1, "floor", ""))


def as_on_the_page(game):
    """A game's record, a map with its field."""
    record, occupancy = to_dict(game), game.arena.map
    if occupancy:
        rows, columns = occupancy.field.shape
        place = {name: getattr(occupancy, name) for name in ("x", "y", "cell")}
        field = np.asarray(occupancy.field).ravel().tolist()
        record["arena"]["map"] = place | {"rows": rows, "columns": columns, "field": field}
    return record


def crowd():
    """Three pursuers of different makes and two evaders, whose bodies touch."""
    wide, quick = Unicycle(radius=0.25), Unicycle(v_max=1.8, u1_max=0.9, radius=0.1)
    teams = Teams((wide, quick), (Unicycle(v_max=1.0, radius=0.15),), mates_collide=True)
    return replace(make_game("paper"), capture_distance=0.6, teams=teams)


def fast(arena):
    return Game(arena=arena, starts=Starts(speed="moving"), evader=Unicycle(v_max=1.0, radius=0.1))


GAMES = {
    "paper": lambda: make_game("paper"),
    "territory": lambda: make_game("territory"),
    "polygons": lambda: fast(among_polygons()),
    "map": lambda: fast(on_a_floor()),
    "crowd": crowd,
    "team-2v1": lambda: make_game("team-2v1"),
    "team-3v2/office": lambda: find_game("team-3v2/office"),
}


def any_actions(random, size):
    """Discrete actions of some robots."""
    return random.integers(9, size=size, dtype=np.int32)


def any_gears(random, size):
    """Gears of some robots, a third of them beyond 1, where they are clipped."""
    return random.uniform(-1.5, 1.5, size=(*size, 2)).astype(np.float32)


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


def drawn(game, clearance, count):
    """Starts of fast robots close to obstacles and to each other, as rows."""
    starts = Starts(speed="moving", clearance=clearance, separation=game.capture_distance)
    return np.asarray(as_rows(reset_batch(replace(game, starts=starts), jax.random.key(1), count)))


@pytest.mark.parametrize(
    ("name", "draw"),
    [
        ("polygons", any_actions),
        ("map", any_gears),
        ("crowd", any_actions),
        *(slow(name, any_gears) for name in ("paper", "territory", "polygons", "crowd", "team-3v2/office")),
    ],
)
def test_games_come_out_the_same(name, draw):
    """Random play: states, the status of every robot after every step, outcomes."""
    game, count, steps, held = GAMES[name](), 80, 45, 5
    pursuers, robots = len(game.bodies.pursuer), sum(map(len, game.bodies))
    rows = drawn(game, 0.1, count)
    actions = draw(np.random.default_rng(1), (count, steps // held, robots)).repeat(held, axis=1)
    play = jax.jit(jax.vmap(lambda row, taken: play_actions(game, as_state(row, jnp.asarray(0), pursuers), taken)))
    states, outcomes = play(jnp.asarray(rows), jnp.asarray(actions))
    outcomes = np.asarray(outcomes)
    expected = np.stack([np.asarray(leaf) for leaf in jax.tree.leaves(states.robots)], axis=-1)
    lengths = [int(np.argmax(over)) + 1 if over.any() else steps for over in outcomes != Outcome.ONGOING]
    told = [
        {"game": as_on_the_page(game), "states": [row.tolist()], "actions": taken[:length].tolist()}
        for row, taken, length in zip(rows, actions, lengths, strict=True)
    ]
    for index, (played, length) in enumerate(zip(ask(games=told)["games"], lengths, strict=True)):
        assert apart(played["rows"], expected[index, : length + 1]) <= TOLERANCE
        assert played["outcomes"] == [Outcome(int(one)).name.lower() for one in outcomes[index, :length]]
        if states.status:
            statuses = np.stack([np.asarray(leaf[index]) for leaf in jax.tree.leaves(states.status)], axis=-1)
            assert played["statuses"] == STATUSES[statuses[1 : length + 1]].tolist()
    assert len({int(outcome[length - 1]) for outcome, length in zip(outcomes, lengths, strict=True)}) > 2


def test_gears_however_small_move_a_robot_at_its_top_speed_alike():
    """In single precision the top speed, 1.2 m/s, is more than 1.2."""
    game = make_game("paper")
    start = jnp.asarray([2.0, 5.0, 1.2, 0.4, 8.0, 5.0, 1.2, -0.4], jnp.float32)
    sizes = np.asarray([0.0, 1e-30, 1e-15, 1e-12, 1e-9, 1e-6, 1e-5, 1e-3], np.float32)
    actions = np.stack([sizes, -sizes], axis=1)[:, :, None].repeat(2, axis=2)
    states, _ = play_actions(game, as_state(start, jnp.asarray(0)), jnp.asarray(actions))
    told = {"game": to_dict(game), "states": [start.tolist()], "actions": actions.tolist()}
    assert apart(ask(games=[told])["games"][0]["rows"], as_rows(states)) <= TOLERANCE


@pytest.mark.parametrize(
    ("name", "role", "number"),
    [
        ("map", Role.PURSUER, 0),
        ("crowd", Role.PURSUER, 1),
        slow("territory", Role.EVADER, 0),
        slow("polygons", Role.PURSUER, 0),
        slow("crowd", Role.EVADER, 1),
        slow("team-3v2/office", Role.PURSUER, 2),
    ],
)
def test_robots_see_and_do_the_same(name, role, number):
    """All observations, all rules, and the room that all actions leave, with some other robots out of play."""
    game = charted(GAMES[name]())
    counts = [len(side) for side in game.bodies]
    rows = drawn(game, 0.05, 200)
    statuses = np.where(np.random.default_rng(3).random((len(rows), sum(counts))) < 0.3, RobotStatus.CAPTURED, 0)
    statuses[:, [number + role * counts[0], 0 if role == Role.EVADER else counts[0]]] = RobotStatus.ACTIVE

    def view(row, status):
        robots = {Role.PURSUER: tuple(status[: counts[0]]), Role.EVADER: tuple(status[counts[0] :])}
        state = as_state(row, jnp.asarray(0), counts[0])
        return look(game, replace(state, status=ROLES.map(robots.__getitem__)), role, number)

    views = jax.jit(jax.vmap(view))(jnp.asarray(rows), jnp.asarray(statuses))
    record = as_on_the_page(replace(game, arena=replace(game.arena, chart=None)))
    told = {"game": record, "role": role.name.lower(), "number": number, "observations": READS}
    found = ask(views=told | {"rows": rows.tolist(), "statuses": STATUSES[statuses].tolist()})
    for observation in READS:
        seen = np.asarray(jax.jit(jax.vmap(find_observation(observation)))(views))
        is_apart = np.abs(np.asarray(found["seen"][observation]) - seen).max(axis=1) > 1e-3
        assert np.mean(is_apart) <= MOST_FLIPPED, observation
    fitting = {one: policy for one, (policy, sides) in PLAYERS.items() if role in sides}
    rules = {one: rule for one, rule in fitting.items() if issubclass(rule, AbstractClassical) and rule.fits(game)}
    assert found["values"].keys() == rules.keys()
    for rule, policy in rules.items():
        values = np.asarray(jax.jit(jax.vmap(policy.for_side(game, role).values))(views))
        chosen = np.argmax(found["values"][rule], axis=1)
        loss = values.max(axis=1) - np.take_along_axis(values, chosen[:, None], axis=1)[:, 0]
        assert np.mean(loss > LEVEL) <= MOST_FLIPPED, rule
        assert len(np.unique(chosen)) > 1, rule
    backup, actions = brakes(game, role), jnp.arange(NUM_ACTIONS)
    after = jax.vmap(lambda one: jax.vmap(backup.of(one).room_after, (None, 0))(one.own.state, actions))
    rooms, theirs = (np.minimum(room, MARGIN) for room in (jax.jit(after)(views), np.asarray(found["rooms"])))
    np.testing.assert_allclose(theirs, rooms, atol=1e-4)
    assert 0 < np.mean(rooms < MARGIN) < 1


@pytest.fixture
def plain(tmp_path):
    """The file of an untrained evader with discrete actions and the paper's observation."""
    network = make_network("paper", width=16, depth=2, key=jax.random.key(5))
    save_agent(describe(network, Role.EVADER, {}, {}), tmp_path / "plain.safetensors")
    return tmp_path / "plain.safetensors"


@pytest.fixture
def smooth(tmp_path):
    """The file of an untrained pursuer with continuous actions; gears of all sizes, as its weights are large."""
    network = jax.tree.map(lambda leaf: 2 * leaf, make_actor("encoded", width=16, depth=2, key=jax.random.key(6)))
    save_agent(describe(network, Role.PURSUER, {}, {}), tmp_path / "smooth.safetensors")
    return tmp_path / "smooth.safetensors"


@pytest.mark.parametrize("name", ["smooth", slow("plain"), slow("P_pool")])
def test_networks_and_shields_choose_the_same_actions(name, request):
    path = ZOO / "P_pool.safetensors" if name == "P_pool" else request.getfixturevalue(name)
    game, role = make_game("paper"), Role[load_agent(path).header.role.upper()]
    rows = drawn(game, 0.05, 5000)
    agent, guarded = (find_player(f"{prefix}{path}", role, game).policy for prefix in ("", "shielded:"))

    @jax.jit
    def expected(row):
        view = look(game, as_state(row, jnp.asarray(0)), role)
        seen = agent.observation(view)
        own, behind_shield = (
            jnp.stack(gears(player(player.observation(view), player.memory, jnp.uint32(0))[0]))
            for player in (agent, guarded)
        )
        return seen, apply(agent.network.layers, seen), own, behind_shield

    seen, outputs, own, behind_shield = map(np.asarray, jax.vmap(expected)(jnp.asarray(rows)))
    asked = {"path": str(path), "game": to_dict(game), "role": role.name.lower()}
    answer = ask(agent=asked, observations=seen.tolist(), positions=rows.tolist())
    np.testing.assert_allclose(answer["outputs"], outputs, atol=1e-4)
    np.testing.assert_allclose(answer["gears"], own, atol=1e-5)
    np.testing.assert_allclose(answer["shielded"], behind_shield, atol=1e-5)
    assert 50 < np.any(own != behind_shield, axis=1).sum() < len(rows)


@pytest.mark.parametrize(("pursuer", "evader"), [("smooth", "still"), ("smooth", "plain"), ("still", "plain")])
def test_replays_play_again_in_the_package(pursuer, evader, request, tmp_path):
    """Where a side is continuous a replay holds the gears of both, and otherwise actions."""
    players = {"pursuer": pursuer, "evader": evader}
    paths = {side: str(request.getfixturevalue(name)) for side, name in players.items() if name != "still"}
    replay = ask(match={"game": to_dict(make_game("paper")), "seed": 3} | players | paths)["replay"]
    (tmp_path / "game.json").write_text(json.dumps(replay))
    recorded = load_replay(tmp_path / "game.json")
    assert recorded.actions.shape[1:] == ((2, 2) if pursuer == "smooth" else (2,))
    assert recorded.outcome != Outcome.ONGOING
    assert recorded.first_difference() is None


def test_a_step_that_is_judged_otherwise_is_seen():
    game = json.loads(GOLDEN[0].read_text())
    [played] = ask(games=[game | {"game": game["game"] | {"dt": 0.11}}])["games"]
    assert apart(played["rows"], game["states"]) > TOLERANCE


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
