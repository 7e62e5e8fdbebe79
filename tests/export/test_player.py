"""Players of all kinds in C and in the page, against the package's own; and the files of a program."""

import os
import re
import subprocess
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.built_in import PLAYERS
from apollonius.agents.classical import Uniform
from apollonius.agents.names import zoo_names
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import single_player
from apollonius.agents.trained import find_trained
from apollonius.arenas.file import find_game
from apollonius.arenas.suite import suite_arena, suite_names
from apollonius.cli.main import main
from apollonius.export import writing
from apollonius.export.parity import Cases, _is_as_good, cases_of, compare_decisions, reference, sensor_inputs
from apollonius.export.player import Player, exported_side, find_exportable
from apollonius.export.writing import check, write_c
from apollonius.game.drive import Drive, Drives
from apollonius.game.game import Game, reset_batch
from apollonius.game.movers import Movers
from apollonius.game.scenario import Scenario
from apollonius.game.types import BySide, Outcome, Role
from apollonius.game.uncertainty import Uncertainties, Uncertainty
from apollonius.game.walkers import Walkers
from apollonius.io.errors import InvalidInput, missing_extra
from apollonius.play.rollout import init_games, step_games
from jaxpr2c import CompiledProgram, translate
from tests.documents import REPOSITORY, blocks
from tests.jaxpr2c.gcc import STRICT, needs_gcc
from tests.web.test_parity import as_on_the_page, ask, needs_node

needs_onnx = pytest.mark.skipif(bool(missing_extra("export")), reason=f"needs {missing_extra('export')}")
CLASSICAL = ("pure-pursuit", "intercept", "flee", "flee-aware", "voronoi-pursuit", "encirclement", "random")
QUICK = {("shielded:P_smooth", "c"), ("shielded:P_smooth", "page")}
"""Players in `paper`."""
NEEDS = {"c": needs_gcc, "page": needs_node}
ALL = [
    pytest.param(game, shield + name, language, marks=[NEEDS[language], *([] if quick else [pytest.mark.slow])])
    for game in ("paper", "office", "team-3v1", "examples/dodecahedron.toml", "drawn")
    for name in [*zoo_names(), *CLASSICAL]
    for shield in ("", "shielded:")
    for language in ("c", "page")
    for quick in [game == "paper" and (shield + name, language) in QUICK]
]
ALL += [
    pytest.param("examples/games/office_people.toml", name, language, marks=[NEEDS[language], pytest.mark.slow])
    for name in ("shielded:intercept", "shielded:pursuer")
    for language in ("c", "page")
]
ALL += [
    pytest.param("lidar", f"shielded:{name}", "c", marks=[needs_gcc, pytest.mark.slow])
    for name in ("search", "searching:pursuer")
]
"""In a map and in many arenas too."""
DRAWN = 200


def exportable(game, name):
    side = "evader" if name.removeprefix("shielded:") == "random" else None
    return find_exportable(name, exported_side(name, side), find_game(game) if isinstance(game, str) else game)


def games_of(name):
    """The game of this name, or the paper's in many arenas of one shape."""
    if name != "drawn":
        return [find_game(name)]
    scenario = Scenario.of([suite_arena("suite-v1", one) for one in suite_names("suite-v1", "train")[:DRAWN]])
    return [replace(find_game("paper"), arena=arena) for arena in scenario.each()]


def with_wide_index(player):
    """The player, the index of its shield padded to one size for all arenas, with room for all edges."""
    edges = getattr(getattr(player.package, "backup", None), "surroundings", None)
    if edges is None:
        return player
    within, last = edges.index.within, len(edges.edges.x) - 1
    within = jnp.pad(within, [(0, 0)] * 3 + [(0, last - within.shape[-1])], constant_values=last)
    policies = player.package, player.policy
    wider = [eqx.tree_at(lambda shield: shield.backup.surroundings.index.within, one, within) for one in policies]
    return replace(player, package=wider[0], policy=wider[1])


