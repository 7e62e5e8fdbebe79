"""The report of a training run: how its agents learned, how good they are, and games that they play."""

from collections.abc import Callable, Sequence
from pathlib import Path

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter

from apollonius.agents.built_in import PLAYERS
from apollonius.evaluate.claims import STAGE_1, paper_shares
from apollonius.evaluate.pairings import last_matches
from apollonius.evaluate.result import read_result
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS, names_of
from apollonius.game.types import Outcome
from apollonius.io.document import parse_json, read_bytes
from apollonius.io.errors import require
from apollonius.learn.config import FIXED_TARGET, SELF_PLAY, RunConfig
from apollonius.learn.folder import Evaluation, load_config
from apollonius.learn.metrics import MetricsLine, evaluations_of, load_metrics
from apollonius.learn.stage_config import StageConfig
from apollonius.show import palette
from apollonius.show.report.page import GAMES, ORDER, SEED, Judged, Page, Section, Shown, games_to_show
from apollonius.show.style import Curve, draw_rate, inline_svg, smooth

_POINTS = 300
"""Most points of a curve: more cannot be seen."""
_SIDES = {"pursuer": palette.PURSUER, "evader": palette.EVADER}


def learning_pictures(lines: Sequence[MetricsLine], against: Sequence[str]) -> list[str]:
    """Return curves of greedy games, rewards and losses of a stage as `<svg>` elements, as far as they were measured.

    Args:
        lines: of the run's `metrics.jsonl`, of one stage.
        against: the evaders of stage 1, by name.
    """
    stage = lines[0].stage
    evaluations = evaluations_of(lines, stage)
    pictures = []
    if len(evaluations) > 1:
        fixed = stage == "fixed-target" and list(against) == ["still"]
        label = "How greedy games end, in per cent, over episodes"
        pictures.append(inline_svg(lambda axes: _draw_greedy(axes, evaluations, fixed), label))

    def draw(measured: list[MetricsLine], value: Callable[[MetricsLine, str], float], **about: str) -> None:
        if len(measured) > 1:
            curves = {side: _curve(measured, [value(line, side) for line in measured]) for side in lines[-1].losses}
            label = f"{about['ylabel'].capitalize()} over episodes"
            pictures.append(inline_svg(lambda axes: _draw_sides(axes, curves, **about), label))

    games, updates = [line for line in lines if line.games], [line for line in lines if line.updates]
    rewards = {"title": "reward in training", "ylabel": "mean reward of a game"}
    draw(games, lambda line, side: getattr(line, f"{side}_return"), **rewards)
    losses = {"title": "loss in training", "ylabel": "mean loss of an update", "yscale": "log"}
    draw(updates, lambda line, side: line.losses.get(side, 0.0), **losses)
    return pictures


