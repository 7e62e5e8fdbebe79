"""Games that nobody can play are refused with the value, the bound and the remedy."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import pytest

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.reward import Reward
from apollonius.game.starts import Starts

NAN, INF = math.nan, math.inf


def discs(*discs):
    return {"arena": Arena(discs=tuple(Disc(*disc) for disc in discs))}


def starts(**numbers):
    return {"starts": Starts(**numbers)}


def misnamed(part, field, name):
    """A part with a name that its constructor's types would not let through."""
    object.__setattr__(part, field, name)
    return part


IMPOSSIBLE = [
    ({"dt": 0.0}, ["dt = 0.0", "more than 0 s", "uses 0.1"]),
    ({"dt": NAN}, ["dt = nan", "a finite number"]),
    ({"capture_distance": 0.0}, ["capture_distance = 0.0", "more than 0 m", "uses 0.3"]),
    ({"max_steps": 0}, ["max_steps = 0", "at least 1", "uses 1000"]),
    ({"pursuer": Unicycle(v_min=2.0, v_max=1.0)}, ["pursuer.v_min = 2.0", "at most v_max = 1.0", "exchange"]),
    ({"evader": Unicycle(v_max=0.0)}, ["evader.v_max = 0.0", "more than 0 m/s"]),
    ({"pursuer": Unicycle(v_max=-INF)}, ["pursuer.v_max = -inf", "a finite number"]),
    ({"pursuer": Unicycle(u1_max=-0.3)}, ["pursuer.u1_max = -0.3", "0 m/s^2 or more"]),
    ({"evader": Unicycle(u2_max=-0.8)}, ["evader.u2_max = -0.8", "0 rad/s or more"]),
    ({"pursuer": Unicycle(u2_max=21.0)}, ["pursuer.u2_max = 21.0", "at most 20 rad/s", "make it or dt smaller"]),
    ({"dt": 4.0}, ["pursuer.u2_max = 0.8", "at most 0.5 rad/s", "in a step of 4 s", "make it or dt smaller"]),
    ({"evader": Unicycle(radius=-0.2)}, ["evader.radius = -0.2", "0 m (a point) or more"]),
    ({"arena": Arena(x_min=10.0)}, ["arena.x_min = 10.0", "less than x_max = 10.0"]),
    ({"arena": Arena(y_min=11.0)}, ["arena.y_min = 11.0", "less than y_max = 10.0"]),
    (discs((3.0, 3.0, 0.0)), ["discs[0].radius = 0.0", "more than 0 m", "remove the disc"]),
    (discs((3.0, 3.0, 0.5), (7.0, 3.0, -0.5)), ["discs[1].radius = -0.5", "more than 0 m", "remove the disc"]),
    (discs((12.0, 3.0, 0.5)), ["discs[0] centre = (12.0, 3.0)", "[0.0, 10.0] x [0.0, 10.0]", "move or remove"]),
    (discs((5.0, 5.0, 8.0)), ["pursuer no place to start", "clearance of 0.3 m", "make the obstacles"]),
    (
        {
            "arena": Arena(x_max=4.0, y_max=4.0, territory=Disc(2.0, 2.0, 0.5)),
            "starts": Starts(clearance=0.5, separation=1.8),  # 2.1 m from the corner of its room to the middle
        },
        ["evader no place to start", "clearance of 0.5 m"],
    ),
    ({"evader": Unicycle(radius=6.0)}, ["evader no place to start", "clearance of 6.3 m", "arena larger"]),
    (
        {"pursuer": Unicycle(radius=4.9), "evader": Unicycle(radius=4.9), **starts(clearance=0.05)},
        ["the robots no place to start", "none of 100,000 pairs", "arena larger"],
    ),
    (starts(clearance=6.0), ["no place to start", "clearance of 6 m", "clearance smaller"]),
    (starts(clearance=-0.1), ["starts.clearance = -0.1", "0 m or more"]),
    (starts(separation=0.2), ["starts.separation = 0.2", "at least capture_distance = 0.3", "before they begin"]),
    (starts(separation=14.0), ["starts.separation = 14.0", "at most 12.", "smaller or the arena larger"]),
    (
        {"evader": Unicycle(radius=4.5), **starts(separation=10.0)},
        ["starts.separation = 10.0", "at most", "smaller or the arena larger"],
    ),
    ({"reward": Reward(capture=NAN)}, ["reward.capture = nan", "a finite number"]),
    ({"reward": Reward(zero_sum_within=0.0)}, ["reward.zero_sum_within = 0.0", "more than 0 m"]),
    ({"reward": misnamed(Reward(), "profile", "fair")}, ["reward.profile = fair", "paper or zero-sum"]),
    ({"starts": misnamed(Starts(), "speed", "fast")}, ["starts.speed = fast", "rest or moving"]),
]


@pytest.mark.parametrize(("change", "said"), IMPOSSIBLE, ids=[said[0] for _, said in IMPOSSIBLE])
def test_an_impossible_value_is_named_with_its_bound_and_the_remedy(change, said):
    with pytest.raises(ValueError, match=r"\.$") as refusal:
        Game(**change)
    message = str(refusal.value)
    assert "\n" not in message
    for words in said:
        assert words in message


@pytest.mark.parametrize(
    "change",
    [
        {"max_steps": 1},
        {"dt": 2.5},
        {"evader": Unicycle(v_min=0.5, v_max=0.5, u1_max=0.0, u2_max=0.0)},
        {"evader": Unicycle(radius=4.5), **starts(separation=6.0)},
        discs((0.0, 10.0, 0.5)),
        starts(clearance=0.0, separation=0.3),
        starts(separation=12.5),
    ],
)
def test_values_just_within_their_bounds_are_accepted(change):
    Game(**change)


def test_numbers_that_are_being_swept_are_left_unchecked():
    """Inside a `vmap` the values are not known, and must not stop the sweep."""
    sweep = jax.vmap(lambda dt: replace(Game(), dt=dt).dt)
    assert sweep(jnp.asarray([0.1, 0.2])).shape == (2,)
