"""Training with disturbed robots: who meets whom, what of the gap is closed, and matches that are kept."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from apollonius.errors import InvalidInput
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import load_config
from studies import robust
from studies.robust import Meeting, entrants, meetings
from studies.robust_report import gap_table, outcomes, seeds_of, tracking, write_results

EXAMPLE = Path(__file__).parents[2] / "examples" / "robust.toml"
PURSUERS, EVADERS = ["P", "P_stranger"], ["E", "E_stranger"]


def cells_of(table):
    """The rows of a Markdown table, cell by cell."""
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]


def match(rules, bodies, captured=10):
    """A match of 100 games in which both sides fail in some by the rules, and in some with bodies."""
    differences = {"rules": rules, "bodies": bodies}
    error = {"speed": {"rms": 0.01}, "heading": {"rms": bodies}, "position": {"rms": 0.002}}
    return {
        "differences": dict.fromkeys(("pursuer fails", "evader fails"), differences),
        "rules": {"outcomes": {"captured": captured, "no_result": 100 - captured}, "pursuer_win_rate": 0.5},
        "bodies": {"outcomes": {"captured": captured + 20, "no_result": 80 - captured}, "pursuer_win_rate": 0.75},
        "tracking": {"pursuer": error, "evader": error},
    }


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
    assert ends[0][:9] == ["captured", *["10.0%", "30.0%"] * 3, "30.0%", "50.0%"]
    assert ends[2][:3] == ["pursuer wins", "50.0%", "75.0%"]
    assert cells_of(tracking(found, PURSUERS, EVADERS))[2] == ["robust and E", "pursuer", "0.010", "0.250", "2.0"]


def test_the_example_is_trained_with_every_seed_and_only_a_seeds_own_agents_meet(tmp_path):
    config = load_config(EXAMPLE)
    runs = {f"seed-{seed}": tmp_path / f"seed-{seed}" for seed in range(2)}
    pursuers = entrants(config, runs, Role.PURSUER, "P_pool")
    evaders = entrants(config, runs, Role.EVADER, "E_curriculum")
    assert list(pursuers) == ["P_prioritised", "P_pool", "seed-0", "seed-1"]
    assert evaders["seed-1"].endswith("seed-1/agents/E_curriculum.safetensors")
    asked = meetings(tmp_path, config.game, pursuers, evaders, 10, 0)
    assert len(asked) == 16 - 2
    assert ("seed-0", "seed-1") not in asked
    assert asked[("P_pool", "seed-1")].evader == evaders["seed-1"]


@pytest.mark.parametrize("config", [RunConfig(), replace(load_config(EXAMPLE), self_play=RunConfig().self_play)])
def test_trainings_without_a_pair_to_go_on_from_or_without_disturbance_are_refused(config):
    with pytest.raises(InvalidInput, match="must be a self-play that goes on from two agents"):
        entrants(config, {}, Role.EVADER, "P_pool")


def test_bad_numbers_are_refused_before_anything_is_written(tmp_path):
    for options in (["--seeds", "0"], ["--games", "0"], ["--config", str(tmp_path / "none.toml")]):
        with pytest.raises(InvalidInput, match=options[0]):
            robust.main(["--out", str(tmp_path / "out"), *options])
    assert not (tmp_path / "out").exists()


def test_a_match_is_kept_once_for_those_who_played_it(tmp_path):
    pytest.importorskip("mujoco")
    meeting = Meeting(tmp_path / "matches" / "one.json", make_game("paper"), "pure-pursuit", "still", 3, 0)
    assert not meeting.play(lambda: True)
    assert not meeting.file.exists()
    assert meeting.play(lambda: False)
    comparison = meeting.comparison()
    assert sum(comparison["bodies"]["outcomes"].values()) == sum(comparison["rules"]["outcomes"].values()) == 3
    for other in (replace(meeting, seed=1), replace(meeting, games=4), replace(meeting, evader="flee")):
        with pytest.raises(InvalidInput, match="this match is of others"):
            other.comparison()
    pairs = [("P", "E"), ("P", "s"), ("s", "E"), ("s", "s"), ("x", "E"), ("x", "y"), ("s", "y"), ("x", "s"), ("P", "y")]
    written = write_results(tmp_path, dict.fromkeys(pairs, comparison), ["P", "x"], ["E", "y"])
    assert (tmp_path / "robust.md").read_text() == written + "\n"
    assert len(json.loads((tmp_path / "robust.json").read_text())) == len(pairs)
