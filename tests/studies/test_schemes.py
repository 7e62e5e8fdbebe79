"""The comparison of schemes on the smallest trainings: everything is trained and judged once, and told in a table."""

import json
from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.arenas.record import to_dict
from apollonius.errors import InvalidInput
from apollonius.game.by_side import BySide
from apollonius.game.types import Role
from apollonius.learn.folder import create_run
from apollonius.learn.opponents.opponent_config import OpponentConfig
from apollonius.learn.trainings import train
from apollonius.reproduce.finding import write_finding
from studies import judgement, schemes
from studies.judgement import Effort, judge_run
from tests.learn.tiny import CHUNK, DQN, GAME, RUN

EFFORT = Effort(response_env_steps=2 * CHUNK, games=12)


@pytest.fixture(scope="module", autouse=True)
def small():
    """Responses learn as little as everyone else, from random weights; quick players stand for the paper's agents."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judgement, "QUICK", replace(DQN, replay_capacity=CHUNK))
        patch.setattr(judgement, "FIRST", BySide(None, None))
        patch.setattr(judgement, "ZOO", BySide(("still",), ("random",)))
        yield


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two schemes, one seed each, with both agents kept twice."""
    out = tmp_path_factory.mktemp("schemes")
    save_agent(
        describe(make_network("paper", 16, 1, jax.random.key(0)), Role.PURSUER, to_dict(GAME), {}),
        out / "P.safetensors",
    )
    folders = []
    for scheme in ("latest", "uniform"):
        opponents = OpponentConfig(scheme=scheme, versions=2, seats=2, renewal=CHUNK)
        stage = replace(RUN.self_play, env_steps=2 * CHUNK, snapshots=2, opponents=opponents)
        config = replace(RUN, stages="self-play", self_play=stage, pursuer=str(out / "P.safetensors"))
        folders.append(out / scheme / "seed-0")
        create_run(config, folders[-1])
        assert train(folders[-1], lambda: False)
    return folders


@pytest.fixture(scope="module")
def study(runs):
    """Everything judged, and told."""
    out = runs[0].parents[1]
    asked = {"schemes": ("latest", "uniform"), "seeds": 1, "games": 12, "rating_games": 12}
    study = schemes.Schemes(out=out, response_env_steps=EFFORT.response_env_steps, **asked)
    assert study.effort == EFFORT
    assert list(study.runs.values()) == runs
    for jobs in study.jobs():
        for job in jobs:
            assert job.work(*job.arguments, lambda: False)
    write_finding(study.finding(), out, "schemes")
    return study


def test_every_scheme_has_the_same_budget_and_start():
    configs = [schemes.run_config(scheme, 1, 4_000_000) for scheme in schemes.SCHEMES]
    assert len({config.self_play.opponents.scheme for config in configs}) == len(schemes.SCHEMES) == 4
    same = [replace(config, self_play=replace(config.self_play, opponents=OpponentConfig())) for config in configs]
    assert all(config == same[0] for config in same)
    assert (same[0].pursuer, same[0].seed, same[0].self_play.env_steps) == ("P_stage1", 1, 4_000_000)
    good = schemes.run_config("latest", 1, 4_000_000, "P_curriculum", "E_curriculum")
    assert (good.pursuer, good.evader, same[0].evader) == ("P_curriculum", "E_curriculum", None)
    assert good.self_play.evader_epsilon < same[0].self_play.evader_epsilon == 1
    assert good.dqn.learning_rate < same[0].dqn.learning_rate
    rounds = configs[0].self_play.opponents.renewal // configs[0].dqn.games
    assert rounds >= configs[0].game.max_steps, "a game of a seat comes to its end before the seats are drawn anew"


def test_variants_are_latest_but_for_what_the_evader_is_paid_and_told():
    latest = schemes.run_config("latest", 1, 4_000_000)
    paid, told, both = (schemes.run_config(name, 1, 4_000_000) for name in schemes.VARIANTS)
    assert paid.self_play == replace(latest.self_play, zero_sum_within=3.0)
    assert told.self_play == replace(latest.self_play, evader_observation="opponent-aware")
    assert both.self_play == replace(paid.self_play, evader_observation="opponent-aware")
    assert all(replace(config, self_play=latest.self_play) == latest for config in (paid, told, both))


@pytest.mark.slow
def test_a_judgement_that_was_stopped_goes_on(runs, study):
    run = runs[0]
    files = {path: path.stat().st_mtime_ns for path in [*run.glob("judged/*"), *run.glob("responses/*/*")]}
    names = ["evader-100", "evader-50", "pursuer-100", "pursuer-50"]
    assert sorted(path.stem for path in files if path.suffix == ".json") == names
    assert len(files) == 2 * len(names)
    lost = run / "judged" / "pursuer-50.json"
    before = json.loads(lost.read_text())
    lost.unlink()
    assert not judge_run(run, EFFORT, True, lambda: True)
    assert not lost.exists()
    assert judge_run(run, EFFORT, True, lambda: False)
    assert json.loads(lost.read_text()) == before
    assert {path: path.stat().st_mtime_ns for path in files if path != lost} == {
        path: time for path, time in files.items() if path != lost
    }
    with pytest.raises(InvalidInput, match="is of other players, rules, games or starts"):
        judge_run(run, replace(EFFORT, games=13), True, lambda: False)


@pytest.mark.slow
def test_the_worst_loss_counts_and_responses_know_whom_they_attack(runs, study):
    for run in runs:
        for role in Role:
            for percent in judgement.judged(run, role):
                found = judgement.judge(run, role, percent, EFFORT)
                assert found.most == max(loss.rate for loss in found.against.values())
                assert len(found.against) == 2
                name = f"{role.name.lower()}-{percent}"
                header = load_agent(run / "responses" / name / "response-0.safetensors").header
                assert header.role != role.name.lower()
                assert header.training["env_steps"] == EFFORT.response_env_steps // (1 if percent == 100 else 2)


@pytest.mark.slow
def test_every_last_agent_meets_every_other_once(runs, study):
    everyone = study.matches
    matches = {path: path.stat().st_mtime_ns for path in everyone.folder.iterdir()}
    assert len(matches) == (2 + 1) * (2 + 1)
    assert list(everyone.entrants.pursuer) == ["still", "latest/seed-0", "uniform/seed-0"]
    assert everyone.jobs() == []
    assert everyone.tournament().ratings.evaders.shape == (3,)
    assert {path: path.stat().st_mtime_ns for path in everyone.folder.iterdir()} == matches


@pytest.mark.slow
def test_the_table_has_a_row_for_each_scheme_and_the_figure_is_drawn(study):
    found = json.loads((study.out / "schemes.json").read_text())["schemes"]
    lines = [line for line in (study.out / "schemes.md").read_text().splitlines() if line.startswith("|")]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert [row[0] for row in rows[2:]] == ["latest", "uniform"]
    assert len({len(row) for row in rows}) == 1
    for row in rows[2:]:
        ((run,)) = found[row[0]]
        against = run["judgements"]["pursuer"]["100"]["against"]
        assert row[1] == f"{100 * max(loss['rate'] for loss in against.values()):.1f} %"
        assert row[3] == f"{run['elo']['pursuer'][0]:.0f}"
        assert row[5] == f"{100 - 100 * against['random']['rate']:.1f} %"
    elos = [runs[0]["elo"][side] for runs in found.values() for side in ("pursuer", "evader")]
    assert np.isfinite(elos).all()
    assert (study.out / "schemes.png").read_bytes().startswith(b"\x89PNG")
