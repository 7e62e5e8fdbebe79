"""The page's modules in Node: what it runs does what the package does, and what is drawn on it is the package's."""

import functools
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.built_in import BY_CHART, PLAYERS
from apollonius.agents.classical import AbstractClassical
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.store import describe, save_agent
from apollonius.agents.trained import ZOO
from apollonius.agents.wrappers.backup import MARGIN, brakes
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game, from_dict, game_names, load_game, to_dict
from apollonius.benchmark.scenarios import FOLDER, NAMES, load_scenario
from apollonius.game.arena import Arena, Disc
from apollonius.game.chart import COARSE
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.models import MODELS
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Polygon
from apollonius.game.presets import PRESETS, make_game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams
from apollonius.game.types import NUM_ACTIONS, ROLES, Outcome, RobotStatus, Role
from apollonius.io.errors import InvalidInput
from apollonius.observe import tracking
from apollonius.observe.registry import find_observation
from apollonius.observe.view import look
from apollonius.play.replay import as_rows, as_state, load_replay, play_actions
from apollonius.web.site import DOORS, PAGE, READS, SHUTTLES, WALKERS
from tests.web.test_server import publish_site

PEOPLE = Path(__file__).parents[2] / "examples/games/office_people.toml"
GOLDEN = sorted((Path(__file__).parents[1] / "golden").glob("*.json"))
TOLERANCE = 1e-5
LEVEL = 1e-3
"""Values of actions that differ by no more are as good as equal."""
MOST_FLIPPED = 0.02
"""Share of states at an edge, where the last bit decides what is seen or done."""
STATUSES = np.asarray([status.name.lower() for status in RobotStatus])
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="needs node: install Node.js")
pytestmark = needs_node


LIMITED = {"lidar", "blind"}
"""Games of robots that do not see everything, which the page does not have."""


def ask(**questions):
    """Return the answers of the page's modules; of one question the answer itself."""
    program = ["node", str(Path(__file__).with_name("check.mjs"))]
    given = json.dumps({"page": str(PAGE)} | questions, default=lambda number: np.asarray(number).tolist())
    done = subprocess.run(program, input=given, capture_output=True, text=True, check=True, timeout=500)
    answers = json.loads(done.stdout)
    return answers if len(questions) > 1 else answers[next(iter(questions))]


def apart(rows, others):
    """Largest difference of states; headings differ by at most half a turn."""
    away = np.abs(np.asarray(rows) - np.asarray(others))
    away[:, 3::4] = np.minimum(away[:, 3::4], 2 * np.pi - away[:, 3::4])
    return away.max()


def test_golden_games_replay_the_same_on_the_page():
    """They have every outcome and every preset; a step that is judged by another rule would be seen.

    When the law of movers changes: `python -m tests.golden.record movers`, then `make page`.
    """
    records, replays = [json.loads(path.read_text()) for path in GOLDEN], [load_replay(path) for path in GOLDEN]
    assert {replay.outcome for replay in replays} == set(Outcome) - {Outcome.ONGOING}
    assert {path.stem.rsplit("-", 1)[0] for path in GOLDEN} == {*PRESETS, *MODELS, "movers"} - LIMITED - {"unicycle"}
    wrong = records[0] | {"game": records[0]["game"] | {"dt": 0.11}}
    *played, other = ask(games=[*records, wrong])
    for replay, game in zip(replays, played, strict=True):
        assert apart(game["rows"], replay.states) <= TOLERANCE
        if replay.movers is not None:
            places = np.swapaxes(replay.mover_places(), 1, 2)
            assert np.abs(np.array(game["moved"]) - places).max() <= 1e-4
        assert game["outcomes"][-1] == replay.outcome.name.lower()
        assert set(game["outcomes"][:-1]) <= {"ongoing"}
    assert apart(other["rows"], replays[0].states) > TOLERANCE


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
    record, occupancy = to_dict(game), game.arena.map
    if occupancy:
        rows, columns = occupancy.field.shape
        place = {name: getattr(occupancy, name) for name in ("x", "y", "cell")}
        field = np.asarray(occupancy.field).ravel().tolist()
        record["arena"]["map"] = place | {"rows": rows, "columns": columns, "field": field}
    return record


