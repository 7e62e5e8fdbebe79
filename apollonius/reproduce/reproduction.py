"""The figures 4 to 8 of the paper, its Tables II and III, and the whole evaluation: from trainings
to a report.
"""

from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from apollonius import Outcome
from apollonius.evaluate.claims import STAGE_1, TABLE_2, TABLE_3, Claim
from apollonius.evaluate.match import record_game
from apollonius.evaluate.statistics import Prediction, predict
from apollonius.game.outcome import pursuer_wins
from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import SEEDS, STUDY_GAMES
from apollonius.io.workers import Job, JobRunner, run_jobs
from apollonius.learn.config import PRESETS
from apollonius.learn.folder import agent_file, create_run, load_config
from apollonius.learn.run import train
from apollonius.play.playout import Report, no_report
from apollonius.play.replay import Replay
from apollonius.reproduce.finding import (
    Finding,
    Matches,
    beside_the_paper,
    differences,
    markdown_table,
    rates,
    results_data,
    undefeated,
    won,
    write_report,
)
from apollonius.reproduce.study import Study
from apollonius.show import palette, style
from apollonius.show.animation import last_frame
from apollonius.show.style import Curve, draw_seeds, draw_strips, smooth

_WINDOW = 50
"""Chunks over which the reward is averaged."""
MOMENTS = (25, 75, 100)
"""Percentages of self-play, where agents are kept; the paper's Fig. 5 shows 23, 80 and 100 %."""


COURSE = (25, 50, 75, 100)
"""Percentages of self-play after which agents of several seeds meet."""


def figure_4(study: Study) -> Finding:
    """Draw success rate and average reward in stage 1, over episodes."""
    successes, rewards = [], []
    for seed in study.seeds:
        lines = study.metrics("curriculum", seed, "fixed-target")
        evaluations = [line.evaluation for line in lines if line.evaluation]
        games = sum(evaluations[0].outcomes.values())
        success = [100 * evaluation.outcomes["captured"] / games for evaluation in evaluations]
        successes.append(([evaluation.episodes for evaluation in evaluations], success))
        rewards.append(_rewards(study, "curriculum", seed, "fixed-target"))
    with style.picture(study.folder / "figure4.png", columns=2) as (success_axes, reward_axes):
        draw_seeds(success_axes, successes, palette.PURSUER, "greedy")
        success_axes.axhline(
            100 * STAGE_1,
            color=palette.INK,
            linewidth=0.8,
            ls=":",
            label="the paper, 200,000 episodes",
        )
        success_axes.set(
            title="success rate in stage 1", xlabel="episodes", ylabel="captured [%]", ylim=(0, 102)
        )
        success_axes.legend(loc="lower right")
        draw_seeds(reward_axes, rewards, palette.PURSUER, "exploring")
        reward_axes.set(title="average reward of an episode", xlabel="episodes", ylabel="reward")
        reward_axes.legend(loc="lower right")
    episodes = ", ".join(f"{x[-1]:,}" for x, _ in successes)
    text = (
        "Left: greedy games from fixed starts. Right: the games of training. "
        f"Episodes in all, by seed: {episodes}."
    )
    matches = study.matches("P_stage1", "still")
    data = {"success": successes} | results_data({"matches": matches})
    return Finding("Fig. 4: stage 1", text, ("figure4.png",), (stage_1(matches),), data)


def stage_1(matches: Matches) -> Claim:
    """Return the claim that stage 1 learns to reach a standing evader."""
    return Claim("stage 1: success", "section IV, Fig. 4", STAGE_1, STAGE_1, rates(matches, won))


def _rewards(study: Study, name: str, seed: int, stage: str) -> Curve:
    """Return the episodes of a stage, and the running mean of the exploring pursuer's reward in an
    episode.
    """
    lines = [line for line in study.metrics(name, seed, stage) if line.games]
    return [line.episodes for line in lines], smooth(
        [line.pursuer_return for line in lines], _WINDOW
    )


