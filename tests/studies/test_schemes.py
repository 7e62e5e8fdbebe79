"""The comparison of schemes on the smallest trainings: everything is trained and judged once, and told in a table."""

import json
from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.arenas.record import to_dict
from apollonius.game.types import Role
from apollonius.learn.folder import create_run
from apollonius.learn.scheme import OpponentConfig
from apollonius.learn.trainings import train
from studies import scheme_measures, schemes
from studies.scheme_measures import Effort, entrants, everyone, judge_run
from studies.scheme_report import write_results
from tests.learn.tiny import CHUNK, DQN, GAME, RUN

EFFORT = Effort(response_env_steps=2 * CHUNK, games=12, rating_games=12)


@pytest.fixture(scope="module", autouse=True)
def small():
    """Responses learn as little as everyone else, from random weights; quick players stand for the paper's agents."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scheme_measures, "QUICK", replace(DQN, replay_capacity=CHUNK))
        patch.setattr(scheme_measures, "FIRST", dict.fromkeys(Role))
        patch.setitem(scheme_measures.ZOO, Role.PURSUER, ("still",))
        patch.setitem(scheme_measures.ZOO, Role.EVADER, ("random",))
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
def judged(runs):
    out = runs[0].parents[1]
    for run in runs:
        assert judge_run(run, EFFORT, True, lambda: False)
    for job in everyone(out, runs, EFFORT).jobs():
        assert job.work(*job.arguments, lambda: False)
    return out, write_results(out, runs, EFFORT)


def test_every_scheme_has_the_same_budget_and_start():
    configs = [schemes.run_config(scheme, 1, 4_000_000) for scheme in schemes.SCHEMES]
    assert len({config.self_play.opponents.scheme for config in configs}) == len(schemes.SCHEMES) == 10
    same = [replace(config, self_play=replace(config.self_play, opponents=OpponentConfig())) for config in configs]
    assert all(config == same[0] for config in same)
    assert (same[0].pursuer, same[0].seed, same[0].self_play.env_steps) == ("P_stage1", 1, 4_000_000)
    good = schemes.run_config("latest", 1, 4_000_000, "P_curriculum", "E_curriculum")
    assert (good.pursuer, good.evader, same[0].evader) == ("P_curriculum", "E_curriculum", None)
    assert good.self_play.evader_epsilon < same[0].self_play.evader_epsilon == 1
    assert good.dqn.learning_rate < same[0].dqn.learning_rate
    rounds = configs[0].self_play.opponents.renewal // configs[0].dqn.games
    assert rounds >= configs[0].game.max_steps, "a game of a seat comes to its end before the seats are drawn anew"


@pytest.mark.slow
def test_a_judgement_that_was_stopped_goes_on(runs, judged):
    run = runs[0]
    whole = json.loads((run / "judged.json").read_text())
    assert sorted(whole) == ["evader-100", "evader-50", "pursuer-100", "pursuer-50"]
    responses = {path: path.stat().st_mtime_ns for path in run.glob("responses/*/*")}
    assert len(responses) == 4
    (run / "judged.json").write_text(json.dumps({name: whole[name] for name in sorted(whole)[:3]}))
    assert not judge_run(run, EFFORT, True, lambda: True)
    assert judge_run(run, EFFORT, True, lambda: False)
    assert json.loads((run / "judged.json").read_text()) == whole
    assert {path: path.stat().st_mtime_ns for path in run.glob("responses/*/*")} == responses


@pytest.mark.slow
def test_the_worst_loss_counts_and_responses_know_whom_they_attack(runs, judged):
    for run in runs:
        for name, loss in json.loads((run / "judged.json").read_text()).items():
            assert loss["most"] == max(against["rate"] for against in loss["against"].values())
            assert len(loss["against"]) == 2
            header = load_agent(run / "responses" / name / "response-0.safetensors").header
            assert header.role != name.split("-")[0]
            assert header.training["env_steps"] == EFFORT.response_env_steps // (1 if name.endswith("-100") else 2)


@pytest.mark.slow
def test_every_last_agent_meets_every_other_once(runs, judged):
    out, _ = judged
    matches = {path: path.stat().st_mtime_ns for path in (out / "tournament").iterdir()}
    assert len(matches) == (2 + 1) * (2 + 1)
    assert list(entrants(runs, Role.PURSUER)) == ["latest/seed-0", "uniform/seed-0", "still"]
    assert everyone(out, runs, EFFORT).jobs() == []
    assert everyone(out, runs, EFFORT).tournament().ratings.evaders.shape == (3,)
    assert {path: path.stat().st_mtime_ns for path in (out / "tournament").iterdir()} == matches


@pytest.mark.slow
def test_the_table_has_a_row_for_each_scheme_and_the_figure_is_drawn(runs, judged):
    out, table = judged
    assert (out / "schemes.md").read_text() == table + "\n"
    found = json.loads((out / "schemes.json").read_text())["schemes"]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()]
    assert [row[0] for row in rows[2:]] == ["latest", "uniform"]
    assert len({len(row) for row in rows}) == 1
    for row in rows[2:]:
        assert row[1] == f"{100 * found[row[0]]['pursuer'][0]['most']:.1f} %"
        assert row[5] == f"{100 - 100 * found[row[0]]['pursuer'][0]['against']['random']['rate']:.1f} %"
    elos = [found[scheme][side][0]["elo"] for scheme in found for side in ("pursuer", "evader")]
    assert np.isfinite(elos).all()
    assert (out / "schemes.png").read_bytes().startswith(b"\x89PNG")
