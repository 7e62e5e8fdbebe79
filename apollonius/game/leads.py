"""How far each evader is from its nearest pursuer, before and after a step: by the line, or by the way."""

import functools

import jax.numpy as jnp

from apollonius.game.chart import Chart
from apollonius.game.teams import nearest
from apollonius.game.types import GameState, RobotState, Scalar


def leads(before: GameState, after: GameState, chart: Chart | None) -> list[tuple[Scalar, Scalar]]:
    """Return each evader's distances [m] from the nearest active pursuer, before and after a step.

    By a chart they are the ways to it, unless the chart lacks one of the two.
    """

    def lead(state: GameState, evader: RobotState) -> Scalar:
        pursuers = state.robots.pursuer
        pursuer = nearest(evader, pursuers, before.active.pursuer, pursuers)
        return jnp.hypot(evader.x - pursuer.x, evader.y - pursuer.y)

    def way(chart: Chart, state: GameState, evader: RobotState) -> Scalar:
        pursuers = zip(state.robots.pursuer, before.active.pursuer, strict=True)
        ways = [
            jnp.where(active, chart.way(robot.x, robot.y, evader.x, evader.y), jnp.inf) for robot, active in pursuers
        ]
        return functools.reduce(jnp.minimum, ways)

    def ends(start: RobotState, end: RobotState) -> tuple[Scalar, Scalar]:
        straight = lead(before, start), lead(after, end)
        if chart is None:
            return straight
        ways = way(chart, before, start), way(chart, after, end)
        known = jnp.isfinite(ways[0]) & jnp.isfinite(ways[1])
        return jnp.where(known, ways[0], straight[0]), jnp.where(known, ways[1], straight[1])

    return [ends(*pair) for pair in zip(before.robots.evader, after.robots.evader, strict=True)]