def figure_5(study: Study) -> Finding:
    """Draw the first game of the match between both sides of the first seed, as they were at each
    moment.
    """
    seed, games = study.seeds[0], {}
    for percent in MOMENTS:
        match = study.pairing("P_curriculum", "E_curriculum", (seed, seed), percent)
        games[f"after {percent} % of self-play"] = record_game(match, index=0)
    ends = _draw_games(games, study.folder / "figure5.png")
    moments = "; ".join(f"{percent} %: {end}" for percent, end in zip(MOMENTS, ends, strict=True))
    return Finding(
        "Fig. 5: one start in the course of self-play",
        f"{moments}.",
        ("figure5.png",),
        data={"ends": ends},
    )


def _draw_games(games: dict[str, Replay], path: Path) -> list[str]:
    """Draw the ends of games side by side, each above its name, and return how they ended."""
    with style.picture(path, columns=len(games), width=3.2, height=4.0) as panels:
        for axes, (name, replay) in zip(panels, games.items(), strict=True):
            axes.imshow(last_frame(replay))
            axes.set_title(name)
            axes.set_axis_off()
    return [replay.ending() for replay in games.values()]


def figure_6(study: Study) -> Finding:
    """Draw how often pursuers of the curriculum win, and its evaders stay undefeated, against
    agents from scratch.
    """
    chasing = study.matches("P_curriculum", "E_scratch")
    fleeing = study.matches("P_scratch", "E_curriculum")
    claims = (
        Claim("P_curriculum beats E_scratch", "Fig. 6", 0.70, 0.70, rates(chasing, won)),
        Claim(
            "E_curriculum undefeated by P_scratch", "Fig. 6", 0.70, 0.70, rates(fleeing, undefeated)
        ),
    )
    names = ["P_curriculum wins\nagainst E_scratch", "E_curriculum undefeated\nby P_scratch"]
    # a row for each training of the curriculum
    ours = claims[0].values, [*zip(*claims[1].values, strict=True)]
    with style.picture(study.folder / "figure6.png") as (axes,):
        draw_strips(
            axes, names, ours, [claim.prediction.interval for claim in claims], palette.SIDES
        )
        axes.axhline(70, color=palette.INK, linewidth=0.8, linestyle=":")
        axes.set_title("against agents from scratch (dotted: the paper's 70 %)")
    text = beside_the_paper(
        {"P_curriculum v E_scratch": chasing, "P_scratch v E_curriculum": fleeing}, paper={}
    )
    text += (
        "\n\nEach coloured line is one training of the curriculum, from its worst to its best "
        "against the trainings from scratch, with a dot at its mean. The black line is where "
        "another pair would lie with 95 %."
    )
    data = results_data({"chasing": chasing, "fleeing": fleeing})
    return Finding("Fig. 6: curriculum against scratch", text, ("figure6.png",), claims, data)


def figure_6_in_course(study: Study) -> Finding:
    """Draw the claims of Fig. 6 in the course of self-play: agents meet those that have trained as
    long. Several seeds predict where another pair would lie.
    """
    pairings = {
        "P_curriculum beats E_scratch": ("P_curriculum", "E_scratch", won),
        "E_curriculum undefeated by P_scratch": ("P_scratch", "E_curriculum", undefeated),
    }
    predictions = {
        name: [
            predict(np.array(rates(study.matches(pursuer, evader, percent), share)), 0.0, 1.0)
            for percent in COURSE
        ]
        for name, (pursuer, evader, share) in pairings.items()
    }
    with style.picture(study.folder / "figure6-course.png", width=6.0) as (axes,):
        for (name, course), colour in zip(predictions.items(), palette.SIDES, strict=True):
            means = [100 * prediction.mean for prediction in course]
            low, high = 100 * np.transpose([prediction.interval for prediction in course])
            axes.fill_between(COURSE, low, high, color=colour, alpha=0.15, linewidth=0)
            axes.plot(COURSE, means, "o-", color=colour, label=name)
        axes.axhline(70, color=palette.INK, linewidth=0.8, linestyle=":")
        axes.set(xlabel="self-play [%]", ylabel="games [%]", ylim=(0, 103))
        axes.set_title("mean of all pairs, and where another would lie (dotted: the paper)")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2)
    rows = [
        [f"{percent} %", *map(_with_chance, row)]
        for percent, *row in zip(COURSE, *predictions.values(), strict=True)
    ]
    table = markdown_table(["self-play", *predictions], rows)
    data = {
        name: [
            {"percent": percent, "mean": prediction.mean, "interval": prediction.interval}
            for percent, prediction in zip(COURSE, course, strict=True)
        ]
        for name, course in predictions.items()
    }
    text = f"Mean over pairs [95 % prediction], chance of 70 %.\n\n{table}"
    title = "Fig. 6 in the course of self-play"
    return Finding(title, text, ("figure6-course.png",), data=data)


