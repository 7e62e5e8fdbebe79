"""Matches: counts, rates and pairing; everyone meets everyone; ratings find known strengths; numbers are varied."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.special import expit

from apollonius.agents.classical import Still, Uniform
from apollonius.agents.wrappers.backup import BRAKING, BrakingMotion
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.cli.main import main
from apollonius.cli.terminal import match_table, tournament_table, varied_table
from apollonius.evaluate import match
from apollonius.evaluate.match import (
    Match,
    MatchResult,
    count_results,
    play_games,
    play_match,
    play_matches,
    record_game,
)
from apollonius.evaluate.result import count_robots, read_result
from apollonius.evaluate.statistics import wilson_interval
from apollonius.evaluate.tournament import MEAN, SCALE, fit_ratings, play_tournament
from apollonius.evaluate.vary import Variation, pad_shields, play_varied, variable_numbers, varied_matches, with_numbers
from apollonius.game.dynamics import Unicycle
from apollonius.game.outcome import counts_by_name
from apollonius.game.presets import make_game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.teams import Teams
from apollonius.game.types import BySide, Outcome, RobotState, Role
from apollonius.io.errors import InvalidInput
from apollonius.io.workers import WORKERS
from apollonius.observe.view import Robot
from apollonius.play import playout
from apollonius.show import matches as pictures
from tests.acting import a_match, identical, results_of

GAMES = 200
PAPER = replace(make_game("paper"), max_steps=150)
ZERO_SUM = replace(make_game("zero-sum"), max_steps=150)


def test_match_result_is_independent_of_cores_and_slots(monkeypatch):
    asked = a_match(PAPER, Uniform(), Uniform(), GAMES, seed=0)
    result = play_match(asked)
    for cores, slots in ((1, 17), (3, 17), (2, GAMES)):
        monkeypatch.setattr(playout, "available_cores", lambda cores=cores: range(cores))
        assert count_results(asked, play_games(asked, slots)) == result


def test_all_players_meet_the_same_starts_for_one_seed(monkeypatch):
    seen = []

    def record(game, players, starts, key, **how):
        seen.append(jax.tree.map(np.asarray, starts))
        return results_of(jnp.full(GAMES, Outcome.NO_RESULT), jnp.ones(GAMES, jnp.int32))

    monkeypatch.setattr(match, "play_out", record)
    for pursuer, evader, seed in [(Uniform(), Still(), 0), (Still(), Uniform(), 0), (Still(), Still(), 1)]:
        play_match(a_match(PAPER, pursuer, evader, GAMES, seed))
    first, second, other = seen
    assert identical(first, second)
    assert not np.any(first.pursuer.x == other.pursuer.x)


@pytest.mark.parametrize(
    ("game", "evader_wins"), [(PAPER, 1 + 3), (ZERO_SUM, 1 + 3 + 3)], ids=["time has no winner", "time is the evader's"]
)
def test_match_rates_and_means_follow_from_the_counts(game, evader_wins):
    """Of 20 games: 5 captures, 1 and 2 crashes, 3 and 4 exits, 2 double failures, 3 out of time."""
    counts = {1: 5, 2: 1, 3: 2, 4: 3, 5: 4, 6: 2, 7: 3}
    outcome = jnp.array([kind for kind, count in counts.items() for _ in range(count)])
    steps = jnp.arange(10, 30)
    result = count_results(a_match(game, Still(), Still(), 20), results_of(outcome, steps))
    assert {Outcome[name.upper()]: number for name, number in result.outcomes.items()} == counts
    assert result.pursuer_win_rate == (5 + 2 + 4) / 20
    assert result.pursuer_win_interval == wilson_interval(5 + 2 + 4, 20)
    assert result.evader_win_rate == evader_wins / 20
    assert result.evader_win_interval == wilson_interval(evader_wins, 20)
    assert result.evader_undefeated_rate == (1 + 3 + 3) / 20
    assert read_result(json.loads(json.dumps(result.to_dict())), "file") == result
    assert result.mean_steps == 19.5
    assert result.mean_capture_steps == 12


@pytest.mark.parametrize(("asked", "speed"), [(None, "moving"), ("rest", "rest")])
def test_starts_option_overrides_the_starts_of_the_game(asked, speed):
    moving = replace(PAPER, starts=replace(PAPER.starts, speed="moving"))
    assert Match.of_names(moving, "still", "still", games=1, starts=asked).game.starts.speed == speed


def test_match_adds_charts_only_for_players_that_read_them(monkeypatch):
    monkeypatch.setattr(match, "with_chart", lambda game, reads: replace(game, max_steps=3) if reads else game)
    monkeypatch.setattr(Uniform, "needs_chart", True)
    asked, bare = (a_match(PAPER, player, Still(), 2) for player in (Uniform(), Still()))
    assert (asked.game, asked.rules.max_steps, bare.rules) == (PAPER, 3, PAPER)


@pytest.mark.parametrize(("games", "seed", "named"), [(0, 0, "games = 0"), (-3, 0, "games = -3"), (5, -1, "seed = -1")])
def test_match_refuses_impossible_games_and_seeds(games, seed, named):
    with pytest.raises(InvalidInput, match=named):
        a_match(PAPER, Still(), Still(), games, seed)


def test_robots_are_counted_by_status():
    counts = count_robots(BySide((jnp.array([0, 2, 3]), jnp.array([0, 0, 2])), (jnp.array([1, 1, 4]),)))
    assert counts == {
        "pursuers": {"active": 3, "captured": 0, "hit_obstacle": 2, "out_of_range": 1},
        "evaders": {"active": 0, "captured": 2, "hit_obstacle": 0, "out_of_range": 0, "hit_mate": 1},
    }


@pytest.mark.slow
def test_shield_uses_the_limits_of_each_robot_of_a_team():
    """At random robots crash, as the evaders do, who have no shield."""
    teams = Teams((Unicycle(v_max=0.8, radius=0.25),), (Unicycle(),))
    game = replace(make_game("paper"), max_steps=400, pursuer=Unicycle(v_max=1.6, u1_max=0.3), teams=teams)
    result = play_match(Match.of_names(game, "shielded:random", "random", games=40))
    assert result.to_dict()["robots"]["pursuers"] == {"active": 80, "captured": 0, "hit_obstacle": 0, "out_of_range": 0}
    assert result.robots["evaders"]["hit_obstacle"] + result.robots["evaders"]["out_of_range"] > 20


def test_match_reports_how_often_a_side_saw_its_opponent():
    """As counted from its games: first sightings, and steps in sight of all; nothing of a side that sees everything."""
    game = replace(make_game("paper"), max_steps=60, sensors=Sensing(pursuer=Sensors(line_of_sight=True, range=4.0)))
    played = Match.of_names(game, "intercept", "random", 6, seed=2)
    result = play_match(played)
    first, total, steps = [], 0, 0
    hides = jax.jit(jax.vmap(lambda one, other: game.arena.hides(RobotState(*one), RobotState(*other))))
    for index in range(6):
        replay = record_game(played, index)
        pursuers, evaders = (replay.states[:-1, 4 * side : 4 * side + 4] for side in range(2))
        near = np.hypot(*(pursuers - evaders)[:, :2].T) <= 4.0
        unseen = hides(*(np.resize(side, (60, 4)) for side in (pursuers, evaders)))
        seen = near & ~np.asarray(unseen)[: len(near)]
        first += [int(np.argmax(seen))] if seen.any() else []
        total, steps = total + seen.sum(), steps + len(seen)
    assert 0 < len(first) < 6, "in some games it never saw it"
    assert list(result.sight) == ["pursuer"]
    sight = result.sight["pursuer"]
    assert (sight.games, sight.first_steps) == (len(first), np.median(first))
    assert sight.share == pytest.approx(total / steps)
    words = f"the pursuer sees an opponent in {len(first) / 6:.1%} of games, first after {np.median(first) / 10:.1f} s"
    assert words in match_table(played, result)
    assert read_result(json.loads(json.dumps(result.to_dict())), "here") == result
    blind = replace(game, sensors=Sensing(pursuer=Sensors(range=0.0)))
    sight = play_match(replace(played, game=blind)).sight["pursuer"]
    assert (sight.games, sight.first_steps, sight.share) == (0, None, 0.0)


@pytest.fixture
def recorded_matches(monkeypatch):
    """The matches from here on, in a list; each pursuer wins more than the one before it, against every evader."""
    matches = []

    def play(match, report):
        wins = 5 + 20 * ["random", "pure-pursuit"].index(match.players.pursuer.name) + len(match.players.evader.name)
        report(match.games, match.games)
        matches.append(match)
        return MatchResult(counts_by_name([0, wins, 0, 0, 40 - wins, 0, 0, 0, 0]), 9.0, 4.0)

    monkeypatch.setattr("apollonius.evaluate.tournament.play_matches", partial(play_matches, play=play))
    return matches


@pytest.fixture
def players():
    pursuers = [find_player(name, Role.PURSUER, PAPER) for name in ("random", "pure-pursuit")]
    return pursuers, [find_player(name, Role.EVADER, PAPER) for name in ("still", "flee")]


@pytest.fixture
def tournament(players, recorded_matches):
    return play_tournament(PAPER, BySide(*players), games=40, seed=3)


def test_tournament_plays_each_pair_on_the_same_starts(players, recorded_matches):
    reported = []
    some = BySide(players[0], players[1][:1])
    found = play_tournament(PAPER, some, 40, 3, lambda *numbers: reported.append(numbers))
    pairs = [BySide(pursuer, players[1][0]) for pursuer in players[0]]
    assert recorded_matches == [Match(PAPER, pair, 40, 3) for pair in pairs]
    assert found.win_rates.tolist() == [[10 / 40], [30 / 40]]
    assert reported == [(40, 80), (80, 80)]


def test_tournament_table_has_a_row_for_each_pursuer_and_the_means(tournament):
    lines, rates = tournament_table(tournament, "rest").splitlines(), tournament.win_rates
    cells = [line.split() for line in lines]
    assert cells[0] == ["pursuer", "\\", "evader", "still", "flee", "mean"]
    assert cells[2] == ["pure-pursuit", *[f"{rate:.1%}" for rate in (*rates[1], rates[1].mean())]]
    assert cells[3] == ["mean", *[f"{rate:.1%}" for rate in (*rates.mean(axis=0), rates.mean())]]
    intervals = [match.pursuer_win_interval for row in tournament.matches for match in row]
    assert f"within {50 * max(high - low for low, high in intervals):.1f} points" in lines[4]
    assert lines[6].startswith(f"  pursuers pure-pursuit {tournament.ratings.pursuer.points[1]:.0f} ± ")


def test_tournament_serializes_to_json_with_every_count(tournament):
    data = json.loads(json.dumps(tournament.to_dict()))
    assert [(match["pursuer"], match["evader"]) for match in data["matches"]][2] == ("pure-pursuit", "still")
    assert all(sum(match["outcomes"].values()) == 40 for match in data["matches"])
    elo = data["ratings"]["pursuers"]
    assert elo["pure-pursuit"]["low"] > elo["random"]["elo"]
    assert elo["random"]["low"] < elo["random"]["elo"] < elo["random"]["high"]


def test_tournament_refuses_an_empty_side_and_duplicate_players(players):
    pursuers, evaders = players
    with pytest.raises(InvalidInput, match="evaders = none"):
        play_tournament(PAPER, BySide(pursuers, []), games=1, seed=0)
    with pytest.raises(InvalidInput, match=r"pursuers = random, random .* each once"):
        play_tournament(PAPER, BySide(pursuers[:1] * 2, evaders), games=1, seed=0)


def test_tournament_as_jobs_gives_the_same_result_and_a_plot(tmp_path, monkeypatch, capsys):
    """Here one after the other in this process; as JSON but for players' names nothing differs."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(WORKERS, "processes", lambda jobs, logs: ((job, job.run()) for job in jobs))
    arguments = ["tournament", "--pursuers", "random", "pure-pursuit", "--evaders", "still", "--games", "3"]
    assert main([*arguments, "--json"]) == main([*arguments, "--json", "--on", "processes"]) == 0
    alone, as_jobs = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert as_jobs == alone
    assert not list(tmp_path.iterdir())
    assert main([*arguments, "--plot", "new/all.png"]) == 0
    assert Path("new/all.png").read_bytes().startswith(b"\x89PNG")
    table, said = capsys.readouterr()
    assert table.startswith("pursuer \\ evader ")
    wrote, then = said.splitlines()[-2:]
    assert wrote.startswith("wrote new/all.png (")
    assert then == "next: apollonius show pure-pursuit still --out best.gif"