def in_c(players, asked):
    programs = {}
    for player in players:
        shape = str(jax.tree.map(jnp.shape, (player.policy, player.game)))
        compiled = programs.get(shape) or programs.setdefault(
            shape, CompiledProgram(translate(player.decide, *player.arguments, name="robot"))
        )
        yield lambda *given: compiled(player.policy, player.game, *given)[:2]  # noqa: B023
    print(len(programs), "programs")


def on_the_page(players, asked):
    """How players decide in the page, which is asked about all cases at once."""
    if players[0].name in ("random", "shielded:random"):
        pytest.skip("the page has random numbers of its own")
    taken = ask(plays=[to_the_page(*both) for both in zip(players, asked, strict=True)])
    for player, actions in zip(players, taken, strict=True):
        kind, body = jnp.float32 if player.policy.continuous else jnp.int32, player.game.bodies[player.role][0]
        controls = np.stack(jax.vmap(body.controls)(jnp.asarray(actions, kind)), axis=1)
        answers = zip(np.array(actions), controls, strict=True)
        yield lambda *_: next(answers)  # noqa: B023


def to_the_page(player, cases):
    bare = player.name.removeprefix("shielded:")
    name = player.name if bare in PLAYERS else player.name.replace(bare, str(find_trained(bare)[1]))
    first = len(player.game.bodies[player.role]) if player.role == Role.EVADER else 0
    active = np.ones(cases.states.shape[:2], bool) if cases.active is None else cases.active
    rows, active = (np.roll(one, -first, axis=1) for one in (cases.states, active))
    movers = None
    if cases.movers is not None:  # where they go is not seen
        timed, walkers = len(player.game.movers.timed), player.game.movers.number_of_walkers
        movers = [[*one.T.tolist(), [0] * timed, *[[0] * walkers] * 3] for one in cases.movers]
    return {
        "game": as_on_the_page(replace(player.game, chart=None)),
        "movers": movers,
        "name": name,
        "role": player.role.name.lower(),
        "rows": rows.reshape(len(rows), -1).tolist(),
        "statuses": np.where(active, "active", "hit_obstacle").tolist(),
    }


LANGUAGES = {"c": in_c, "page": on_the_page}


@pytest.mark.timeout(3000)
@pytest.mark.parametrize(("game", "name", "language"), ALL)
def test_exported_players_decide_as_the_package(game, name, language):
    games, states = games_of(game), 200 if game == "paper" and (name, language) in QUICK else 10_000
    try:
        players = [exportable(one, name) for one in games]
    except InvalidInput as refusal:
        pytest.skip(str(refusal))
    players = list(map(with_wide_index, players)) if game == "drawn" else players
    asked = [cases_of(one, states // len(games), seed) for seed, one in enumerate(players)]
    three = zip(LANGUAGES[language](players, asked), players, asked, strict=True)
    found = [compare_decisions(*each) for each in three]
    total = {word: sum(getattr(one, word) for one in found) for word in ("states", "ties", "errors")}
    print(game, name, language, total, f"controls within {max(one.away for one in found):.0e}")
    assert (total["states"], total["errors"]) == (states, 0)


def beside_the_package(player):
    """What an exported pursuer does in games of the package's, what that does, and what it was given, step by step."""
    players, game, role = BySide(single_player(player.package), single_player(Uniform())), player.game, Role.PURSUER

    @jax.jit
    def played(key):
        games = init_games(game, reset_batch(game, key, 8), players, jax.random.bits(key, (2, 8), jnp.uint32))
        first = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (8, *jnp.shape(leaf))), player.memory)

        def step(carry, key):
            games, memory = carry
            bits, track = jax.random.bits(key, (2, 8), jnp.uint32), games.sides[role].track
            given = games.state if track is None else sensor_inputs(game, track, games.state, role, bits[role])
            robots = given.robots.pursuer + given.robots.evader
            states = jnp.stack([jnp.stack(jax.tree.leaves(robot), axis=-1) for robot in robots], axis=1)
            movers = given.movers and jnp.stack(jax.tree.leaves(given.movers.motion), axis=-1)
            made = jax.vmap(player.decide, in_axes=(None, None, 0, None, 0, 0, 0))(
                player.policy, game, states, None, movers, memory, bits[role]
            )
            after, moved = step_games(game, players, games, bits)
            seen = states if movers is None else jnp.concatenate([states, movers], axis=1)
            return (after, made["memory"]), (made["action"], moved.sides[role].action, seen)

        return jax.lax.scan(step, (games, first), jax.random.split(key, 60))[1]

    return map(np.asarray, played(jax.random.key(1)))


