"""Variants of the study: each differs in one thing, and the table has each claim of each."""

from dataclasses import fields, replace

import pytest

from apollonius.arenas.record import to_dict
from apollonius.learn.config import PRESETS
from apollonius.reproduce.claims import rate_claim
from studies.sensitivity import Sensitivity, table, variants

QUICK = PRESETS["quick"]


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("c = 3 in self-play", "self_play"),
        ("moving starts", "game"),
        ("four small discs", "game"),
        ("one large disc", "game"),
        ("plain DQN", "dqn"),
    ],
)
def test_a_variant_changes_one_part_of_the_preset(name, part):
    before, after = to_dict(QUICK), to_dict(variants(QUICK)[name])
    assert [field.name for field in fields(QUICK) if before.get(field.name) != after.get(field.name)] == [part]
    if part != "dqn":
        changed = {key for key in before[part] if before[part][key] != after[part][key]}
        assert changed in ({"progress"}, {"starts"}, {"arena"})


def test_every_variant_is_another_and_one_is_the_preset_itself():
    presets = list(variants(QUICK).values())
    assert len(presets) == 6
    assert sum(to_dict(preset) == to_dict(QUICK) for preset in presets) == 1
    assert all(to_dict(one) != to_dict(other) for one in presets for other in presets if one is not other)


def test_plain_dqn_is_the_papers_profile_but_for_the_games_at_a_time():
    plain = variants(QUICK)["plain DQN"].dqn
    assert (plain.games, plain.env_steps_per_update, plain.batch) == (16, 16, 32)
    assert (plain.observation, plain.double, plain.n_step, plain.averaging) == ("paper", False, 1, 1.0)
    assert replace(plain, games=1, env_steps_per_update=1).learning_rate == 1e-4


def test_the_table_has_each_claim_of_each_variant_below_the_papers():
    claims = {
        name: [rate_claim("wins", "Fig. 6", 0.7, 0.7, [(times, 1000)]), rate_claim("x", "Fig. 4", 0.9, 0.9, [(5, 10)])]
        for name, times in (("first", 800), ("second", 300))
    }
    lines = table(claims).splitlines()
    assert lines[0] == "|  | wins | x |"
    assert lines[2] == "| the paper | 70.0% | 90.0% |"
    assert lines[3].startswith("| first | 80.0% [77.4%, 82.4%] | 50.0% [")
    assert lines[4].startswith("| second | 30.0% [27.2%, 32.9%] |")


def test_every_variant_is_a_reproduction_of_its_own(tmp_path):
    study = Sensitivity(out=tmp_path, seeds=2)
    folders = [folder.relative_to(tmp_path).parts for folder in study.trainings()]
    assert len(folders) == len(set(folders)) == 6 * 2 * 3
    assert ("c-is-3-in-self-play", "seed-1", "scratch") in folders
