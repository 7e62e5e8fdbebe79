"""The paper's claims in the course of training: what appears early and fades, and what never appears."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from apollonius import Outcome
from apollonius.evaluate.claims import STAGE_1, Claim, rate_claim
from apollonius.game.outcome import PURSUER_WINS, names_of
from apollonius.reproduce.figures import figure_6_claims
from apollonius.reproduce.finding import Finding, markdown_table, percent
from apollonius.reproduce.study import Study
from apollonius.reproduce.tables import table_2_claims, table_3_claim
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
