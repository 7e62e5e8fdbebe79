"""What a robot sees (Eq. 6, 7), number by number."""

import math

import jax
import numpy as np

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.types import Role
from tests.acting import observe as observe_one
from tests.acting import state

GAME = Game(
    pursuer=Unicycle(v_min=-0.5, v_max=1.5, u1_max=0.5, radius=0.1),
    evader=Unicycle(v_max=2.0, u1_max=1.0),
    arena=Arena(0.0, 8.0, -2.0, 2.0, discs=(Disc(6.0, 0.0, 0.5),)),
)
observe = jax.jit(observe_one, static_argnames=("role", "name"))


PURSUER, EVADER = (2.0, 1.0, 1.0, math.pi / 2), (4.0, 0.0, 1.0, 0.0)


def test_paper_scales_positions_and_speeds_to_their_limits_and_headings_by_pi():
    own, opponent = [-0.5, 0.5, 0.5, 0.5], [0.0, 0.0, 0.0, 0.0]
    seen = observe(GAME, state(PURSUER, EVADER), Role.PURSUER, "paper")
    np.testing.assert_allclose(seen, own + opponent, atol=1e-6)
    seen = observe(GAME, state(PURSUER, EVADER), Role.EVADER, "paper")
    np.testing.assert_allclose(seen, opponent + own, atol=1e-6)


def test_encoded_number_by_number():
    """The pursuer looks up: the evader is 1 m behind and 2 m to its right, and it would stop on the wall."""
    seen = observe(GAME, state(PURSUER, EVADER), Role.PURSUER, "encoded")
    own, opponent = [-0.5, 0.5, 0.5, 0, 1], [0, 0, 0, 1, 0]
    relative = [-1 / 8, -2 / 8, math.sqrt(5) / 8]
    own_clearances = [1.0 - 0.1, 0.0 - 0.1]
    opponent_clearances = [1.0, 1.0]
    np.testing.assert_allclose(seen, own + opponent + relative + own_clearances + opponent_clearances, atol=1e-6)


def test_encoded_warns_of_a_disc_in_the_braking_distance():
    """At 2 m/s and 1 m/s^2 the evader stops after 2 m, in the middle of the disc 2 m ahead of it."""
    seen = observe(GAME, state(PURSUER, (4.0, 0.0, 2.0, 0.0)), Role.EVADER, "encoded")
    np.testing.assert_allclose(seen[13:15], [1.0, -0.5], atol=1e-6)
