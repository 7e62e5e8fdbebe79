"""The rewards of a step: the paper's (Eq. 8, 9) or the zero-sum profile; and progress, by the line
or by the way.
"""

import functools
import operator
from collections.abc import Sequence
from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.game.chart import Chart
from apollonius.game.judge import RobotEvents
from apollonius.game.outcome import evader_wins, pursuer_wins
from apollonius.game.teams import nearest, separation
from apollonius.game.types import BySide, GameState, Outcome, Real, RobotState, Scalar
from apollonius.io.errors import require


class Reward(eqx.Module):
    """The rewards of both sides.

    Attributes:
        profile: `paper` (Eq. 8, 9) or `zero-sum` (+1 to the winner, -1 to the loser, 0 before the
            end and when both fail in one step).
        capture: paid to the pursuer for a capture and taken from the evader (Eq. 8, 9); the other
            way round when the evader reaches a territory.
        failure: taken from a robot that hits an obstacle or leaves the walls (Eq. 8, 9).
        progress: weight c of the change in distance, per metre (Eq. 8, 9).
        along_paths: pay progress along the shortest way between the robots (`Chart.way`) instead of
            the straight line: before a wall standing still pays no more than driving round. The
            game needs charts (`apollonius.arenas.charting`).
    """

    profile: Literal["paper", "zero-sum"] = eqx.field(static=True, default="paper")
    capture: Real = 10.0
    failure: Real = 10.0
    progress: Real = 3.0
    along_paths: bool = eqx.field(static=True, default=False)

    @property
    def time_limit_wins(self) -> bool:
        """Check whether outliving the time limit is the evader's win (and so terminal) rather than
        a truncation.
        """
        return self.profile == "zero-sum"

    def check(self) -> None:
        """Refuse impossible names and numbers."""
        require(
            self.profile in ("paper", "zero-sum"),
            "reward.profile",
            self.profile,
            "paper or zero-sum",
        )

    def __call__(
        self,
        outcome: Int[Array, ""],
        robots: BySide[tuple[RobotEvents, ...]],
        leads: Sequence[tuple[Scalar, Scalar]],
    ) -> BySide[tuple[Scalar, ...]]:
        """Return every robot's reward for one step.

        In the paper's profile pursuers share their rewards: for each capture, and for the progress
        of the nearest pursuer towards each evader. An evader is paid for its own lead over that
        pursuer. A robot that fails pays for it and has no share in the rest, but in the step that
        captures the last evader no pursuer pays, as capture comes first. Robots are paid for
        progress when only an opponent failed, as Eq. 8 and 9 have no case for that, and nothing
        once they are out of play.

        The zero-sum profile pays all robots of a side by how the game ends, those out of play too.
        """
        if self.profile == "zero-sum":
            win = pursuer_wins(outcome).astype(jnp.float32)
            loss = evader_wins(outcome, self.time_limit_wins).astype(jnp.float32)
            return BySide((win - loss,) * len(robots.pursuer), (loss - win,) * len(robots.evader))
        territory_reached = outcome == Outcome.TERRITORY_REACHED
        captured = outcome == Outcome.CAPTURED
        gains = [self.progress * (before - after) for before, after in leads]
        shares = [
            jnp.where(evader.captured, self.capture, jnp.where(evader.active, gain, 0.0))
            for evader, gain in zip(robots.evader, gains, strict=True)
        ]
        pursuers_reward = jnp.where(
            territory_reached, -self.capture, functools.reduce(operator.add, shares)
        )

        def pursuer(robot: RobotEvents) -> Scalar:
            return jnp.where(
                robot.failed & ~captured,
                -self.failure,
                jnp.where(robot.active, pursuers_reward, 0.0),
            )

        def evader(robot: RobotEvents, gain: Scalar) -> Scalar:
            lead_reward = jnp.where(territory_reached, self.capture, -gain)
            in_play = jnp.where(
                robot.failed, -self.failure, jnp.where(robot.active, lead_reward, 0.0)
            )
            return jnp.where(robot.captured, -self.capture, in_play)

        return BySide(tuple(map(pursuer, robots.pursuer)), tuple(map(evader, robots.evader, gains)))


def nearest_distances(
    before: GameState, after: GameState, chart: Chart | None
) -> list[tuple[Scalar, Scalar]]:
    """Return each evader's distances [m] from the nearest active pursuer, before and after a step.

    With a chart they are path lengths, unless the chart lacks one of the two.
    """

    def distance(state: GameState, evader: RobotState) -> Scalar:
        pursuers = state.robots.pursuer
        pursuer = nearest(evader, pursuers, before.in_play.pursuer, pursuers)
        return separation(pursuer, evader)

    def path_length(chart: Chart, state: GameState, evader: RobotState) -> Scalar:
        pursuers = zip(state.robots.pursuer, before.in_play.pursuer, strict=True)
        lengths = [
            jnp.where(
                active, chart.shortest_path_length(robot.x, robot.y, evader.x, evader.y), jnp.inf
            )
            for robot, active in pursuers
        ]
        return functools.reduce(jnp.minimum, lengths)

    def distances_of(start: RobotState, end: RobotState) -> tuple[Scalar, Scalar]:
        straight = distance(before, start), distance(after, end)
        if chart is None:
            return straight
        first = path_length(chart, before, start)
        last = path_length(chart, after, end)
        has_paths = jnp.isfinite(first) & jnp.isfinite(last)
        return jnp.where(has_paths, first, straight[0]), jnp.where(has_paths, last, straight[1])

    evaders = zip(before.robots.evader, after.robots.evader, strict=True)
    return [distances_of(start, end) for start, end in evaders]
