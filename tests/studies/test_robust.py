"""Training with disturbed robots: who meets whom, what of the gap is closed, and matches that are kept."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from apollonius.catalogue import find_player
from apollonius.errors import InvalidInput
from apollonius.evaluate.match import Match
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import create_run, load_config
from apollonius.simulate.comparison import Comparison, Difference, Error
from studies.robust import Robust, gap_table, kept_comparison, outcomes, seeds_of, tracking
from tests.studies.matches import NO_MATCH

EXAMPLE = Path(__file__).parents[2] / "examples" / "robust.toml"
PURSUERS, EVADERS = ["P", "P_stranger"], ["E", "E_stranger"]


def cells_of(table):
    """The rows of a Markdown table, cell by cell."""
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]


def match(rules, bodies, captured=10):
    """A match of 100 games in which both sides fail in some by the rules, and in some with bodies."""
    error = {"speed": Error(0.01, 0.0), "heading": Error(bodies, 0.0), "position": Error(0.002, 0.0)}
    return Comparison(
        rules=ended(captured, 0.5),
        bodies=ended(captured + 20, 0.75),
        differences=dict.fromkeys(("pursuer fails", "evader fails"), Difference(rules, bodies, 0.0, (0.0, 0.0))),
        tracking={"pursuer": error, "evader": error},
    )


def ended(captured, win_rate):
    outcomes = {"captured": captured, "no_result": 100 - captured}
    return replace(NO_MATCH, games=100, outcomes=outcomes, pursuer_win_rate=win_rate)


def test_of_a_gap_that_many_points_are_closed():
    found = {(pursuer, evader): match(0.1, 0.5) for pursuer in PURSUERS for evader in EVADERS}
    for seed, bodies in (("seed-0", 0.2), ("seed-1", 0.3)):
        found |= {(seed, evader): match(0.05, bodies) for evader in EVADERS}
        found |= {(pursuer, seed): match(0.05, bodies) for pursuer in PURSUERS}
        found[(seed, seed)] = match(0.0, 0.1, captured=30)
    assert seeds_of(found) == ["seed-0", "seed-1"]
    rows = cells_of(gap_table(found, PURSUERS, EVADERS))
    assert [row[:2] for row in rows] == [
        ["pursuer", "E"], ["pursuer", "E_stranger"], ["pursuer", "robust"],
        ["evader", "P"], ["evader", "P_stranger"], ["evader", "robust"],
    ]  # fmt: skip
    # 40 points are the gap; 10 and 20 are left. Student's t with one degree of freedom, standard error 12.5.
    assert rows[0][2:5] == ["10.0", "50.0", "5.0 ± 0.0"]
    assert rows[0][5].startswith("25.0 ±")
    assert rows[0][6] == f"62 ± {12.706 * 12.5:.0f}"
    # Robust agents among themselves: nothing is left, in either seed.
    assert rows[2][6] == "100 ± 0"
    ends = cells_of(outcomes(found, PURSUERS, EVADERS))
    assert ends[0][:3] == ["captured", "10.0%", "30.0%"]
    assert ends[0][3:9] == [*["10.0 ± 0.0%", "30.0 ± 0.0%"] * 2, "30.0 ± 0.0%", "50.0 ± 0.0%"]
    assert ends[2][:3] == ["pursuer wins", "50.0%", "75.0%"]
    assert cells_of(tracking(found, PURSUERS, EVADERS))[2] == ["robust and E", "pursuer", "0.010", "0.250", "2.0"]


def test_the_example_is_trained_with_every_seed_and_only_a_seeds_own_agents_meet(tmp_path):
    study = Robust(out=tmp_path, config=EXAMPLE, seeds=2)
    assert [config.seed for config, _ in study.trainings().values()] == [0, 1]
    everyone = study.matches
    assert list(everyone.entrants.pursuer) == ["P_prioritised", "P_pool", "seed-0", "seed-1"]
    assert everyone.entrants.evader["seed-1"].endswith("seed-1/agents/E_curriculum.safetensors")
    pairs = [(pursuer, evader) for pursuer in everyone.entrants.pursuer for evader in everyone.row(pursuer)]
    assert len(pairs) == 16 - 2
    assert ("seed-0", "seed-1") not in pairs
    assert everyone.game == load_config(EXAMPLE).game


@pytest.mark.parametrize("config", [RunConfig(), replace(load_config(EXAMPLE), self_play=RunConfig().self_play)])
def test_trainings_without_a_pair_to_go_on_from_or_without_disturbance_are_refused(config, tmp_path):
    create_run(config, tmp_path / "run")
    with pytest.raises(InvalidInput, match="must be a self-play that goes on from two agents"):
        Robust(out=tmp_path, config=tmp_path / "run" / "config.toml").trainings()


def test_a_match_is_kept_once_for_those_who_played_it(tmp_path):
    pytest.importorskip("mujoco")
    game = replace(make_game("paper"), max_steps=30)
    pursuer, still, flee = (
        find_player(name, role, game)
        for name, role in (("pure-pursuit", Role.PURSUER), ("still", Role.EVADER), ("flee", Role.EVADER))
    )
    match = Match(game, BySide(pursuer, still), 3)
    comparison = kept_comparison(tmp_path, match)
    (file,) = tmp_path.iterdir()
    written = file.stat().st_mtime_ns
    assert kept_comparison(tmp_path, match) == comparison
    assert file.stat().st_mtime_ns == written
    assert sum(comparison.bodies.outcomes.values()) == sum(comparison.rules.outcomes.values()) == 3
    for other in ({"seed": 1}, {"games": 4}, {"players": BySide(pursuer, replace(flee, name="still"))}):
        with pytest.raises(InvalidInput, match="is of other players, rules, games or starts"):
            kept_comparison(tmp_path, replace(match, **other))
    pairs = [("P", "E"), ("P", "s"), ("s", "E"), ("s", "s"), ("x", "E"), ("x", "y"), ("s", "y"), ("x", "s"), ("P", "y")]
    played = SimpleNamespace(results=lambda: dict.fromkeys(pairs, comparison))
    study = type("Played", (Robust,), {"matches": played, "others": BySide(("P", "x"), ("E", "y"))})
    found = study(out=tmp_path).finding()
    assert found.text.count("\n\n") == 3 - 1
    assert len(found.data["matches"]) == len(pairs)
