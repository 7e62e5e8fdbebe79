"""The whole of `reproduce` on the smallest trainings: what it writes, that it goes on, and what it refuses."""

import json
import re
import shutil
from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius import MatchResult, Outcome
from apollonius.cli.display import Display
from apollonius.cli.main import main
from apollonius.evaluate.claims import Claim
from apollonius.game.outcome import counts_by_name
from apollonius.io.errors import InvalidInput
from apollonius.learn.config import PRESETS
from apollonius.learn.folder import agent_file, create_run
from apollonius.learn.run import TrainingRun
from apollonius.reproduce.finding import claim_table, outcome_table
from apollonius.reproduce.reproduction import SECTIONS, SECTIONS_OF_SEEDS, figure_6_in_course, reproduce
from apollonius.reproduce.side_by_side import train_side_by_side
from apollonius.reproduce.study import AGENTS, RUN_OF, Study, run_configs
from tests.learn.tiny import STOPPING

GAMES = 40
PROGRESS: dict[str, list[tuple[int, int]]] = {}
"""What the study told of its pieces of work."""
PICTURES = [f"figure{number}.png" for number in (4, 5, 6, 7, 8)]


@pytest.fixture(autouse=True, scope="module")
def tiny_budget():
    """The smallest training as a preset; its processes share the compilations of the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PRESETS, "tiny", STOPPING)
        patch.setenv("JAX_COMPILATION_CACHE_DIR", str(jax.config.jax_compilation_cache_dir))
        patch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
        yield


@pytest.fixture(scope="module")
def study(demo, tmp_path_factory):
    """A study of finished trainings: the agents and the course of the run that the site reports on."""
    folder = tmp_path_factory.mktemp("study")
    agents = {"P_scratch": "P_stage1", "P_random": "P_stage1", "E_scratch": "E_curriculum"}
    for name, config in run_configs(PRESETS["quick"], 0).items():
        create_run(config, run := folder / "seed-0" / name)
        shutil.copy(demo / "metrics.jsonl", run)
        for agent in AGENTS[name]:
            for moment in (25, 75, 100) if agent.endswith(("_curriculum", "_scratch")) else (100,):
                (file := agent_file(run, agent, moment)).parent.mkdir(exist_ok=True)
                shutil.copy(demo / "agents" / f"{agents.get(agent, agent)}.safetensors", file)
    begin = Display.begin_task

    def heard(display, what, share=None):
        PROGRESS[what] = []
        begin(display, what, share)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Display, "begin_task", heard)
        patch.setattr(Display, "report", lambda self, *games: [*PROGRESS.values()][-1].append(games))
        assert main(["reproduce", "--games", str(GAMES), "--out", str(folder), "--resume"]) == 0
    return folder


@pytest.mark.usefixtures("study")
def test_reproduce_reports_its_steps_and_finished_games():
    pieces = [f"playing and drawing {name}" for name in
              ("figure 4", "figure 5", "figure 6", "figure 7", "table 2", "table 3", "figure 8")]  # fmt: skip
    assert [*PROGRESS] == ["loading", *pieces]
    assert PROGRESS[pieces[0]][-1] == (GAMES, GAMES)


def test_study_has_every_figure_and_claim(study):
    assert sorted(path.name for path in study.glob("*.png")) == PICTURES
    assert all((study / name).read_bytes().startswith(b"\x89PNG") for name in PICTURES)
    results = json.loads((study / "results.json").read_text())
    assert (results["budget"], results["seeds"], results["games"]) == ("quick", [0], GAMES)
    assert len(results["findings"]) == len(SECTIONS)
    report = (study / "report.md").read_text()
    for claim in results["claims"]:
        assert claim["verdict"] == "not enough"
        assert claim["interval"][0] <= claim["mean"] <= claim["interval"][1]
        assert f"| {claim['name']} |" in report
    for name in PICTURES:
        assert f"]({name})" in report


def test_claims_and_text_follow_from_the_matches(study):
    results = json.loads((study / "results.json").read_text())
    stage, _, fight, _, second, third, same = [found | found["data"] for found in results["findings"].values()]

    def share(matches, outcomes="captured, evader_hit_obstacle, evader_out_of_range"):
        return sum(matches[0][0]["outcomes"][outcome] for outcome in outcomes.split(", ")) / GAMES

    captures = [share(second[name], "captured") for name in ("P_random", "P_curriculum")]
    expected = [
        share(stage["matches"]), share(fight["chasing"]), 1 - share(fight["fleeing"]), share(second["P_curriculum"]),
        share(second["P_random"]), captures[0] - captures[1], share(third["P_curriculum"]) - share(third["P_random"]),
    ]  # fmt: skip
    assert [claim["mean"] for claim in results["claims"]] == pytest.approx(expected)
    papers = [0.96, 0.7, 0.7, 0.93, 0.91, 274 / 500, 0.272]
    assert [claim["paper"] for claim in results["claims"]] == pytest.approx(papers)
    lines = map(json.loads, (study / "seed-0/curriculum/metrics.jsonl").read_text().splitlines())
    won = [line["evaluation"] for line in lines if "evaluation" in line and line["stage"] == "fixed-target"]
    assert stage["success"][0][1] == [100 * one["outcomes"]["captured"] / 500 for one in won]
    assert "| captured | {:.1%} | {:.1%} | 67.2% | 12.4% |".format(*captures) in second["text"]
    crash, win = same["ends"]
    assert crash.startswith("P_random: pursuer hit obstacle after")
    assert re.match("P_curriculum: (captured|evader hit|evader out)", win)


@pytest.mark.slow
def test_interrupted_study_resumes(tmp_path):
    """After three chunks of one training."""
    begun = tmp_path / "seed-0" / "scratch"
    config = run_configs(STOPPING, 0)["scratch"]
    create_run(config, begun)
    chunks = iter([False, False, True])
    assert not TrainingRun(config, begun, should_stop=lambda: next(chunks)).execute()
    told = []
    reproduce(tmp_path, "tiny", 1, resume=True, games=GAMES, report=told.append)
    assert told[0].startswith("3 of 3 trainings to do")
    assert set(RUN_OF) <= {path.stem for path in tmp_path.glob("seed-0/*/agents/*.safetensors")}
    assert sorted(path.name for path in tmp_path.glob("*.png")) == PICTURES


@pytest.mark.slow
def test_study_side_by_side_goes_on_and_ends_like_any(tmp_path):
    """Stopped after the first training of both seeds; the whole report, with the course of self-play."""

    def side_by_side(jobs):
        train_side_by_side([job.arguments[0] for job in jobs])
        return []

    def stopped(jobs):
        side_by_side([job for job in jobs if job.arguments[0].name == "curriculum"])
        raise KeyboardInterrupt

    arguments = {"budget": "tiny", "seeds": 2, "games": GAMES}
    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path, resume=False, run=stopped, **arguments)
    told = []
    reproduce(tmp_path, resume=True, run=side_by_side, report=told.append, **arguments)
    assert told[0].startswith("4 of 6 trainings to do")
    assert len(json.loads((tmp_path / "results.json").read_text())["findings"]) == len(SECTIONS_OF_SEEDS)
    assert sorted(path.name for path in tmp_path.glob("*.png")) == sorted([*PICTURES, "figure6-course.png"])


def test_course_of_self_play_has_a_row_for_each_moment(tmp_path):
    """Pursuers of three seeds that win two games of twenty less at each moment, and draw the others."""

    class Counted(Study):
        def matches(self, pursuer, evader, percent=100):
            wins = 19 - 2 * (percent // 25)
            counts = counts_by_name([0] * len(Outcome)) | {"captured": wins, "no_result": 20 - wins}
            return [[MatchResult(counts, 1.0, None)] * 3] * 3

    finding = figure_6_in_course(Counted(tmp_path, "quick", (0, 1, 2)))
    assert (tmp_path / finding.pictures[0]).read_bytes().startswith(b"\x89PNG")
    assert finding.text.splitlines()[-4:] == [
        "| 25 % | 85.0% [85%, 85%], 100% | 15.0% [15%, 15%], 0% |",
        "| 50 % | 75.0% [75%, 75%], 100% | 25.0% [25%, 25%], 0% |",
        "| 75 % | 65.0% [65%, 65%], 0% | 35.0% [35%, 35%], 0% |",
        "| 100 % | 55.0% [55%, 55%], 0% | 45.0% [45%, 45%], 0% |",
    ]


@pytest.mark.parametrize(
    ("name", "value", "bound"), [("budget", "huge", "quick"), ("seeds", 0, "at least 1"), ("games", 0, "at least 1")]
)
def test_bad_arguments_are_refused_before_anything_is_written(tmp_path, name, value, bound):
    arguments = {"budget": "tiny", "seeds": 1, "resume": False, "games": GAMES, name: value}
    with pytest.raises(InvalidInput, match=f"{name} = {value} .*{bound}"):
        reproduce(tmp_path / "study", **arguments)
    assert not (tmp_path / "study").exists()


def test_study_is_not_overwritten_by_another(study):
    before = {path: path.read_bytes() for path in study.rglob("*") if path.is_file()}
    with pytest.raises(InvalidInput, match="resume it"):
        reproduce(study, "quick", 1, resume=False, games=GAMES)
    with pytest.raises(InvalidInput, match="another training"):
        reproduce(study, "tiny", 1, resume=True, games=GAMES)
    assert {path: path.read_bytes() for path in study.rglob("*") if path.is_file()} == before


def test_run_configs_are_the_three_trainings_of_the_paper():
    runs = run_configs(PRESETS["paper"], 3)
    assert {run.seed for run in runs.values()} == {3}
    names = {name: list(run.by_name) for name, run in runs.items()}
    assert names == {
        "curriculum": ["fixed-target", "self-play"],
        "scratch": ["self-play"],
        "random": ["fixed-target"],
    }
    assert runs["random"].stages[0].evaders == ("random",)
    stage_1, stage_2 = runs["curriculum"].stages
    assert [stage.env_steps for stage in runs["random"].stages] == [(stage_1.env_steps + stage_2.env_steps) // 2]
    assert runs["scratch"].stages == (replace(stage_2, pursuer_epsilon=1.0),)


def test_outcome_table_has_intervals_for_several_seeds_only():
    """Student's t with two degrees of freedom: 4.303 x 10 / sqrt(3) points."""
    ours = {"captured": [0.1, 0.2, 0.3], "both_failed": [0.0, 0.0, 0.0]}
    table = outcome_table([("here", ours), ("paper", {"captured": [0.124]}), ("one seed", {"both_failed": [0.5]})])
    assert table.splitlines()[2:] == [
        "| captured | 20.0 ± 24.8% | 12.4% | - |",
        "| both failed | 0.0 ± 0.0% | - | 50.0% |",
    ]


def test_claim_table_shows_the_range_of_many_trainings():
    few, many = ((tuple(map(tuple, np.linspace(0.1, 0.9, rows * 3).reshape(rows, 3).tolist()))) for rows in (3, 10))
    rows = claim_table([Claim("few", "", 0.5, 0.5, few), Claim("many", "", 0.5, 0.5, many)], is_full=True).splitlines()
    assert "10.0%, 20.0%, 30.0%; 40.0%, 50.0%, 60.0%; 70.0%, 80.0%, 90.0%" in rows[2]
    assert "| 10.0% to 90.0% |" in rows[3]
