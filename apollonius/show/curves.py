"""Curves of a training run for its report: how its greedy games end, rewards and losses."""

from collections.abc import Callable, Sequence

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter

from apollonius.evaluate.claims import STAGE_1
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS, names_of
from apollonius.game.types import Outcome
from apollonius.learn.folder import Evaluation
from apollonius.learn.metrics import MetricsLine
from apollonius.show import palette
from apollonius.show.style import Curve, draw_rate, inline_svg, smooth

_POINTS = 300
"""Most points of a curve: more cannot be seen."""


def learning_pictures(lines: Sequence[MetricsLine], against: Sequence[str]) -> list[Markup]:
    """Return curves of greedy games, rewards and losses of a stage as `<svg>` elements, if they
    were measured.
    """
    stage = lines[0].stage
    evaluations = [line.evaluation for line in lines if line.evaluation]
    pictures = []
    if len(evaluations) > 1:
        fixed = stage == "fixed-target" and list(against) == ["still"]
        label = "How greedy games end, in per cent, over env steps"
        pictures.append(inline_svg(lambda axes: _draw_greedy(axes, evaluations, fixed), label))

    def draw(
        metric_lines: list[MetricsLine], value: Callable[[MetricsLine, str], float], **about: str
    ) -> None:
        if len(metric_lines) > 1:
            curves = {
                side: _curve(metric_lines, [value(line, side) for line in metric_lines])
                for side in lines[-1].losses
            }
            label = f"{about['ylabel'].capitalize()} over env steps"
            pictures.append(inline_svg(lambda axes: _draw_sides(axes, curves, **about), label))

    games = [line for line in lines if line.games]
    updates = [line for line in lines if line.updates]
    rewards = {"title": "reward in training", "ylabel": "mean reward of a game"}
    draw(games, lambda line, side: getattr(line, f"{side}_return"), **rewards)
    losses = {"title": "loss in training", "ylabel": "mean loss of an update", "yscale": "log"}
    draw(updates, lambda line, side: line.losses.get(side, 0.0), **losses)
    return [Markup(picture) for picture in pictures]


def _curve(lines: Sequence[MetricsLine], values: list[float]) -> Curve:
    """Return a running mean over a hundredth of the lines against env steps, thinned out."""
    mean = smooth(values, max(1, len(values) // 100))
    every = max(1, len(mean) // _POINTS)
    return [line.env_steps for line in lines][::every], mean[::every]


def _draw_greedy(axes: Axes, evaluations: Sequence[Evaluation], fixed: bool) -> None:
    steps = [evaluation.env_steps for evaluation in evaluations]
    games = [sum(evaluation.outcomes.values()) for evaluation in evaluations]

    def draw(outcomes: Sequence[Outcome], colour: str, label: str) -> None:
        times = [
            sum(evaluation.outcomes.get(name, 0) for name in names_of(outcomes))
            for evaluation in evaluations
        ]
        draw_rate(axes, steps, times, games, colour, label)

    if fixed:
        draw([Outcome.CAPTURED], palette.PURSUER, "captured")
        axes.axhline(
            100 * STAGE_1,
            color=palette.INK,
            linewidth=0.8,
            linestyle=":",
            label="the paper, at its end",
        )
    else:
        draw(PURSUER_WINS, palette.PURSUER, "pursuer wins")
        draw(PURSUER_FAILS, palette.EVADER, "pursuer fails")
        draw([Outcome.NO_RESULT], palette.OTHER, "no result")
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.set(title="greedy games", xlabel="env steps", ylabel="games [%]", ylim=(0, 103))
    axes.legend()


def _draw_sides(axes: Axes, curves: dict[str, Curve], **about: str) -> None:
    for side, curve in curves.items():
        axes.plot(*curve, color=palette.LIGHT[side], label=side)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.set(xlabel="env steps", **about)
    axes.legend()
