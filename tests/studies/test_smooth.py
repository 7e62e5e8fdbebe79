"""Continuous agents beside discrete ones: matches go on where they were stopped, and seeds become means."""

from dataclasses import replace

import jax.numpy as jnp
import pytest
import tomli_w

from apollonius.agents.trained import find_trained
from apollonius.evaluate.round_robin import RoundRobin, play_row
from apollonius.game.by_side import BySide
from apollonius.learn.folder import load_config
from apollonius.learn.learner_config import DQNConfig, SACConfig
from studies import smooth
from studies.smooth import CONTINUOUS, DISCRETE, comparison, kind_of, pairings, table, turn_rates
from tests.studies.matches import NO_MATCH


def match(wins, capture, changes):
    return replace(
        NO_MATCH,
        pursuer_win_rate=wins,
        evader_undefeated_rate=0.9 - wins,
        mean_capture_steps=capture,
        capture_steps_deviation=capture and capture / 2,
        pursuer_change=(changes, 2 * changes),
        evader_change=(0.0, 0.1),
    )


def flat(rows):
    """Matches by pursuer and evader."""
    return {(pursuer, evader): match for pursuer, row in rows.items() for evader, match in row.items()}


def cells_of(table):
    """The rows of a Markdown table, cell by cell."""
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]


def test_a_table_has_a_row_for_each_pairing_and_means_over_seeds():
    rows = {
        "P_zoo": {"random": match(0.5, None, 0.3), "continuous seed-0": match(0.2, 50.0, 0.3)},
        "continuous seed-0": {"random": match(0.6, 100.0, 0.02), "continuous seed-2": match(0.4, 80.0, 0.01)},
        "continuous seed-1": {"random": match(0.8, 120.0, 0.04), "continuous seed-2": match(0.4, 80.0, 0.01)},
    }
    lines = cells_of(table(pairings(flat(rows)), dt=0.1))
    assert [line[:2] for line in lines] == [
        ["P_zoo", "random"], ["P_zoo", CONTINUOUS], [CONTINUOUS, "random"], [CONTINUOUS, CONTINUOUS],
    ]  # fmt: skip
    assert lines[0][2:] == ["50.0", "-", "-", "0.450", "0.050"]
    # Two seeds, 60 and 80: Student's t with one degree of freedom times the standard error of 10.
    assert lines[2][2] == f"70.0 ± {12.706 * 10:.1f}"
    assert lines[2][3].startswith("11.0 ±")
    assert lines[3][2] == "40.0 ± 0.0"


def everyone_of(seeds):
    """All agents of so many seeds and a random evader: pursuers win 60 and 70 % of their games against it with
    continuous actions, ten points less with discrete ones, half of those against strangers, and all others.
    """
    rows = {}
    for seed in range(seeds):
        for kind, less, rough in ((CONTINUOUS, 0.0, 1), (DISCRETE, 0.1, 10)):
            name = f"{kind} seed-{seed}"
            rows[name] = {"random": match(0.6 + seed / 10 - less, None, rough * (0.02 + 0.02 * seed))}
            rows[name] |= {
                f"{other} seed-{number}": match(1.0 if (other, number) == (kind, seed) else 0.5, None, 0.1)
                for other in (DISCRETE, CONTINUOUS)
                for number in range(seeds)
            }
    return rows


def test_kinds_are_compared_seed_by_seed():
    lines = cells_of(comparison(pairings(flat(everyone_of(seeds=2)))))
    assert [line[:2] for line in lines] == [
        ["pursuer", "random"], ["pursuer", DISCRETE], ["pursuer", CONTINUOUS], ["evader", CONTINUOUS],
        ["evader", DISCRETE],
    ]  # fmt: skip
    # Both seeds have ten points more, so the interval has no width, however far seeds lie apart. Changes of u1 and u2
    # are 0.02 and 0.04, 0.04 and 0.08, and ten times as much.
    assert lines[0][4:] == ["+10.0 ± 0.0", "0.045 ± 0.191", "0.450 ± 1.906", "0.10"]
    assert [line[2:4] for line in lines[1:]] == 2 * [2 * ["50.0 ± 0.0"]] + 2 * [2 * ["40.0 ± 0.0"]]


