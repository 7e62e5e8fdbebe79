"""Outcomes of a step: capture, failures, the time limit, and their order; winners and counts."""

import functools
import operator
from collections.abc import Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int

from apollonius.game.obstacle import closest_approach_squared
from apollonius.game.types import Flag, Outcome, Real, RobotState
from apollonius.io.errors import require
from apollonius.io.limits import MOST_COUNTED

EVADER_FAILS = (Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE)
"""The evader failed alone."""
PURSUER_WINS = (Outcome.CAPTURED, *EVADER_FAILS)
"""Captured, or the evader failed alone (the win rate of Table II)."""
PURSUER_FAILS = (Outcome.PURSUER_HIT_OBSTACLE, Outcome.PURSUER_OUT_OF_RANGE)
"""The pursuer failed alone."""


def come_within(
    first: tuple[RobotState, RobotState], second: tuple[RobotState, RobotState], distance: Real
) -> Flag:
    """Check whether two centres come closer than a distance [m] anywhere along a step.

    Both robots move along their segments at the same time.
    """
    (before, after), (other_before, other_after) = first, second
    relative_x = other_before.x - before.x
    relative_y = other_before.y - before.y
    approach = closest_approach_squared(
        relative_x,
        relative_y,
        other_after.x - after.x - relative_x,
        other_after.y - after.y - relative_y,
    )
    return approach < distance**2


def decide(
    *,
    captured: Flag,
    pursuer_hit: Flag,
    pursuer_out: Flag,
    evader_hit: Flag,
    evader_out: Flag,
    out_of_time: Flag,
    territory_reached: Flag | None = None,
) -> Int[Array, ""]:
    """Return the one outcome of a step with several events.

    Capture comes first, then failures, then the territory where there is one, then the time limit:
    the order of the cases of Eq. 8 and 9. Two robots that fail in the same step have an outcome of
    their own. A robot that hits an obstacle and leaves the walls in the same step counts as having
    hit the obstacle.

    Args:
        captured: the evader is captured.
        pursuer_hit, evader_hit: the robot hits an obstacle.
        pursuer_out, evader_out: the robot leaves the walls.
        out_of_time: the time limit is reached.
        territory_reached: the evader reaches the territory; None without a territory.
    """
    pursuer_failed = pursuer_hit | pursuer_out
    evader_failed = evader_hit | evader_out
    outcome = jnp.where(out_of_time, Outcome.NO_RESULT, Outcome.ONGOING)
    if territory_reached is not None:
        outcome = jnp.where(territory_reached, Outcome.TERRITORY_REACHED, outcome)
    outcome = jnp.where(evader_out, Outcome.EVADER_OUT_OF_RANGE, outcome)
    outcome = jnp.where(evader_hit, Outcome.EVADER_HIT_OBSTACLE, outcome)
    outcome = jnp.where(pursuer_out, Outcome.PURSUER_OUT_OF_RANGE, outcome)
    outcome = jnp.where(pursuer_hit, Outcome.PURSUER_HIT_OBSTACLE, outcome)
    outcome = jnp.where(pursuer_failed & evader_failed, Outcome.BOTH_FAILED, outcome)
    return jnp.where(captured, Outcome.CAPTURED, outcome)


def pursuer_wins(outcome: Int[Array, "*games"]) -> Bool[Array, "*games"]:
    return is_one_of(PURSUER_WINS, outcome)


def evader_wins(outcome: Int[Array, "*games"], time_limit_wins: bool) -> Bool[Array, "*games"]:
    return is_one_of(evader_winning(time_limit_wins), outcome)


def evader_winning(time_limit_wins: bool) -> tuple[Outcome, ...]:
    """Return the evader's wins: the pursuer failed alone, the territory and, where that wins, the
    time limit.
    """
    by_time = (Outcome.NO_RESULT,) if time_limit_wins else ()
    return (*PURSUER_FAILS, Outcome.TERRITORY_REACHED, *by_time)


def is_one_of(outcomes: Sequence[Outcome], outcome: Int[Array, "*games"]) -> Bool[Array, "*games"]:
    return functools.reduce(operator.or_, (outcome == member for member in outcomes))


def counts_by_name(counts: Sequence[int] | Array | np.ndarray) -> dict[str, int]:
    """Return the numbers of games by the name of their outcome, from counts indexed by `Outcome`.

    Unfinished games are left out, and a territory that was never reached, as most games have none.
    """
    optional = (Outcome.ONGOING, Outcome.TERRITORY_REACHED)
    outcomes = [outcome for outcome in Outcome if outcome not in optional]
    territory = [Outcome.TERRITORY_REACHED] if int(counts[Outcome.TERRITORY_REACHED]) else []
    return {outcome.name.lower(): int(counts[outcome]) for outcome in outcomes + territory}


def require_counts(counts: Mapping[str, int], source: str) -> None:
    """Refuse, by InvalidInput, counts by name that cannot be those of games; `source` is their
    file.
    """
    name, names = f"{source}: outcomes", set(counts_by_name([0] * len(Outcome)))
    complete = names <= set(counts) <= names | {Outcome.TERRITORY_REACHED.name.lower()}
    require(complete, name, ", ".join(counts), ", ".join(sorted(names)))
    plausible = all(0 <= count <= MOST_COUNTED for count in counts.values())
    require(plausible, name, dict(counts), f"counts from 0 to {MOST_COUNTED:,}")


def names_of(outcomes: Sequence[Outcome]) -> list[str]:
    return [outcome.name.lower() for outcome in outcomes]
