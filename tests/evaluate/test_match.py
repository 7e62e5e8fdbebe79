"""A match: counts, rates and pairing."""

import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still, Uniform
from apollonius.cli.terminal import match_table
from apollonius.evaluate import match
from apollonius.evaluate.match import Match, count, play_games, play_match, record_game
from apollonius.evaluate.result import count_robots, read_result
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.presets import make_game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.types import BySide, Outcome, RobotState
from apollonius.io.errors import InvalidInput
from apollonius.play import playout
from apollonius.play.playout import Results
from tests.acting import a_match, identical

GAMES = 200
PAPER = replace(make_game("paper"), max_steps=150)
ZERO_SUM = replace(make_game("zero-sum"), max_steps=150)


def test_one_seed_gives_one_result_however_many_games_are_under_way(monkeypatch):
    asked = a_match(PAPER, Uniform(), Uniform(), GAMES, seed=0)
    result = play_match(asked)
    for cores, slots in ((1, 17), (3, 17), (2, GAMES)):
        monkeypatch.setattr(playout, "available_cores", lambda cores=cores: range(cores))
        assert count(asked, play_games(asked, slots)) == result


def test_other_players_meet_the_same_starts(monkeypatch):
    seen = []

    def record(game, players, starts, key, **how):
        seen.append(jax.tree.map(np.asarray, starts))
        return Results(jnp.full(GAMES, Outcome.NO_RESULT), jnp.ones(GAMES, jnp.int32))

    monkeypatch.setattr(match, "play_out", record)
    for pursuer, evader, seed in [(Uniform(), Still(), 0), (Still(), Uniform(), 0), (Still(), Still(), 1)]:
        play_match(a_match(PAPER, pursuer, evader, GAMES, seed))
    first, second, other = seen
    assert identical(first, second)
    assert not np.any(first.pursuer.x == other.pursuer.x)


@pytest.mark.parametrize(
    ("game", "evader_wins"), [(PAPER, 1 + 3), (ZERO_SUM, 1 + 3 + 3)], ids=["time has no winner", "time is the evader's"]
)
def test_rates_are_those_of_the_counts(game, evader_wins):
    """Of 20 games: 5 captures, 1 and 2 crashes, 3 and 4 exits, 2 double failures, 3 out of time."""
    counts = {1: 5, 2: 1, 3: 2, 4: 3, 5: 4, 6: 2, 7: 3}
    outcome = jnp.array([kind for kind, count in counts.items() for _ in range(count)])
    steps = jnp.arange(10, 30)
    result = count(a_match(game, Still(), Still(), 20), Results(outcome, steps))
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
def test_starts_are_the_games_own_unless_others_are_asked_for(asked, speed):
    moving = replace(PAPER, starts=replace(PAPER.starts, speed="moving"))
    assert Match.of_names(moving, "still", "still", games=1, starts=asked).game.starts.speed == speed


class Charted(Still):
    """Stands still, by a chart."""

    charted = True


def test_a_match_keeps_its_game_and_plays_it_with_charts_where_players_read_them(monkeypatch):
    monkeypatch.setattr(match, "charted", lambda game, reads: replace(game, max_steps=3) if reads else game)
    asked, bare = (a_match(PAPER, player, Still(), 2) for player in (Charted(), Still()))
    assert (asked.game, asked.rules.max_steps, bare.rules) == (PAPER, 3, PAPER)


@pytest.mark.parametrize(("games", "seed", "named"), [(0, 0, "games = 0"), (-3, 0, "games = -3"), (5, -1, "seed = -1")])
def test_matches_that_cannot_be_played_are_refused(games, seed, named):
    with pytest.raises(InvalidInput, match=named):
        a_match(PAPER, Still(), Still(), games, seed)


UNLIKE = """
max_steps = 400
evaders = 2
[[pursuers]]
v_max = 1.6
u1_max = 0.3
[[pursuers]]
v_max = 0.8
radius = 0.25
"""


def test_robots_are_counted_by_their_status():
    counts = count_robots(BySide((jnp.array([0, 2, 3]), jnp.array([0, 0, 2])), (jnp.array([1, 1, 4]),)))
    assert counts == {
        "pursuers": {"active": 3, "captured": 0, "hit_obstacle": 2, "out_of_range": 1},
        "evaders": {"active": 0, "captured": 2, "hit_obstacle": 0, "out_of_range": 0, "hit_mate": 1},
    }


@pytest.mark.slow
def test_shields_hold_back_robots_of_unlike_limits_each_by_its_own(tmp_path):
    """At random robots crash, as the evaders do, who have no shield."""
    path = tmp_path / "unlike.toml"
    path.write_text(UNLIKE)
    result = play_match(Match.of_names(str(path), "shielded:random", "random", games=40))
    assert result.to_dict()["robots"]["pursuers"] == {"active": 80, "captured": 0, "hit_obstacle": 0, "out_of_range": 0}
    assert result.robots["evaders"]["hit_obstacle"] + result.robots["evaders"]["out_of_range"] > 20


def test_a_match_says_how_well_a_side_saw():
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