def _with_chance(prediction: Prediction) -> str:
    """Return a prediction in words: its mean, its interval, and the chance of 70 %."""
    low, high = prediction.interval
    chance = prediction.chance(0.7)
    words = f"{prediction.mean:.1%} [{low:.0%}, {high:.0%}]"
    return words if chance is None else f"{words}, {chance:.0%}"


def figure_7(study: Study) -> Finding:
    """Draw the pursuer's reward over all episodes: the curriculum's, and against the random evader
    throughout.
    """
    curriculum = [_both_stages(study, seed) for seed in study.seeds]
    random = [_rewards(study, "random", seed, "fixed-target") for seed in study.seeds]
    with style.picture(study.folder / "figure7.png", width=6.0) as (axes,):
        draw_seeds(axes, curriculum, palette.PURSUER, "curriculum")
        draw_seeds(axes, random, palette.OTHER, "trained on a random evader")
        axes.set(
            title="average reward of the pursuer in training",
            xlabel="episodes",
            ylabel="reward of an episode",
        )
        axes.legend()
    text = (
        "Exploring players, as in training. Self-play weighs progress with another c than "
        "stage 1 and than training on a random evader, so the level changes where it begins. It "
        "begins after different numbers of episodes with different seeds, and there their band "
        "is widest."
    )
    return Finding("Fig. 7: average reward", text, ("figure7.png",))


def _both_stages(study: Study, seed: int) -> Curve:
    """Return the rewards of the curriculum; self-play's episodes are counted on from those of stage
    1.
    """
    episodes, rewards = _rewards(study, "curriculum", seed, "fixed-target")
    later, more = _rewards(study, "curriculum", seed, "self-play")
    return [*episodes, *(episodes[-1] + episode for episode in later)], [*rewards, *more]


def figure_8(study: Study) -> Finding:
    """Draw the first game in which P_random crashes and P_curriculum wins, or else the first that
    it loses.
    """
    seed = study.seeds[0]
    curriculum_outcome, random_outcome = (
        study.play(name, "E_scratch", (seed, seed)).outcome for name in ("P_curriculum", "P_random")
    )
    is_example = pursuer_wins(curriculum_outcome) & (random_outcome == Outcome.PURSUER_HIT_OBSTACLE)
    if not is_example.any():
        is_example = random_outcome != Outcome.CAPTURED
    index, pursuers = int(jnp.argmax(is_example)), ("P_random", "P_curriculum")
    games = {
        f"{name} against E_scratch": record_game(
            study.pairing(name, "E_scratch", (seed, seed)), index
        )
        for name in pursuers
    }
    endings = _draw_games(games, study.folder / "figure8.png")
    ends = [f"{name}: {end}" for name, end in zip(pursuers, endings, strict=True)]
    text = f"Game {index} of the match. {'; '.join(ends)}."
    return Finding(
        "Fig. 8: the same start", text, ("figure8.png",), data={"game": index, "ends": ends}
    )


