"""What the robots of a team see: each itself, its mates and all opponents, of whom the nearest in play counts."""

from dataclasses import replace

import jax.numpy as jnp
import pytest

from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.teams import Teams
from apollonius.game.types import GameState, RobotState, RobotStatus, Role
from apollonius.observe.view import look

UNLIKE = Game(
    pursuer=Unicycle(v_max=1.0),
    evader=Unicycle(v_max=1.1),
    teams=Teams((Unicycle(v_max=1.2), Unicycle(v_max=1.3)), (Unicycle(v_max=1.4),)),
)
"""Three against two, whose top speeds tell who is who."""


def state_of(pursuers, evaders, statuses):
    robots = BySide(
        *(tuple(RobotState(*map(jnp.float32, (x, y, 0, 0))) for x, y in side) for side in (pursuers, evaders))
    )
    status = BySide(*(tuple(map(jnp.int32, side)) for side in statuses))
    return replace(GameState.at_start(robots), status=status)


@pytest.mark.parametrize(
    ("out", "nearest"),
    [((), 1.4), ((1,), 1.1), ((0,), 1.4), ((0, 1), 1.1)],
    ids=["all play", "the nearest is out", "the other is out", "nobody plays"],
)
def test_the_opponent_is_the_nearest_that_is_in_play(out, nearest):
    evaders = [RobotStatus.CAPTURED if number in out else RobotStatus.ACTIVE for number in range(2)]
    state = state_of([(1, 1), (5, 5), (9, 9)], [(1, 9), (6, 6)], ([0, 0, 0], evaders))
    for number, own in enumerate((1.0, 1.2, 1.3)):
        view = look(UNLIKE, state, Role.PURSUER, number)
        assert view.own.body.v_max == own
        assert {mate.body.v_max for mate in view.mates} == {1.0, 1.2, 1.3} - {own}
        assert float(view.opponent.body.v_max) == pytest.approx(nearest)