def crowd(arena):
    """Two pursuers of different kinds and two evaders, some of whose bodies are wide."""
    teams = Teams((Unicycle(v_max=1.8, u1_max=0.9, radius=0.25),), (Unicycle(v_max=1.0, radius=0.15),))
    return Game(arena=arena, capture_distance=0.6, teams=teams)


GAMES = {
    "territory": lambda: make_game("territory"),
    "map": lambda: Game(Unicycle(), Unicycle(v_max=1.0, radius=0.1), on_a_floor(), starts=Starts(speed="moving")),
    "crowd": lambda: crowd(among_polygons()),
    "crowd on a floor": lambda: crowd(on_a_floor()),
    "team-3v2/office": lambda: find_game("team-3v2/office"),
}


def any_actions(random, size):
    return random.integers(9, size=size, dtype=np.int32)


def any_levels(random, size):
    """Levels of some robots, a third of them beyond 1, where they are clipped."""
    return random.uniform(-1.5, 1.5, size=(*size, 2)).astype(np.float32)


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


@functools.cache
def draw_states(name, count=200):
    """A game, and robots of any speed in it that touch no obstacle, though some are close to one or to each other."""
    game, random = GAMES[name](), np.random.default_rng(1)
    arena, fastest = game.arena, [body.v_max for side in game.bodies for body in side]
    robots = [([arena.x_min, arena.y_min, 0, -np.pi], [arena.x_max, arena.y_max, v, np.pi]) for v in fastest]
    rows = random.uniform(*np.swapaxes(robots, 0, 1), (30 * count, len(robots), 4)).astype(np.float32)
    room = jax.jit(jax.vmap(jax.vmap(arena.clearance)))(*jnp.asarray(rows[..., :2].transpose(2, 0, 1)))
    return game, rows[(np.asarray(room) > 0.3).all(axis=1)][:count].reshape(count, -1)


