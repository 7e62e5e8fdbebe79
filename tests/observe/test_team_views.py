"""What the robots of a team see: each itself, its mates and all opponents, of whom the nearest in play counts."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.teams import Teams
from apollonius.game.types import GameState, RobotState, RobotStatus, Role
from apollonius.observe.view import look, look_from, rows_of

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


def test_views_of_many_games_have_a_row_for_what_each_robot_sees():
    """A mate that is out is seen as such; whose body is whose is not mixed up."""
    role, count = Role.PURSUER, 3
    places, out = np.random.default_rng(0).uniform(0, 9, (20, 5, 2)), np.arange(20) % 2
    states = jax.vmap(lambda at, out: state_of(at[:3], at[3:], ([out, 0, 0], [0, 0])))(
        jnp.asarray(places), jnp.asarray(out)
    )

    def told(view):
        own, opponent = view.own, view.opponent
        mates = jnp.stack([jnp.where(mate.active, mate.body.v_max * mate.state.x, 0) for mate in view.mates])
        one = [own.body.v_max * own.state.x, own.active, opponent.body.v_max * opponent.state.y, jnp.sum(mates)]
        return jnp.stack([jnp.asarray(number, jnp.float32) for number in one])

    of_rows = jax.jit(lambda states: jax.vmap(lambda row: told(look_from(UNLIKE, role, row)))(rows_of(states, role)))
    one_by_one = [jax.vmap(lambda state, n=n: told(look(UNLIKE, state, role, n)))(states) for n in range(count)]
    np.testing.assert_allclose(of_rows(states), jnp.concatenate(one_by_one), rtol=1e-6)