def _curve(lines: Sequence[MetricsLine], values: list[float]) -> Curve:
    """Return a running mean over a hundredth of the lines against episodes, thinned out."""
    mean = smooth(values, max(1, len(values) // 100))
    every = max(1, len(mean) // _POINTS)
    return [line.episodes for line in lines][::every], mean[::every]


def _draw_greedy(axes: Axes, evaluations: Sequence[Evaluation], fixed: bool) -> None:
    episodes = [evaluation.episodes for evaluation in evaluations]
    games = [sum(evaluation.outcomes.values()) for evaluation in evaluations]

    def draw(outcomes: Sequence[Outcome], colour: str, label: str) -> None:
        times = [sum(evaluation.outcomes.get(name, 0) for name in names_of(outcomes)) for evaluation in evaluations]
        draw_rate(axes, episodes, times, games, colour, label)

    if fixed:
        draw([Outcome.CAPTURED], palette.PURSUER, "captured")
        axes.axhline(100 * STAGE_1, color=palette.INK, linewidth=0.8, linestyle=":", label="the paper, at its end")
    else:
        draw(PURSUER_WINS, palette.PURSUER, "pursuer wins")
        draw(PURSUER_FAILS, palette.EVADER, "pursuer fails")
        draw([Outcome.NO_RESULT], palette.OTHER, "no result")
    axes.set(title="greedy games", xlabel="episodes", ylabel="games [%]", ylim=(0, 103))
    axes.legend()


def _draw_sides(axes: Axes, curves: dict[str, Curve], **about: str) -> None:
    for side, curve in curves.items():
        axes.plot(*curve, color=_SIDES[side], label=side)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.set(xlabel="episodes", **about)
    axes.legend()


def training_page(folder: Path) -> Page:
    """Return the report of the training run in a folder, finished or not.

    Raises:
        InvalidInput: when a file of the run is missing or not what training writes.
    """
    config, lines = load_config(folder / "config.toml", folder), load_metrics(folder / "metrics.jsonl", within=folder)
    plans = {FIXED_TARGET: config.fixed_target, SELF_PLAY: config.self_play}
    stages = {name: plan for name, plan in plans.items() if config.stages in (name, "both")}
    by_stage = {name: [line for line in lines if line.stage == name] for name in stages}
    facts = [_fact(name, by_stage[name], stage) for name, stage in stages.items()]
    matches = load_matches(folder / "evaluation.json")
    sections = [_learning(name, by_stage[name], config, stage) for name, stage in stages.items() if by_stage[name]]
    asked = last_matches(folder, config.game, GAMES, SEED).values()
    games = [shown for match in asked for shown in games_to_show(match)]
    return Page(
        title=f"Training run {folder.resolve().name}",
        summary=f"{_described(config.game)} Stages: {', '.join(stages)}; seed {config.seed}.",
        warnings=_warnings(folder, facts, matches, games),
        matches=matches,
        matches_note=(
            "Greedy agents, judged when the training had ended. Bars go from the pursuer's best outcome to its worst. "
            "Where the paper reports a match between agents trained in the same way, its shares stand beside ours."
        ),
        sections=sections,
        games=games,
        games_note=f"Of {GAMES} games of each pairing from seed {SEED}, {ORDER}",
        facts=[("stage", "env steps", "planned", "episodes", "updates", "minutes", "env steps per second"), *facts],
        config=(folder / "config.toml").read_text("utf-8"),
        command=f"apollonius train --config {folder / 'config.toml'} --out NEW",
    )


def _described(game: Game) -> str:
    arena = game.arena
    obstacles = f"{len(arena.discs)} discs" + (f", {len(arena.polygons)} polygons" if arena.polygons else "")
    obstacles += f", the map {Path(arena.map.file).name}" if arena.map else ""
    return (
        f"Arena {arena.x_max - arena.x_min:g} m by {arena.y_max - arena.y_min:g} m, {obstacles}; "
        f"capture within {game.capture_distance:g} m; at most {game.max_steps * game.dt:g} s."
    )


def _fact(stage: str, lines: Sequence[MetricsLine], plan: StageConfig) -> tuple[str, ...]:
    planned = f"{plan.env_steps:,}"
    if not lines:
        return stage, "0", planned, "0", "0", "-", "-"
    last = lines[-1]
    rate = f"{last.env_steps / last.seconds:,.0f}" if last.seconds else "-"
    counts = f"{last.episodes:,}", f"{last.updates:,}"
    return stage, f"{last.env_steps:,}", planned, *counts, f"{last.seconds / 60:.1f}", rate


def _warnings(folder: Path, facts: list[tuple[str, ...]], matches: list[Judged], games: list[Shown]) -> list[str]:
    """Return the gaps of the run, in words."""
    found = []
    for stage, done, planned, *_ in facts:
        if int(done.replace(",", "")) < int(planned.replace(",", "")):
            found.append(
                f"Not finished: {stage} stands at {done} of {planned} env steps. Go on with: apollonius resume {folder}"
            )
    if not matches:
        found.append("Not judged: the run has no evaluation.json, which apollonius train writes when it has finished.")
    if not games:
        found.append("No games to show: no stage has ended, so there are no agents yet.")
    return found


def load_matches(path: Path) -> list[Judged]:
    """Return the matches of an `evaluation.json`; none where the run was not judged.

    Raises:
        InvalidInput: when it is not what training writes, or leads outside its folder.
    """
    if not path.exists():
        return []
    remedy, run = "remove it, or train again", path.parent.resolve().name
    content = read_bytes(path, "what training wrote", remedy, within=path.parent)
    judged = []
    for name, data in parse_json(content, f"'{path}' has no results of matches; {remedy}").items():
        pair = name.split(" against ")
        require(len(pair) == 2, f"'{path}': match", name, f"NAME against NAME; {remedy}")
        ours = [name if name in PLAYERS else f"{run}/{name}" for name in pair]
        judged.append(Judged(ours[0], ours[1], read_result(data, f"'{path}'"), paper_shares(*pair)))
    return judged


def _learning(stage: str, lines: Sequence[MetricsLine], config: RunConfig, plan: StageConfig) -> Section:
    words = [
        f"Greedy games: {plan.evaluation_games:,} from fixed starts, with Wilson 95 % intervals over games as bands. "
        "Rewards and losses: running means over the games and updates of training, in which players explore."
    ]
    pictures = [Markup(svg) for svg in learning_pictures(lines, against=config.evaders)]
    return Section(f"Learning: {stage}", words, pictures)