@pytest.mark.parametrize(
    ("name", "walkers"),
    [("P_curriculum", 0), pytest.param("shielded:search", 0, marks=pytest.mark.slow), ("shielded:intercept", 6)],
)
def test_exported_player_with_sensors_matches_the_package_in_a_game(name, walkers):
    """Only what is seen is given to it; its memory is what it returned last."""
    movers = Movers(walkers=(Walkers(walkers),)) if walkers else None
    made, own, states = beside_the_package(exportable(replace(find_game("lidar"), movers=movers), name))
    assert states.shape[2] == 2 + walkers
    assert ((states[:, :, 1:, 0] > 1e6).mean(axis=(0, 1)) > 0.1).all()
    assert ((states[:, :, 1:, 0] > 1e6).mean(axis=(0, 1)) < 0.9).all()
    np.testing.assert_array_equal(made, own)


@needs_gcc
@needs_node
def test_exported_shield_heeds_movers_and_brakes_for_a_broken_one():
    """One that comes is met by braking, one that rests far away by driving on. In the page none is broken."""
    player = exportable(replace(Game(), movers=Movers(walkers=(Walkers(1),))), "shielded:intercept")
    states = np.tile(np.float32([[2, 5, 1.0, 0], [8, 5, 0, 0]]), (3, 1, 1))
    movers = np.float32([[[8.0, 9, 0, 0]], [[4.5, 5, -1.3, 0]], [[np.nan, 9, 0, 0]]])
    cases = Cases(states, None, movers, player.memory, np.zeros(3, np.uint32))
    np.testing.assert_allclose(reference(player, cases)[1][:, 0], [0.3, -0.3, -0.3], atol=1e-6)
    for language, some in ((in_c, cases), (on_the_page, cases.at(slice(2)))):
        (decide,) = language([player], [some])
        assert compare_decisions(decide, player, some).errors == 0


class Swinging(AbstractPolicy):
    """Turns left while the turn rate is below 0.3 rad/s, else right."""

    def __call__(self, seen, memory, bits):
        return jnp.where(seen.own.turn_rate < 0.3, 5, 3).astype(jnp.int32), memory


def test_exported_player_with_a_drive_tracks_its_turn_rate():
    game = replace(find_game("paper"), drives=Drives(pursuer=Drive(lag=2, turn_time=0.45)))
    made, own, _ = beside_the_package(Player("swinging", Role.PURSUER, game, Swinging(), Swinging()))
    assert made[:5, 0].tolist() == [5, 5, 3, 5, 3], "0.18 rad/s by each, those on their way too"
    assert 0.2 < (made == 3).mean() < 0.8
    np.testing.assert_array_equal(made, own)


def test_player_with_other_decisions_fails_the_check(monkeypatch):
    player = exportable("paper", "shielded:P_smooth")
    cases = cases_of(player, 200)
    actions, controls = reference(player, cases)

    def tampered():
        answers = zip(actions, controls + [0.0, 0.01] * (cases.states[:, :1, 0] > 8), strict=True)
        return lambda *_: next(answers)

    parity = compare_decisions(tampered(), player, cases)
    assert (parity.states, parity.errors) == (200, int((cases.states[:, 0, 0] > 8).sum()))
    assert parity.errors > 0
    monkeypatch.setattr(writing, "cases_of", lambda *_: cases)
    with pytest.raises(InvalidInput, match=r"of 200 decisions differ from the package's"):
        check(tampered(), player, 200)