def test_ratings_of_one_match_follow_from_its_odds():
    """With half a win added to either side: 75.5 of 101 games."""
    pursuer, evader = fit_ratings(np.array([[75.0]]), 100)
    assert pursuer.points[0] - evader.points[0] == pytest.approx(SCALE * np.log(75.5 / 25.5), abs=1e-3)
    assert pursuer.points[0] + evader.points[0] == pytest.approx(2 * MEAN)
    # Wald's interval of the log-odds; either player has half of the difference.
    assert 2 * pursuer.half_widths[0] == pytest.approx(1.96 * SCALE * np.sqrt(1 / 75.5 + 1 / 25.5), rel=1e-3)


def test_rating_intervals_cover_the_true_strengths():
    rng = np.random.default_rng(0)
    pursuers, evaders = rng.normal(size=6), rng.normal(size=5)
    mean = np.concatenate([pursuers, evaders]).mean()
    chance = expit(pursuers[:, None] - evaders[None, :])
    covered = []
    for _ in range(40):
        ratings = fit_ratings(rng.binomial(200, chance).astype(float), 200)
        for found, true in zip(ratings, (pursuers, evaders), strict=True):
            covered.extend(np.abs(found.points - MEAN - SCALE * (true - mean)) < found.half_widths)
    assert 0.92 < np.mean(covered) < 0.98


