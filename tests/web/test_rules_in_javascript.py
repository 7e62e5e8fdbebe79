"""The page's rules, players and replays are those of the package: games, observations, actions, shields."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import apply, make_actor, make_network
from apollonius.agents.pool import solo
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.agents.trained import ZOO
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_player
from apollonius.game.arena import Arena, Disc
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle, gears
from apollonius.game.game import Game, reset_batch
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Polygon
from apollonius.game.presets import PRESETS, make_game
from apollonius.game.starts import Starts
from apollonius.game.types import Outcome, Role
from apollonius.observe.registry import observe
from apollonius.observe.view import look
from apollonius.replay import as_rows, as_state, load_replay, play_actions
from apollonius.rollout import begin, step_games
from apollonius.web.site import PAGE
from tests.acting import act

GOLDEN = sorted((Path(__file__).parents[1] / "golden").glob("*.json"))
TOLERANCE = 1e-5
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


def visited(game, pursuer, evader, games, steps):
    """States that a batch of games passes through before they end, as rows of 8 numbers."""
    key = jax.random.key(7)
    words = jax.random.bits(key, (steps, 2, games), jnp.uint32)
    players = BySide(solo(pursuer.policy), solo(evader.policy))
    start = begin(reset_batch(game, key, games), players, words[0])

    def one_step(carry, words):
        games, going = carry
        after, transition = step_games(game, players, games, words)
        return (after, going & ~transition.terminated), (games.state, going)

    first = (start, jnp.ones(games, bool))
    states, going = jax.jit(lambda: jax.lax.scan(one_step, first, words)[1])()
    return as_rows(jax.tree.map(jnp.ravel, states))[np.ravel(going)]


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


@pytest.fixture(params=[*(pytest.param(name, marks=pytest.mark.slow) for name in ("P_pool", "plain")), "smooth"])
def agent_file(request):
    """A trained pursuer with the encoded observation, and the untrained agents."""
    return ZOO / "P_pool.safetensors" if request.param == "P_pool" else request.getfixturevalue(request.param)


def test_networks_and_shields_choose_the_same_actions(agent_file):
    game = make_game("paper")
    usual = visited(game, find_player("P_pool", Role.PURSUER), find_player("E_curriculum", Role.EVADER), 128, 60)[:5000]
    fast_and_close = replace(game, starts=Starts(speed="moving", clearance=0.05))
    rows = np.concatenate([usual, as_rows(reset_batch(fast_and_close, jax.random.key(8), 5000))])
    role = Role[load_agent(agent_file).header.role.upper()]
    agent, guarded = (find_player(f"{prefix}{agent_file}", role, game) for prefix in ("", "shielded:"))
    word = jnp.uint32(0)

    @jax.jit
    def expected(row):
        view = look(game, as_state(row, jnp.asarray(0)), role)
        seen = agent.policy.observation(view)
        own, behind_shield = (
            jnp.stack(gears(act(player.policy, player.policy.observation(view), word))) for player in (agent, guarded)
        )
        return seen, apply(agent.policy.network.layers, seen), own, behind_shield

    seen, outputs, own, behind_shield = map(np.asarray, jax.vmap(expected)(jnp.asarray(rows)))
    asked = {"path": str(agent_file), "game": to_dict(game), "role": role.name.lower()}
    answer = ask(agent=asked, observations=seen.tolist(), positions=rows.tolist())
    assert len(rows) == 10_000
    np.testing.assert_allclose(answer["outputs"], outputs, atol=1e-4)
    np.testing.assert_allclose(answer["observed"], seen, atol=1e-5)
    np.testing.assert_allclose(answer["gears"], own, atol=1e-5)
    np.testing.assert_allclose(answer["shielded"], behind_shield, atol=1e-5)
    held_back = np.any(own != behind_shield, axis=1)
    assert 100 < held_back.sum() < len(rows)


def any_actions(random, size):
    """Discrete actions of both sides."""
    return random.integers(9, size=(*size, 2), dtype=np.int32)


def any_gears(random, size):
    """Gears of both sides, a third of them beyond 1, where they are clipped."""
    return random.uniform(-1.5, 1.5, size=(*size, 2, 2)).astype(np.float32)


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


@pytest.mark.parametrize(
    ("arena", "draw"),
    [
        (among_polygons, any_actions),
        pytest.param(among_polygons, any_gears, marks=pytest.mark.slow),
        (on_a_floor, any_gears),
    ],
)
def test_games_among_obstacles_come_out_the_same(arena, draw):
    """Random play: states, outcomes, clearances."""
    game = Game(arena=arena(), starts=Starts(speed="moving"), evader=Unicycle(radius=0.1))
    count, steps = 80, 60
    starts = as_rows(reset_batch(game, jax.random.key(1), count))
    actions = draw(np.random.default_rng(1), (count, steps // 5)).repeat(5, axis=1)
    play = jax.jit(jax.vmap(lambda row, taken: play_actions(game, as_state(row, jnp.asarray(0)), taken)))
    states, outcomes = play(jnp.asarray(starts), jnp.asarray(actions))
    rows = np.stack([np.asarray(leaf) for leaf in jax.tree.leaves((states.pursuer, states.evader))], axis=-1)
    recorded, record = [], as_on_the_page(game)
    for index, outcome in enumerate(np.asarray(outcomes)):
        length = int(np.argmax(outcome != Outcome.ONGOING)) + 1 if outcome.any() else steps
        told = {"states": rows[index].tolist(), "actions": actions[index, :length].tolist(), "game": record}
        recorded.append((told, rows[index, : length + 1], Outcome(int(outcome[length - 1])).name.lower()))
    assert {outcome for *_, outcome in recorded} > {"pursuer_hit_obstacle", "evader_hit_obstacle"}
    agent = {"path": str(ZOO / "P_pool.safetensors"), "game": record, "role": "pursuer"}
    ends = np.stack([states[-1] for _, states, _ in recorded])
    answer = ask(games=[told for told, *_ in recorded], agent=agent, positions=ends.tolist())
    for (_, states, outcome), played in zip(recorded, answer["games"], strict=True):
        assert apart(played["rows"], states) <= TOLERANCE
        assert played["outcomes"][-1] == outcome
    see = jax.jit(jax.vmap(lambda row: observe(game, as_state(row, jnp.asarray(0)), Role.PURSUER, "encoded")))
    np.testing.assert_allclose(answer["observed"], see(jnp.asarray(ends)), atol=1e-5)


def test_gears_however_small_move_a_robot_at_its_top_speed_alike():
    """In single precision the top speed, 1.2 m/s, is more than 1.2."""
    game = make_game("paper")
    start = jnp.asarray([2.0, 5.0, 1.2, 0.4, 8.0, 5.0, 1.2, -0.4], jnp.float32)
    sizes = np.asarray([0.0, 1e-30, 1e-15, 1e-12, 1e-9, 1e-6, 1e-5, 1e-3], np.float32)
    actions = np.stack([sizes, -sizes], axis=1)[:, :, None].repeat(2, axis=2)
    states, _ = play_actions(game, as_state(start, jnp.asarray(0)), jnp.asarray(actions))
    told = {"game": to_dict(game), "states": [start.tolist()], "actions": actions.tolist()}
    assert apart(ask(games=[told])["games"][0]["rows"], as_rows(states)) <= TOLERANCE


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