def test_action_of_equal_value_is_a_tie_unless_the_shield_forbids_it():
    states = np.zeros((2, 2, 4), np.float32)
    states[:, 0] = [[8.643525, 0.00503955, 0.84, 3.1252346], [9.1, 5.0, 1.2, 0.0]]  # beside a wall; before one
    states[:, 1] = [[1.9171979, 3.6233010, 0.21, -1.6052612], [7.0, 5.0, 0.0, 0.0]]
    cases = Cases(states, None, None, (), np.zeros(2, np.uint32))
    player = exportable("paper", "shielded:flee")
    (own, other), _ = reference(player, cases)
    equal = _is_as_good(player, cases, 0, 12 - int(own), int(own))  # 5 or 7: a step of speed or a step of turning
    assert (int(own) in (5, 7), equal) == (True, True)
    assert not _is_as_good(player, cases, 1, 7, int(other))


@pytest.mark.parametrize("name", ["shielded:P_smooth", "shielded:flee"])
def test_impossible_states_are_answered_by_braking(name):
    others = [[7, 6, broken, 1] for broken in (np.nan, np.inf, -2e6)]
    states = np.array([[[2, 3, 0.5, 0], other] for other in (*others, [2e3, 6, 0, 1])], np.float32)
    *braking, far = reference(exportable("paper", name), Cases(states, None, None, (), np.zeros(4, np.uint32)))[1]
    np.testing.assert_allclose(braking, [[-0.3, 0]] * 3, atol=1e-6)
    assert not np.allclose(far, [-0.3, 0]), "2 km away, which may be"


def test_nan_weights_are_answered_by_braking():
    player = exportable("paper", "P_smooth")
    broken = jax.tree.map(
        lambda leaf: jnp.full_like(leaf, jnp.nan) if eqx.is_inexact_array(leaf) else leaf, player.policy
    )
    cases = Cases(np.array([[[2, 3, 0.5, 0], [7, 6, 0, 1]]], np.float32), None, None, (), np.zeros(1, np.uint32))
    (sound,), (braking,) = (reference(replace(player, policy=one), cases)[1] for one in (player.policy, broken))
    assert np.isfinite(sound).all()
    np.testing.assert_allclose(braking, [-0.3, 0], atol=1e-6)
    assert not np.allclose(sound, braking)


@needs_onnx
@pytest.mark.parametrize(
    ("game", "name", "inputs"),
    [("paper", "P_smooth", ["state"]), ("paper", "random", ["state", "bits"]), ("team-3v1", "intercept", ["state"])],
)
def test_onnx_model_has_only_the_inputs_of_its_player(game, name, inputs):
    import onnxruntime

    from apollonius.export.onnx import load, model_of

    player = exportable(game, name)
    model = model_of(player)
    session, (decide, _) = onnxruntime.InferenceSession(model), load(model)
    assert [one.name for one in session.get_inputs()] == inputs
    assert compare_decisions(decide, player, cases_of(player, 20)).errors == 0


@needs_gcc
@pytest.mark.slow
def test_c_program_of_the_guide_plays_other_games_from_their_files(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "_check", lambda *_: [])
    (guide,) = (one.code for one in blocks(REPOSITORY / "docs/how-to/export.md") if one.language == "c")
    (tmp_path / "main.c").write_text(guide)
    states, sources = np.array([[2, 7, 0, 0], [8, 7, 0.5, 0]], np.float32), set()
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover"]
    for game in ("paper", "robot"):
        player = exportable(game, "E_scratch")
        write_c(player, tmp_path / "E_scratch.c", states=100)
        if not sources:
            program = ["gcc", *STRICT, "main.c", "E_scratch.c", "-lm", "-o", "clean", *sanitizers]
            subprocess.run(program, check=True, cwd=tmp_path)
        sources.add((tmp_path / "E_scratch.c").read_bytes())
        said = re.findall(
            r"-?\d[\d.]*", subprocess.check_output(["./clean"], cwd=tmp_path, text=True).replace("^2", "")
        )
        made = jax.jit(player.decide)(player.policy, player.game, states, None, None, (), np.uint32(0))
        assert [*map(float, said)] == pytest.approx([int(made["action"]), *map(float, made["controls"])], abs=1e-4)
    assert len(sources) == 1, "the program is the same, the game's file is another"