NAMES = BySide("pure-pursuit", "still")
SPEEDS = Variation("pursuer.v_max", (0.2, 1.2, 2.4))
RADII = Variation("arena.discs.0.radius", (0.5, 0.7))


@pytest.fixture(scope="module")
def varied_result():
    told, matches = [], varied_matches(PAPER, NAMES, (SPEEDS, RADII), 60, 3)
    made = play_varied(matches, (SPEEDS, RADII), lambda *numbers: told.append(numbers))
    assert told == sorted(told)
    assert told[-1] == (360, 360)
    return made


def test_varied_matches_equal_single_matches_and_speed_raises_wins(varied_result):
    assert varied_result.results[2] == play_match(Match.of_names(PAPER, *NAMES, 60, 3))
    slower = replace(PAPER, pursuer=replace(PAPER.pursuer, v_max=0.2))
    assert varied_result.results[0] == play_match(Match.of_names(slower, *NAMES, 60, 3))
    assert varied_result.win_rates.shape == (3, 2)
    assert varied_result.win_rates[0, 0] < varied_result.win_rates[2, 0]


def test_varied_table_and_data_give_each_result_with_its_values(varied_result):
    heading, _, header, *rows = varied_table(varied_result).splitlines()
    assert "60 games, starts: rest" in heading
    assert header.split() == ["pursuer.v_max", "\\", "arena.discs.0.radius", "0.5", "0.7"]
    low, high = varied_result.results[2].pursuer_win_interval
    shown = f"{100 * varied_result.results[2].pursuer_win_rate:.1f} [{100 * low:.0f}, {100 * high:.0f}]"
    assert rows[1].split(maxsplit=1)[0] == "1.2"
    assert rows[1].split(maxsplit=1)[1].startswith(shown)
    data = json.loads(json.dumps(varied_result.to_dict()))["matches"]
    assert [one["pursuer.v_max"] for one in data] == [speed for speed in SPEEDS.values for _ in RADII.values]
    assert [one["outcomes"] for one in data] == [one.outcomes for one in varied_result.results]