def table_2(study: Study) -> Finding:
    """Play both pursuers against the random evader: wins, and direct captures."""
    results = {name: study.matches(name, "random") for name in TABLE_2}
    pair = "P_random", "P_curriculum"
    captures = [
        rates(results[name], lambda match: match.outcomes["captured"] / match.games)
        for name in pair
    ]
    claims = (
        Claim(
            "P_curriculum beats random", "Table II", 0.93, 0.93, rates(results["P_curriculum"], won)
        ),
        Claim("P_random beats random", "Table II", 0.91, 0.91, rates(results["P_random"], won)),
        Claim(
            "direct captures of random: P_random minus P_curriculum",
            "Table II",
            (336 - 62) / 500,
            0.2,
            differences(*captures),
            least=-1.0,
        ),
    )
    text = beside_the_paper(results, TABLE_2)
    return Finding(
        "Table II: against the random evader", text, claims=claims, data=results_data(results)
    )


def table_3(study: Study) -> Finding:
    """Play both pursuers against the evader of self-play from scratch."""
    results = {name: study.matches(name, "E_scratch") for name in TABLE_3}
    wins = [rates(results[name], won) for name in ("P_curriculum", "P_random")]
    claim = Claim(
        "wins against E_scratch: P_curriculum minus P_random",
        "Table III",
        0.706 - 0.434,
        0.1,
        differences(*wins),
        least=-1.0,
    )
    text = beside_the_paper(results, TABLE_3)
    return Finding(
        "Table III: against E_scratch", text, claims=(claim,), data=results_data(results)
    )


SECTIONS = (figure_4, figure_5, figure_6, figure_7, table_2, table_3, figure_8)
"""In the order of the report."""
SECTIONS_OF_SEEDS = (*SECTIONS[:3], figure_6_in_course, *SECTIONS[3:])
"""Reproductions of several seeds."""


def reproduce(
    folder: Path,
    budget: str,
    seeds: int,
    resume: bool,
    games: int = 10_000,
    report: Callable[[str], None] = print,
    run: JobRunner = run_jobs,
    begin: Callable[[str], None] = lambda what: None,
    progress: Report = no_report,
) -> None:
    """Train the agents, make every section and write the report.

    Args:
        folder: Folder of the study.
        budget: Preset of the trainings.
        seeds: Number of seeds, from 0.
        resume: Whether the folder may hold a study that was stopped.
        games: Games of a match.
        report: Called with a line at the end of each section.
        run: Runs the trainings as jobs.
        begin: Called with the name of each section at its beginning.
        progress: Called with the finished games of a section and all its games.

    Raises:
        InvalidInput: For impossible numbers, and for a folder that is not empty unless `resume` is
            set.
    """
    require(budget in PRESETS, "budget", budget, f"one of {', '.join(PRESETS)}")
    SEEDS.require("seeds", seeds)
    STUDY_GAMES.require("games", games)
    STUDY_GAMES.require("games x seeds", games * seeds)
    is_new = not folder.exists() or not any(folder.iterdir())
    require(
        resume or is_new,
        "folder",
        folder,
        "a new one, as this one is not empty; choose another or resume it",
    )
    folder.mkdir(parents=True, exist_ok=True)
    study = Study(folder, budget, tuple(range(seeds)), games, progress)
    _train_missing(study, report, run)
    findings = []
    for section in SECTIONS if seeds == 1 else SECTIONS_OF_SEEDS:
        begin(f"playing and drawing {section.__name__.replace('_', ' ')}")
        findings.append(section(study))
        report(f"done: {findings[-1].title}")
    write_report(study, findings)


def _train_missing(study: Study, report: Callable[[str], None], run: JobRunner) -> None:
    """Train the runs that are not finished, or resume them.

    Raises:
        InvalidInput: If a folder holds another training, before anything is trained; if a training
            fails, after the
            others.
    """
    unfinished: list[Path] = []
    for folder, (config, agents) in study.trainings().items():
        if not (folder / "config.toml").is_file():
            create_run(config, folder)
        elif load_config(folder / "config.toml") != config:
            raise InvalidInput(
                f"'{folder}' holds another training than this one: choose another folder."
            )
        if not all(agent_file(folder, agent).is_file() for agent in agents):
            unfinished.append(folder)
    report(f"{len(unfinished)} of {len(study.trainings())} trainings to do")
    if unfinished:
        run(
            [
                Job(f"the training in '{folder}'", train, (folder.absolute(),))
                for folder in unfinished
            ]
        )