@needs_gcc
def test_export_command_writes_files_and_describes_them(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(writing, "STATES", 100)
    out = tmp_path / "chaser.c"
    assert main(["export", "intercept", "--to", "c", "--out", str(out), "--constants"]) == 0
    files = ["chaser.c", "chaser.game", "chaser.h", "chaser.robot.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == files
    said, text = capsys.readouterr().out, out.with_suffix(".h").read_text()
    assert "The pursuer intercept\nchecked in" in said
    assert "us\n" in said
    assert "The pursuer intercept of a pursuit-evasion game, 1 v 1." in text
    assert "state: x [m]" in text
    assert "chaser.game: the structs" in text
    assert "chaser_player" not in text


@pytest.mark.parametrize(
    ("out", "needle"), [("chaser.c", "gcc fails (exit status 3)"), ("main.c", "the program's name = 'main'")]
)
def test_export_command_shows_an_error_of_the_translator_in_one_line(tmp_path, capsys, monkeypatch, out, needle):
    (tmp_path / "gcc").write_text("#!/bin/sh\nexit 3\n")
    (tmp_path / "gcc").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    (tmp_path / "out").mkdir()
    assert main(["export", "intercept", "--to", "c", "--out", str(tmp_path / "out" / out)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert needle in line
    assert not [*(tmp_path / "out").iterdir()]


@pytest.mark.slow
@needs_gcc
def test_whole_games_in_c_match_the_package_without_pursuer_crashes():
    games = int(os.environ.get("GAMES", "300"))
    pursuer, evader = exportable("paper", "shielded:P_curriculum"), exportable("paper", "E_scratch")

    def play(pursuer_policy, evader_policy, game, start):
        """Return how a whole game ends, and after how many steps."""

        def step(now):
            state, _ = now
            robots = [jnp.stack(jax.tree.leaves(robot)) for robot in (state.pursuer, state.evader)]
            given = game, jnp.stack(robots), None, None, (), jnp.uint32(0)
            own = pursuer.decide(pursuer_policy, *given)["action"]
            given = game, jnp.stack(robots[::-1]), None, None, (), jnp.uint32(0)
            other = evader.decide(evader_policy, *given)["action"]
            after = game.step(state, own, other)
            return after.state, after.outcome

        state, outcome = jax.lax.while_loop(lambda now: now[1] == Outcome.ONGOING, step, (start, jnp.int32(0)))
        return {"outcome": outcome, "steps": state.steps}

    given = pursuer.policy, evader.policy, pursuer.game
    starts = jax.device_get(reset_batch(pursuer.game, jax.random.key(0), games))
    first = jax.tree.map(lambda leaf: leaf[0], starts)
    compiled = CompiledProgram(translate(play, *given, first, name="played"))
    ends = [compiled(*given, jax.tree.map(lambda leaf: leaf[place], starts)) for place in range(games)]  # noqa: B023
    outcomes = np.array([int(outcome) for outcome, _ in ends])
    crashes = {Outcome.PURSUER_HIT_OBSTACLE, Outcome.PURSUER_OUT_OF_RANGE, Outcome.BOTH_FAILED}
    assert not crashes.intersection(outcomes.tolist())
    print({Outcome(one).name: int((outcomes == one).sum()) for one in np.unique(outcomes)})
    batch = jax.jit(jax.vmap(play, in_axes=(None, None, None, 0)))
    same = np.asarray(batch(*given, jax.tree.map(lambda leaf: leaf[:50], starts))["outcome"]) == outcomes[:50]
    assert same.mean() >= 0.9  # rounding parts long games


def test_player_is_exported_with_its_own_drive_and_bounds_of_errors_alone():
    """Bounds of the delay of the other side's commands need that side's drive, which it does not know."""
    drive, errors = Drive(lag=1), Uncertainty(delay=0.1)
    game = Game(drives=Drives(drive, drive), uncertainty=Uncertainties(errors, errors))
    for role in Role:
        kept = find_exportable("shielded:intercept" if role == Role.PURSUER else "shielded:flee", role, game).game
        assert (kept.drives[role], kept.drives[role.other]) == (drive, None)
        assert (kept.uncertainty[role], kept.uncertainty[role.other]) == (errors, None)
