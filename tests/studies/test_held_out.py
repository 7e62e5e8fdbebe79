"""What attacks in held-out arenas come to: the worst of each, who is compared, means and counts."""

import pytest

from apollonius.evaluate.match_cache import kept_record
from apollonius.exploit.losses import Losses
from apollonius.game.types import Role
from studies.held_out import HeldOut
from studies.worst import arena_table, read_attacks, verdict, worst


def losses(loses, wins=0.0):
    return Losses(100, loses, (0.0, 1.0), 0.0, wins)


def arena(own, specialist):
    """Two attackers."""
    evader = {
        "E_any": {"table": losses(own), "P_any": losses(own / 2)},
        "specialist": {"table": losses(0.0), "P_any": losses(specialist, wins=0.05)},
        "shielded:flee-aware": {"table": losses(0.5), "P_any": losses(0.4)},
        "solved": {"table": losses(0.05), "P_any": losses(0.1)},
    }
    return {"pursuer": {}, "evader": evader}


FOUND = {"racks-00": arena(0.2, 0.3), "caves-00": arena(0.5, 0.4)}


def test_the_worst_attacker_counts():
    found = worst(FOUND["racks-00"], Role.EVADER, "specialist")
    assert (found.loses, found.sure) == (0.3, pytest.approx(-0.25))


def test_each_arena_has_a_row_and_there_is_a_mean():
    head, _, first, second, mean = arena_table(FOUND, Role.EVADER).splitlines()
    assert head == "| evader | any arena | specialist | classical | solved |"
    assert first == "| racks-00 | 20 (-20) | 30 (-25) | 50 (-50) | 10 (-10) |"
    assert second.startswith("| caves-00 | 50 (-50) | 40 (-35) |")
    assert mean.startswith("| mean | 35.0 (-35.0) | 35.0 (-30.0) | 50.0 (-50.0) | 10.0 (-10.0) |")


def test_the_verdict_counts_arenas_and_tells_the_regret():
    said = verdict(FOUND, Role.EVADER)
    assert "as specialist in 1, as classical in 2 of 2 arenas" in said
    regret = "0.25 worse than the solved game's player (-1.66 to 2.00)"  # 12.706 / sqrt(2) standard deviations
    assert regret in said


def test_what_is_kept_is_read_back(tmp_path):
    key = {"role": "evader", "player": "E_any", "attacker": "table"}
    kept_record(tmp_path, "one.json", key, Losses, lambda: losses(0.2))
    assert read_attacks(tmp_path) == {"pursuer": {}, "evader": {"E_any": {"table": losses(0.2)}}}


def test_kinds_of_arenas_take_turns_and_all_are_small(tmp_path):
    study = HeldOut(out=tmp_path, arenas=7)
    assert [name.split("-")[0] for name in study.chosen[:5]] == ["racks", "caves", "courtyard", "racks", "caves"]
    assert len(study.trainings()) == 7
