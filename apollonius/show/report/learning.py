"""How a stage of training went: greedy games, rewards and losses over episodes, as pictures for a page."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter

from apollonius.evaluate.claims import STAGE_1
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS, names_of
from apollonius.game.types import Outcome
from apollonius.learn.checkpoint import Evaluation
from apollonius.learn.progress import MetricsLine, evaluations_of
from apollonius.show import palette
from apollonius.show.curves import Curve, draw_rate, smooth
from apollonius.show.style import inline_svg

_POINTS = 300
"""Most points of a curve: more cannot be seen."""
_SIDES = {"pursuer": palette.PURSUER, "evader": palette.EVADER}


def learning_pictures(lines: Sequence[MetricsLine], against: Sequence[str]) -> list[str]:
    """Greedy games, mean rewards and mean losses of a stage as `<svg>` elements; what was not measured is left out.

    Args:
        lines: of the run's `metrics.jsonl`, of one stage.
        against: the evaders of stage 1, by name.
    """
    stage = lines[0].stage
    evaluations = evaluations_of(lines, stage)
    learning = [line for line in lines if line.updates]
    pictures = []
    if len(evaluations) > 1:
        fixed = stage == "fixed-target" and list(against) == ["still"]
        label = "How greedy games end, in per cent, over episodes"
        pictures.append(inline_svg(lambda axes: _draw_greedy(axes, evaluations, fixed), label))
    sides = list(lines[-1].losses)
    played = [line for line in lines if line.games]
    if len(played) > 1:
        rewards = {side: _curve(played, [getattr(line, f"{side}_return") for line in played]) for side in sides}
        pictures.append(inline_svg(lambda axes: _draw_rewards(axes, rewards), "Mean reward of a game over episodes"))
    if len(learning) > 1:
        losses = {side: _curve(learning, [line.losses.get(side, 0.0) for line in learning]) for side in sides}
        pictures.append(inline_svg(lambda axes: _draw_losses(axes, losses), "Mean loss of an update over episodes"))
    return pictures


def _curve(lines: Sequence[MetricsLine], values: list[float]) -> Curve:
    """A running mean over a hundredth of the lines against episodes, thinned out."""
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


def _draw_rewards(axes: Axes, rewards: dict[str, Curve]) -> None:
    _draw_sides(axes, rewards)
    axes.set(title="reward in training", xlabel="episodes", ylabel="mean reward of a game")


def _draw_losses(axes: Axes, losses: dict[str, Curve]) -> None:
    _draw_sides(axes, losses)
    axes.set(title="loss in training", xlabel="episodes", ylabel="mean loss of an update", yscale="log")


def _draw_sides(axes: Axes, curves: dict[str, Curve]) -> None:
    for side, curve in curves.items():
        axes.plot(*curve, color=_SIDES[side], label=side)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.legend()