def test_who_was_trained_together_is_left_out_and_so_is_a_kind_that_has_met_no_stranger():
    assert [line[:2] for line in cells_of(comparison(pairings(flat(everyone_of(seeds=1)))))] == [["pursuer", "random"]]


def test_differences_are_between_agents_of_one_seed_whoever_met_first():
    """The first pursuer of a kind does not meet its own evader, so that the others' matches come first."""
    rows = everyone_of(seeds=3)
    for pursuer, row in rows.items():
        for number in range(3):
            for kind in (CONTINUOUS, DISCRETE):
                if pursuer != f"{kind} seed-{number}":
                    row[f"{kind} seed-{number}"] = match(number / 10, None, 0.1)
    lines = cells_of(comparison(pairings(flat(rows))))
    assert [line[4] for line in lines if line[0] == "evader"] == 2 * ["+0.0 ± 0.0"]


def test_everyone_trains_alike_but_for_seed_and_kind_and_meets_the_zoo(tmp_path):
    one, other, discrete = (
        smooth.run_config(kind, seed, 100_000, 200_000)
        for kind, seed in ((CONTINUOUS, 0), (CONTINUOUS, 1), (DISCRETE, 0))
    )
    assert isinstance(one.learner, SACConfig)
    assert (one.seed, other.seed, one.learner, one.stages) == (0, 1, other.learner, "both")
    assert isinstance(discrete.learner, DQNConfig)
    assert replace(discrete, sac=one.sac) == one
    evaders = smooth.Smooth(out=tmp_path, seeds=1).matches.entrants.evader
    assert list(evaders) == ["E_curriculum", "E_scratch", "random", "continuous seed-0", "discrete seed-0"]
    assert evaders["continuous seed-0"].endswith("continuous/seed-0/agents/E_curriculum.safetensors")
    kinds = ["E_curriculum", "E_scratch", "random", CONTINUOUS, DISCRETE]
    assert [kind_of(name) for name in evaders] == kinds


def test_the_zoos_smooth_agents_are_what_the_first_seed_comes_to_by_default(tmp_path):
    config = smooth.run_config(CONTINUOUS, 0, 6_000_000, 8_000_000)
    for name in ("P_smooth", "E_smooth"):
        (tmp_path / "config.toml").write_text(tomli_w.dumps(find_trained(name)[0].header.training["config"]))
        assert load_config(tmp_path / "config.toml") == config


@pytest.mark.slow
def test_matches_that_were_stopped_go_on_and_results_are_written(tmp_path):
    everyone = RoundRobin(
        tmp_path / "matches", BySide({"P_stage1": "P_stage1"}, {"still": "still", "random": "random"}), 6, 1
    )
    assert not play_row(everyone, "P_stage1", lambda: True)
    assert not everyone.folder.exists()
    asked = iter((False, True))
    assert not play_row(everyone, "P_stage1", lambda: next(asked))
    (kept,) = everyone.folder.iterdir()
    written_at = kept.stat().st_mtime_ns
    (job,) = everyone.jobs()
    assert job.work(*job.arguments, lambda: False)
    assert everyone.jobs() == []
    assert kept.stat().st_mtime_ns == written_at
    assert {names: match.games for names, match in everyone.results().items()} == {
        ("P_stage1", "still"): 6,
        ("P_stage1", "random"): 6,
    }
    # A discrete agent under a continuous name draws the figure as well.
    names = dict.fromkeys(("discrete seed-0", "continuous seed-0"), "P_stage1")
    both = replace(everyone, entrants=BySide(names, dict.fromkeys(names, "still")))
    found = type("Played", (smooth.Smooth,), {"matches": both})(out=tmp_path).finding()
    assert len(found.data["matches"]) == 4
    assert (tmp_path / found.pictures[0]).stat().st_size > 10_000


def test_turn_rates_are_read_from_either_kind_of_actions():
    assert turn_rates(jnp.array([[8, 0], [3, 4]])).tolist() == [1, -1]
    assert turn_rates(jnp.array([[[0, 0.5], [1, 1]]])).tolist() == [0.5]
