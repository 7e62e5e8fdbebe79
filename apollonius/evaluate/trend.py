"""What became of self-play from the first look at it to the last, in words."""

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

from apollonius.game.outcome import PURSUER_WINS, names_of

_MUCH = 0.1
"""A fall of the pursuer's wins that wants a word."""


@runtime_checkable
class Look(Protocol):
    """A greedy evaluation in the course of a training."""

    @property
    def env_steps(self) -> int:
        """Env steps before it."""
        ...

    @property
    def outcomes(self) -> Mapping[str, int]:
        """Games by outcome."""
        ...


def self_play_trend(looks: Sequence[Look]) -> str:
    """How greedy games ended at the first look at self-play and at the last, and where wins went that were lost.

    Args:
        looks: in their order.

    Returns:
        Some sentences; empty where there are fewer than two looks.
    """
    if len(looks) < 2:
        return ""
    first, last = (_shares(look.outcomes) for look in (looks[0], looks[-1]))
    parts = [f"{what} from {first[what]:.0%} to {last[what]:.0%}" for what in list(first)[1:]]
    said = (
        f"Self-play, greedy games, from {looks[0].env_steps:,} to {looks[-1].env_steps:,} env steps: "
        f"the pursuer's wins went from {first['wins']:.0%} to {last['wins']:.0%}: {', '.join(parts)}."
    )
    fallen, given = (first[what] - last[what] for what in ("wins", "the evader's own failures"))
    if fallen >= _MUCH and given >= fallen / 2:
        said += (
            " So most of the early wins were the evader's own mistakes, which it has learned to avoid; catching one "
            "that makes none is the harder task, and what the pursuer still wins is the measure of it."
        )
    return said


def _shares(outcomes: Mapping[str, int]) -> dict[str, float]:
    games = max(1, sum(outcomes.values()))
    wins = sum(outcomes.get(name, 0) for name in names_of(PURSUER_WINS)) / games
    captured = outcomes.get("captured", 0) / games
    return {
        "wins": wins,
        "captures": captured,
        "the evader's own failures": wins - captured,
        "games without result": outcomes.get("no_result", 0) / games,
    }