def test_plots_of_varied_matches_show_every_rate(varied_result, tmp_path, monkeypatch):
    drawn: list[Figure] = []
    save = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda self, *given, **kw: (drawn.append(self), save(self, *given, **kw)))
    pictures.draw_varied(varied_result, tmp_path / "map.png")
    one = replace(varied_result, variations=(SPEEDS,), results=varied_result.results[::2])
    pictures.draw_varied(one, tmp_path / "curve.png")
    heat, curve = (figure.axes[0] for figure in drawn)
    assert heat.collections[0].get_array().tolist() == (100 * varied_result.win_rates.T).tolist()
    assert (heat.collections[0].get_clim(), heat.collections[1].levels.tolist()) == ((0, 100), [50])
    assert curve.lines[0].get_ydata().tolist() == pytest.approx(100 * varied_result.win_rates[:, 0])
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_one_compilation_serves_all_varied_values():
    game = replace(PAPER, max_steps=20)

    def play(*variations):
        play_varied(varied_matches(game, NAMES, variations, 5), variations)

    programs = []

    def note(event, seconds, fun_name="", **about):
        programs.append(fun_name)

    jax.monitoring.register_event_duration_secs_listener(note)
    try:
        jax.clear_caches()
        play(Variation("pursuer.v_max", (1.8,)))
        assert {"jit(_advance)", "jit(_draw_block)"} <= {*programs}
        programs.clear()
        play(SPEEDS, RADII)
        play(Variation("max_steps", (10.0, 20.0)))
        assert not {"jit(_advance)", "jit(_draw_block)"} & {*programs}
    finally:
        jax.monitoring.unregister_event_duration_listener(note)


