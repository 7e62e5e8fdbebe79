"""The whole evaluation of the paper: train what is missing, play, draw, report."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from apollonius import Outcome
from apollonius.evaluate.claims import STAGE_1, Claim, rate_claim
from apollonius.game.outcome import PURSUER_WINS, names_of
from apollonius.io.errors import require
from apollonius.io.jobs import available_cores
from apollonius.io.limits import SEEDS, STUDY_GAMES
from apollonius.learn.config import PRESETS
from apollonius.learn.trainings import train_runs
from apollonius.reproduce.figures import (
    beyond,
    figure_4,
    figure_5,
    figure_6,
    figure_6_claims,
    figure_7,
    figure_8,
    table_2,
    table_2_claims,
    table_3,
    table_3_claim,
)
from apollonius.reproduce.finding import Finding, markdown_table, percent, write_report
from apollonius.reproduce.study import Study
from apollonius.show import palette, style
from apollonius.show.style import draw_seeds


def in_training(study: Study) -> Finding:
    """Every claim at each moment at which agents were kept, seed by seed."""
    moments = study.preset.self_play.snapshot_percents
    claims = {moment: claims_at(study, moment) for moment in moments}
    names = [claim.name for claim in claims[100]]
    by_name = {name: [claims[moment][index] for moment in moments] for index, name in enumerate(names)}
    draw(study.folder / "course.png", by_name, moments)
    table = markdown_table(["claim", *(f"{moment} %" for moment in moments)], [_row(c) for c in by_name.values()])
    text = (
        "Each agent as it was at a share of its own training: P_curriculum, E_curriculum, P_scratch and E_scratch of "
        "self-play, stage 1 and P_random beating random by greedy games from fixed starts. The two differences take "
        "P_random from its end.\n\n" + table
    )
    data = {name: [claim.to_dict(study.is_full) for claim in course] for name, course in by_name.items()}
    return Finding("The claims in the course of training", text, ("course.png",), data={"moments": moments} | data)


def draw(path: Path, by_name: Mapping[str, Sequence[Claim]], moments: Sequence[int]) -> None:
    """A panel for each claim: its seeds at every moment, their mean, and its band, as far as rates can be."""
    with style.picture(path, columns=4, rows=2, width=3.0, height=2.5) as panels:
        for axes, (name, course) in zip(panels, by_name.items(), strict=False):
            seeds = range(len(course[0].seeds))
            curves = [(moments, [100 * claim.seeds[seed][0] for claim in course]) for seed in seeds]
            draw_seeds(axes, curves, palette.PURSUER, "here")
            axes.axhline(100 * course[0].paper, color=palette.INK, linewidth=0.8, linestyle=":")
            seen = [100 * end for claim in course for end in (*claim.interval, claim.paper)]
            axes.set(title=name.replace(": ", ":\n"), xlabel="of training [%]", ylabel="games [%]", xticks=moments)
            axes.set_ylim(min(seen) - 1, max(seen) + 1)
        panels[0].set_ylabel("games [%] (dotted: the paper)")
        for axes in panels[len(by_name) :]:
            axes.set_axis_off()


def claims_at(study: Study, moment: int) -> tuple[Claim, ...]:
    """The paper's seven claims of agents at a percentage of their training, in the order of its figures and tables."""
    captures = [_evaluated(study, "curriculum", seed, moment, [Outcome.CAPTURED]) for seed in study.seeds]
    wins = [_evaluated(study, "random", seed, moment, PURSUER_WINS) for seed in study.seeds]
    first, _, second = table_2_claims(study, moment)
    return (
        rate_claim("stage 1: success", "section IV, Fig. 4", STAGE_1, STAGE_1, captures),
        *figure_6_claims(study, moment),
        first,
        rate_claim("P_random beats random", "Table II", 0.91, 0.91, wins),
        second,
        table_3_claim(study, moment),
    )


def _evaluated(study: Study, name: str, seed: int, moment: int, outcomes: Sequence[Outcome]) -> tuple[int, int]:
    """How many games ended so, and all games, of the last evaluation within a percentage of a run's first stage."""
    evaluations = study.evaluations(name, seed, "fixed-target")
    games = evaluations[max(1, len(evaluations) * moment // 100) - 1].outcomes
    return sum(games[outcome] for outcome in names_of(outcomes)), sum(games.values())


def _row(course: Sequence[Claim]) -> list[str]:
    cells = [f"{percent(claim.mean)} ({', '.join(percent(value) for value, _ in claim.seeds)})" for claim in course]
    return [course[0].name, *cells]


Watch = Callable[[str, Callable[[], tuple[float, float]]], None]
"""Told what begins, and whom to ask about it now and then."""
SECTIONS = (figure_4, figure_5, figure_6, figure_7, table_2, table_3, figure_8, in_training, beyond)
"""In the order of the report."""


def reproduce(
    folder: Path,
    budget: str,
    seeds: int,
    resume: bool,
    games: int = 10_000,
    report: Callable[[str], None] = print,
    on: str = "local",
    watch: Watch = lambda what, poll: None,
) -> bool:
    """Train the agents of all seeds, then make every section and write the report.

    Args:
        folder: of the study.
        budget: name of a training preset.
        seeds: how many, from 0.
        resume: go on with a study that was stopped.
        games: games in a match.
        report: called with every line of progress.
        on: where trainings run, as `run_jobs` has it.
        watch: told what begins, and whom to ask how much of it is done, and of how much.

    Returns:
        Whether it is finished; False after Ctrl-C.

    Raises:
        InvalidInput: for an unknown budget, no seeds or no games, or a folder that holds something already where
            `resume` is not given.
    """
    require(budget in PRESETS, "budget", budget, f"one of {', '.join(PRESETS)}")
    SEEDS.require("seeds", seeds)
    STUDY_GAMES.require("games", games)
    STUDY_GAMES.require("games x seeds", games * seeds)
    is_new = not folder.exists() or not any(folder.iterdir())
    require(resume or is_new, "folder", folder, "a new one, as this one is not empty; choose another or resume it")
    folder.mkdir(parents=True, exist_ok=True)
    study = Study(folder, budget, PRESETS[budget], tuple(range(seeds)), games)
    watch("training the agents", study.work_done)
    if not train_runs(study.trainings(), available_cores(), report, on):
        return False
    findings = []
    watch("playing the matches, drawing the figures", lambda: (len(findings), len(SECTIONS)))
    for section in SECTIONS:
        findings.append(section(study))
        report(f"done: {findings[-1].title}")
    write_report(study, findings)
    return True