@pytest.mark.parametrize(("name", "draw"), [("crowd", any_actions), ("map", any_levels), slow("crowd", any_levels)])
def test_random_games_are_the_same_on_the_page(name, draw):
    """Random play: states, the status of every robot after every step, outcomes."""
    (game, rows), count, steps, held = draw_states(name), 80, 45, 5
    pursuers, robots, rows = len(game.bodies.pursuer), sum(map(len, game.bodies)), rows[:count]
    actions = draw(np.random.default_rng(1), (count, steps // held, robots)).repeat(held, axis=1)
    play = jax.jit(jax.vmap(lambda row, taken: play_actions(game, as_state(row, jnp.asarray(0), pursuers), taken)))
    states, outcomes = play(jnp.asarray(rows), jnp.asarray(actions))
    outcomes = np.asarray(outcomes)
    expected = np.stack([np.asarray(leaf) for leaf in jax.tree.leaves(states.robots)], axis=-1)
    lengths = [int(np.argmax(over)) + 1 if over.any() else steps for over in outcomes != Outcome.ONGOING]
    record = as_on_the_page(game)
    told = [
        {"game": record, "states": [row.tolist()], "actions": taken[:length].tolist()}
        for row, taken, length in zip(rows, actions, lengths, strict=True)
    ]
    for index, (played, length) in enumerate(zip(ask(games=told), lengths, strict=True)):
        assert apart(played["rows"], expected[index, : length + 1]) <= TOLERANCE
        assert played["outcomes"] == [Outcome(int(one)).name.lower() for one in outcomes[index, :length]]
        statuses = np.stack([np.asarray(leaf[index]) for leaf in jax.tree.leaves(states.status)], axis=-1)
        assert played["statuses"] == STATUSES[statuses[1 : length + 1]].tolist()
    assert len({int(outcome[length - 1]) for outcome, length in zip(outcomes, lengths, strict=True)}) > 2


@pytest.mark.parametrize(
    ("name", "role", "number"),
    [
        slow("crowd", Role.PURSUER, 1),
        slow("map", Role.PURSUER, 0),
        slow("territory", Role.EVADER, 0),
        slow("crowd", Role.EVADER, 1),
        slow("crowd on a floor", Role.PURSUER, 0),
        slow("team-3v2/office", Role.PURSUER, 2),
    ],
)
def test_observations_rules_and_clearances_are_the_same_on_the_page(name, role, number):
    """All observations, all rules, and the room that all actions leave, with some other robots out of play."""
    game, rows = draw_states(name)
    game, counts = with_chart(game), [len(side) for side in game.bodies]
    statuses = np.where(np.random.default_rng(3).random((len(rows), sum(counts))) < 0.3, RobotStatus.CAPTURED, 0)
    statuses[:, [number + role * counts[0], 0 if role == Role.EVADER else counts[0]]] = RobotStatus.ACTIVE

    def view(row, status):
        robots = {Role.PURSUER: tuple(status[: counts[0]]), Role.EVADER: tuple(status[counts[0] :])}
        state = as_state(row, jnp.asarray(0), counts[0])
        return look(game, replace(state, status=ROLES.map(robots.__getitem__)), role, number)

    views = jax.jit(jax.vmap(view))(jnp.asarray(rows), jnp.asarray(statuses))
    record = as_on_the_page(replace(game, chart=None))
    told = {"game": record, "role": role.name.lower(), "number": number, "observations": READS}
    found = ask(views=told | {"rows": rows.tolist(), "statuses": STATUSES[statuses].tolist()})
    fitting = {one: policy for one, (policy, sides) in PLAYERS.items() if role in sides}
    rules = {one: rule for one, rule in fitting.items() if issubclass(rule, AbstractClassical) and rule.fits(game)}
    rules = {one: rule for one, rule in rules.items() if one not in BY_CHART}
    assert found["values"].keys() == rules.keys()
    backup, actions = brakes(game, role), jnp.arange(NUM_ACTIONS)

    @jax.jit
    @jax.vmap
    def expected(one):
        seen = {name: find_observation(name)(one) for name in READS}
        values = {rule: policy.for_side(game, role).values(one) for rule, policy in rules.items()}
        return seen, values, jax.vmap(backup.for_view(one).clearance_after, (None, 0))(one.own, actions)

    all_seen, all_values, clearances = jax.tree.map(np.asarray, expected(views))
    for observation, seen in all_seen.items():
        is_apart = np.abs(np.asarray(found["seen"][observation]) - seen).max(axis=1) > 1e-3
        assert np.mean(is_apart) <= MOST_FLIPPED, observation
    for rule, values in all_values.items():
        chosen = np.argmax(found["values"][rule], axis=1)
        loss = values.max(axis=1) - np.take_along_axis(values, chosen[:, None], axis=1)[:, 0]
        assert np.mean(loss > LEVEL) <= MOST_FLIPPED, rule
        assert len(np.unique(chosen)) > 1, rule
    clearances, theirs = (np.minimum(room, MARGIN) for room in (clearances, np.asarray(found["clearances"])))
    np.testing.assert_allclose(theirs, clearances, atol=1e-4)
    assert 0 < np.mean(clearances < MARGIN) < 1


@pytest.mark.slow
def test_knowledge_in_fog_matches_the_package_and_a_blind_pursuer_searches():
    """Either side has only its line of sight, and its robot goes straight."""
    sees = Sensors(line_of_sight=True)
    game = with_chart(replace(find_game("office"), sensors=Sensing(sees, sees)))
    rows = np.linspace((7, 1, 0.4, 0, 6, 5, 0.8, 0), (11, 1, 0.4, 0, 14, 5, 0.8, 0), 100, dtype=np.float32)
    states = jax.jit(jax.vmap(as_state))(jnp.asarray(rows), jnp.arange(100))
    record = to_dict(replace(game, chart=None, sensors=None))
    asked = {"game": record, "rows": as_rows(states).tolist()}
    answers = ask(knowledge=asked, searches=asked)

    @functools.partial(jax.jit, static_argnums=0)
    def followed(role, states):
        """Return the age and the place of a side's last sighting, and its belief, at each of the states."""

        def follow(track, state):
            track, _ = tracking.sense_and_update(game, role, track, state, jnp.uint32(0))
            return track, (track.ages[0], track.opponents[0], track.belief.travel_budget)

        return jax.lax.scan(
            follow, tracking.init_track(game, jax.tree.map(lambda leaf: leaf[0], states), role), states
        )[1]

    for role in Role:
        found, (ages, last, credit) = answers["knowledge"][role.name.lower()], followed(role, states)
        np.testing.assert_allclose([one["age"] for one in found], ages, rtol=1e-5)
        np.testing.assert_allclose([one["last"] for one in found], np.stack([last.x, last.y], 1), atol=1e-4)
        assert len(set(np.asarray(ages) == 0)) == 2, "the other side is in sight at times"
        can_be = np.asarray(credit).reshape(len(credit), -1) >= 0
        for one, cells in zip(found, can_be, strict=True):
            assert len(set(one["cells"]) ^ set(np.flatnonzero(cells))) <= 2
        assert can_be.any(axis=1).all()
        assert not can_be.all(axis=1).any()
    arena, recent = game.arena, [one["age"] <= 1.05 for one in answers["knowledge"]["pursuer"]]
    cell = max(arena.x_max - arena.x_min, arena.y_max - arena.y_min) / COARSE
    for known, (x, y, v), lately in zip(answers["knowledge"]["pursuer"], answers["searches"], recent, strict=True):
        column, row = int((x - arena.x_min) / cell), int((y - arena.y_min) / cell)
        assert [x, y] == known["last"] if lately else (v == 0 and row * COARSE + column in known["cells"])
    assert len(set(recent)) == 2


def test_page_replays_play_again_in_the_package(tmp_path):
    """Where a side is continuous a replay holds the levels of both, of all sizes, as the weights are large."""
    smooth = jax.tree.map(lambda leaf: 2 * leaf, make_actor("encoded", width=16, depth=2, key=jax.random.key(6)))
    networks = {Role.PURSUER: smooth, Role.EVADER: make_network("paper", width=16, depth=2, key=jax.random.key(5))}
    files = {role.name.lower(): str(tmp_path / f"{role}.safetensors") for role in networks}
    for (role, network), file in zip(networks.items(), files.values(), strict=True):
        save_agent(describe(network, role, {}, {}), Path(file))
    sides = {role: {"name": file} for role, file in files.items()}
    replay = ask(match={"game": to_dict(make_game("paper")), "seed": 3} | sides)
    (tmp_path / "game.json").write_text(json.dumps(replay))
    recorded = load_replay(tmp_path / "game.json")
    assert recorded.actions.shape[1:] == (2, 2)
    assert recorded.outcome != Outcome.ONGOING
    assert recorded.first_difference() is None


def test_delayed_view_shows_the_past_of_the_other_side_only():
    assert ask(sights=True) == [[10, 0, "at 0"], [11, 0, "at 1"], [12, 1, "at 2"]], (
        "who is out of play is known at once"
    )


@pytest.mark.parametrize(
    ("me", "own", "theirs", "stand", "finds"),
    [
        ("evader", "forwards", {"name": "shielded:pure-pursuit"}, "flee", True),
        ("evader", "still", {"name": "shielded:pure-pursuit", "late": 1}, "still", False),
        ("pursuer", "still", {"name": "still"}, "pure-pursuit", True),
    ],
)
def test_hindsight_finds_the_last_way_out(me, own, theirs, stand, finds):
    game = make_game("paper") if finds else Game(arena=Arena(x_max=2.2, y_max=2.2))
    rules = to_dict(game) | ({"max_steps": 150} if me == "pursuer" else {})
    sides = {me: {"name": own}, "pursuer" if me == "evader" else "evader": theirs}
    match = {"game": rules, "seed": 1, "me": me, "count": 8, "stand": {"name": f"shielded:{stand}"}} | sides
    lost = ask(hindsight=match)
    assert lost
    for game in lost:
        assert game["better"] == ([] if game["found"] is None else [game["found"]])
    assert any(game["found"] is not None for game in lost) == finds
    steered = [game for game in lost if game["found"] is not None and not game["alone"]]
    assert bool(steered) == (stand == "flee"), "an evader is saved by an action that it does not choose"


def test_page_survey_reports_a_passage_too_narrow_for_a_robot():
    walls = [[[2, 0], [2.2, 0], [2.2, 2.6], [2, 2.6]], [[2, 3.4], [2.2, 3.4], [2.2, 6], [2, 6]]]
    arena = {"x_max": 8, "y_max": 6, "polygons": [{"vertices": wall} for wall in walls]}
    wide, narrow = ask(survey=[json.dumps({"arena": arena, "pursuer": {"radius": one}}) for one in (0.45, 0.2)])
    assert wide.startswith("the free space falls into 2 parts, and a robot never leaves the one it starts in")
    assert narrow is None


def test_page_reads_games_as_the_package_does():
    names = [name for name in game_names() if not name.startswith("team") and name not in LIMITED]
    texts = [json.dumps(to_dict(find_game(name))) for name in [*names, str(PEOPLE)]]
    ring = {"arena": {"polygons": [{"vertices": [[1, 1], [2, 2], [2, 1], [1, 1]]}]}}
    assert [read.get("answer") for read in ask(read=texts)] == [*map(json.loads, texts)]
    (closed,) = ask(read=[json.dumps(ring)])
    assert closed["answer"] == json.loads(json.dumps(to_dict(from_dict(Game, ring, "a ring"))))


def test_page_refuses_more_movers_than_it_has_room_for():
    most = {"shuttles": SHUTTLES, "doors": DOORS, "walkers": WALKERS}
    mover = {
        "shuttles": [{"waypoints": [[1, 1], [5, 1]]}],
        "doors": [{"x": 5, "y": 5, "hx": 0.5, "hy": 0}],
        "walkers": [{"count": 1}],
    }
    for extra in (0, 1):
        tables = [{kind: mover[kind] * (count + extra)} for kind, count in most.items()]
        answers = ask(read=[json.dumps({"movers": table}) for table in tables])
        for (kind, count), answer in zip(most.items(), answers, strict=True):
            said = f"movers.{kind} = {count + 1} of them is not possible: it must be at most {count} in the page"
            assert answer.get("complaint") == (said if extra else None)


def test_page_replays_with_movers_play_again_in_the_package(tmp_path):
    """The movers of the page's start are as far from robots and walls as those of the package's."""
    game = replace(find_game(str(PEOPLE)), max_steps=200)
    replay = ask(
        match={"game": to_dict(game), "seed": 3, "pursuer": {"name": "shielded:intercept"}, "evader": {"name": "still"}}
    )
    (tmp_path / "game.json").write_text(json.dumps(replay))
    recorded = load_replay(tmp_path / "game.json")
    assert recorded.first_difference() is None
    places, bodies = recorded.mover_places(), game.movers.bodies
    walkers = places[0, len(game.movers.timed) :]
    room = jax.vmap(game.arena.clearance)(*jnp.asarray(walkers.T))
    assert (np.asarray(room) > 0.25).all()
    apart = np.hypot(*(walkers[:, None] - recorded.states[0].reshape(2, 4)[None, :, :2]).T)
    assert (apart > game.starts.clearance + 0.45).all()
    assert len(np.unique(recorded.movers.bits)) == 10
    speed = np.hypot(*np.diff(places, axis=0).T) / game.dt
    assert (speed.max(axis=1) > 0.3).all()
    assert (speed.max(axis=1) < np.asarray(bodies.v_max) + 1e-3).all()


def test_page_fills_in_robots_of_all_kinds_as_the_package_does():
    texts = [json.dumps({"pursuer": {"model": name, "radius": 0.2}}) for name in MODELS]
    games = [from_dict(Game, json.loads(text), "a robot") for text in texts]
    expected = [{"model": name} | to_dict(game)["pursuer"] for name, game in zip(MODELS, games, strict=True)]
    assert [read["answer"]["pursuer"] for read in ask(read=texts)] == expected


REFUSED = [
    ('{"pursuer": {"model": "bike"}}', "pursuer.model = bike"),
    ('{"pursuer": {"wheelbase": 0.3}}', "pursuer: unknown key 'wheelbase'"),
    ('{"pursuer": {"model": "car", "track": 0.3}}', "pursuer: unknown key 'track'"),
    ('{"pursuer": {"model": "car", "wheelbase": 0}}', "pursuer.wheelbase = 0"),
    ('{"pursuer": {"model": "car", "u2_max": 1.6}}', "pursuer.u2_max = 1.6"),
    ('{"pursuer": {"model": "car", "u2_max": 1.5, "wheelbase": 0.05}}', "pursuer.u2_max = 1.5"),
    ('{"evader": {"model": "wheels", "track": 0}}', "evader.track = 0"),
    ('{"evader": {"model": "wheels", "v_max": 1.3}}', "evader.v_max = 1.3"),
    ('{"evader": {"model": "wheels", "v_min": -1.3}}', "evader.v_min = -1.3"),
    ('{"evader": {"model": "omni", "lateral_acceleration": 0}}', "evader.lateral_acceleration = 0"),
    ('{"arena": 3}', "arena = 3"),
    ('{"arena": {"colour": "red"}}', "arena: unknown key 'colour'"),
    ('{"arena": {"discs": [{"x": 1, "y": 2}]}}', "arena.discs[0].radius = null"),
    ('{"arena": {"discs": [{"x": 1, "y": 2, "radius": 0}]}}', "arena.discs[0].radius = 0"),
    ('{"arena": {"discs": [{"x": 11, "y": 2, "radius": 1}]}}', "arena.discs[0] centre = [11,2]"),
    ('{"arena": {"polygons": [{"vertices": [[1, 1], [2, 2], [2, 1], [1, 2]]}]}}', "arena.polygons[0].vertices"),
    ('{"max_steps": 1.5}', "max_steps = 1.5"),
    ('{"capture_distance": NaN}', "NaN"),
    ('{"capture_distance": 2}', "starts.separation = 1"),
    ('{"pursuer": {"u2_max": 30}}', "pursuer.u2_max = 30"),
    ('{"starts": {"speed": "fast"}}', "starts.speed = fast"),
    ('{"starts": {"clearance": 9}}', "no place to start"),
    ('{"reward": {"profile": "__proto__"}}', "reward.profile = __proto__"),
    ('{"__proto__": {}}', "'__proto__'"),
    ('{"arena": ', "JSON"),
    ('"arena\nof two lines', "JSON"),
    ('{"arena": {"map": {"file": "floor.yaml", "sha256": "0"}}}', "on the map floor.yaml: apollonius play"),
    ('{"pursuers": 3}', "chosen under Games"),
    ('{"movers": {}}', "movers = empty"),
    ('{"movers": {"lifts": []}}', "movers: unknown key 'lifts'"),
    ('{"movers": {"walkers": [{"count": 0}]}}', "movers.walkers[0].count = 0"),
    ('{"movers": {"walkers": [{"a_max": 0}]}}', "movers.walkers[0].a_max = 0"),
    ('{"movers": {"walkers": [{"radius": 5}]}}', "the walkers no place"),
    ('{"movers": {"shuttles": [{"waypoints": [[1, 1]]}]}}', "movers.shuttles[0].waypoints"),
    ('{"movers": {"shuttles": [{"waypoints": [[1, 1], [11, 1]]}]}}', "movers.shuttles[0].waypoints"),
    ('{"movers": {"shuttles": [{"waypoints": [[1, 1], [1, 1]]}]}}', "movers.shuttles[0].waypoints"),
    ('{"movers": {"shuttles": [{"waypoints": [[1, 1], [2, 1]], "pause": -1}]}}', "movers.shuttles[0].pause = -1"),
    ('{"movers": {"doors": [{"x": 5, "y": 5, "hx": 0.5}]}}', "movers.doors[0].hy = null"),
    ('{"movers": {"doors": [{"x": 5, "y": 5, "hx": 0, "hy": 0}]}}', "movers.doors[0].hx, hy"),
    ('{"movers": {"doors": [{"x": 15, "y": 5, "hx": 0.5, "hy": 0}]}}', "movers.doors[0] centre"),
    ('{"movers": {"doors": [{"x": 5, "y": 5, "hx": 0.5, "hy": 0, "share_open": 1}]}}', "share_open = 1"),
    (
        '{"movers": {"doors": [{"x": 5, "y": 5, "hx": 0.5, "hy": 0, "period": 5}]}}',
        "period = 5 is not possible: it must be at least 6.00 s",
    ),
]
"""What neither the package nor the page reads, and words of the page's complaint."""


def test_page_refuses_what_the_package_refuses(tmp_path):
    for (text, said), answer in zip(REFUSED, ask(read=[text for text, _ in REFUSED]), strict=True):
        if "Games" not in said:
            (tmp_path / "bad.json").write_text(text)
            with pytest.raises(InvalidInput):
                load_game(tmp_path / "bad.json")
        assert said in answer["complaint"]
        assert "\n" not in answer["complaint"]
        assert len(answer["complaint"]) < 300


def test_links_restore_games_and_damaged_ones_are_refused():
    damaged = ["#game=*", "#game=_w", f"#game={'e' * 200_000}", "#other"]
    movers = {"shuttles": [{"waypoints": [[1, 1], [5, 1], [5, 3]]}], "walkers": [{"count": 2}, {"v_max": 0.8}]}
    found = ask(links=damaged, shared=[[1, 1, False], [3, 2, False], [1, 1, True], [2, 1, False, movers]])
    said = [answer.get("complaint") for answer in found["links"]]
    assert said == [*["it is damaged; copy the whole link"] * 2, "it is too long", None]
    for played, again in found["shared"]:
        assert played == again
    assert all(state["movers"] for state in played[0])


def test_edited_shapes_stay_valid():
    moves = ask(moves=1)
    assert moves["nothing"], "a block without a width is no change"
    assert moves["steep"] == [[3.1, 1], [3.1, 4], [2.9, 4], [2.9, 1]]
    assert moves["far"] == [[4, 0], [9, 0], [9, 0.2], [4, 0.2]]
    assert moves["small"] == 0
    assert len({x for x, _ in moves["crossed"]}) == 2


def test_first_levels_can_be_won_and_lost_as_intended():
    paper = to_dict(make_game("paper"))
    floor = paper | {"arena": paper["arena"] | {"discs": []}}
    red, blue = (str(ZOO / f"{one}.safetensors") for one in ("pursuer", "evader"))
    games = [
        (1, floor, "flees", red),
        (2, paper, "flees", red),
        (2, paper, "flee-aware", red),
        (4, paper, "chases", "flee-aware"),
        (4, paper, "intercept", "flee-aware"),
        (15, to_dict(find_game("office")), blue, red),
        (15, to_dict(find_game("office")), "stands", red),
    ]
    asked = [{"number": number, "game": game, "bot": bot, "against": one} for number, game, bot, one in games]
    first, fled, aware, chased, aimed, weaved, rushed = ask(levels=asked)
    assert first == ["no_result", 20], "who drives away from red wins the first level"
    assert aware == ["no_result", 40]
    assert fled[0] == "captured", "and in the second one is caught, but no wall is in the way"
    assert fled[1] > 10
    assert chased[1] > 15, "who only chases blue has its shields first"
    assert aimed[0] == "captured", "who aims ahead and brakes wins"
    assert weaved == ["no_result", 60], "among people blue's own agent gets away"
    assert rushed[0] == "captured"


def test_walls_join_without_slits():
    moves = ask(moves=1)
    assert moves["joined"] == [[0, 3], [10, 6.9], [4, 4.1], [5, 5]]
    assert moves["corner"] == [[8.1, 3.9], [8.1, 7], [7.9, 7], [7.9, 3.9]]


def test_scenarios_are_levels_that_are_won_by_their_lines(tmp_path):
    """On the page their games and starts are the package's, and who only brakes to the left loses."""
    scenarios = [load_scenario(FOLDER / f"{name}.json") for name in NAMES]
    nothing = {scenario.name: [{"hold": 99, "line": [[0]] * len(scenario.line)}] for scenario in scenarios}
    agents = {side: str(ZOO / f"{side}.safetensors") for side in ("pursuer", "evader")}
    levels = ask(scenarios={"scenarios": publish_site(tmp_path)["scenarios"], "plays": nothing, "opponents": agents})
    for number, (scenario, level) in enumerate(zip(scenarios, levels, strict=True), 16):
        assert level["level"]["number"] == number
        assert level["level"]["task"] == scenario.task
        assert from_dict(Game, level["played"], scenario.name).packed() == scenario.game
        robots = [*level["start"]["pursuer"], *level["start"]["evader"]]
        row = [robot[key] for robot in robots for key in ("x", "y", "v", "heading")]
        np.testing.assert_allclose(row, jax.tree.leaves(scenario.start.robots), rtol=1e-6)
        assert level["winners"] == [scenario.side, scenario.role.other.name.lower()]