def test_with_numbers_changes_only_the_named_numbers():
    other = with_numbers(PAPER, {"evader.u2_max": 0.4, "max_steps": 70.0})
    assert other == replace(PAPER, evader=replace(PAPER.evader, u2_max=0.4), max_steps=70)
    assert variable_numbers(other) == variable_numbers(PAPER) | {"evader.u2_max": 0.4, "max_steps": 70}


def test_mates_change_with_the_first_robot_if_they_are_like_it():
    """Unless they are named themselves."""
    alike = find_game("team-3v1")
    slow = with_numbers(alike, {"pursuer.v_max": 0.5})
    assert [body.v_max for body in slow.bodies.pursuer] == [0.5, 0.5, 0.5]
    assert slow.evader == alike.evader
    one = with_numbers(alike, {"pursuer.v_max": 0.5, "teams.pursuers.0.v_max": 0.7})
    assert [body.v_max for body in one.bodies.pursuer] == [0.5, 0.7, 0.5]
    assert [body.v_max for body in with_numbers(one, {"pursuer.v_max": 0.9}).bodies.pursuer] == [0.9, 0.7, 0.9]


@pytest.mark.parametrize(
    ("numbers", "named"),
    [
        ({"pursuer.vmax": 1.0}, r"no number 'pursuer\.vmax'; did you mean 'pursuer\.v_max'\?"),
        ({"pursuer.v_max": float("nan")}, r"pursuer\.v_max = nan"),
        ({"pursuer.u2_max": 24.0}, r"with pursuer\.u2_max = 24: pursuer\.u2_max = 24"),
        ({"max_steps": 10.5}, r"max_steps = 10\.5"),
        ({"capture_distance": 2.0}, r"with capture_distance = 2: starts\.separation"),
    ],
)
def test_with_numbers_refuses_unknown_and_impossible_numbers(numbers, named):
    with pytest.raises(InvalidInput, match=named):
        with_numbers(PAPER, numbers)


def test_starts_that_a_shield_promises_nothing_from_are_counted_and_hold_all_its_failures():
    match = Match.of_names("paper", "shielded:intercept", "still", 300, starts="moving")
    result = play_match(match)
    failures = result.outcomes["pursuer_hit_obstacle"] + result.outcomes["pursuer_out_of_range"]
    assert 0 < failures <= result.unpromised["pursuer"] < 30
    assert read_result(result.to_dict(), "a test") == result
    at_rest = replace(match, game=make_game("paper"), games=20)
    assert "unpromised" not in play_match(at_rest).to_dict()


def test_pad_shields_gives_one_structure_and_keeps_the_clearances():
    games = [replace(find_game("suite-v1/blocks-00"), pursuer=Unicycle(v_max=v_max)) for v_max in (0.6, 1.8)]
    before = [find_player("shielded:random", Role.PURSUER, game).policy for game in games]
    after = pad_shields(before)
    shapes = [jax.tree.map(jnp.shape, policy) for policy in after]
    assert jax.tree.structure(after[0]) == jax.tree.structure(after[1])
    assert [policy.backup.steps for policy in after] == [before[1].backup.steps] * 2  # from 1.8 m/s it takes longest
    assert before[0].backup.steps < before[1].backup.steps
    assert shapes[0] == shapes[1] != jax.tree.map(jnp.shape, before[0])
    places = np.random.default_rng(0).uniform((1, 1, -3), (9, 9, 3), (200, 3)).astype(np.float32).T

    def clearances(backup, body, x, y, heading):
        motion = BrakingMotion(RobotState(x, y, jnp.float32(0.6), heading), None)
        return backup._clearances(Robot(body, motion.state), motion)

    measured = jax.jit(jax.vmap(clearances, in_axes=(None, None, 0, 0, 0)))
    for game, old, new in zip(games, before, after, strict=True):
        expected = np.asarray(measured(old.backup, game.pursuer, *places))
        assert expected.shape == (200, len(BRAKING))
        np.testing.assert_allclose(measured(new.backup, game.pursuer, *places), expected, atol=1e-5)
