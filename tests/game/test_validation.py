"""Games that nobody can play are refused with the value, the bound and the remedy."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import pytest

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_teams, make_game, paper, randomised
from apollonius.game.reward import Reward
from apollonius.game.scenario import Spread
from apollonius.game.sensing import Drive, Drives, Noise, Sensing, Sensors
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams

NAN, INF = math.nan, math.inf


def discs(*discs):
    return {"arena": Arena(discs=tuple(Disc(*disc) for disc in discs))}


def starts(**numbers):
    return {"starts": Starts(**numbers)}


def spread(field, low, high):
    return lambda: randomised(paper(), [Spread((field,), low, high)])


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
    *[
        ({"arena": Arena(polygons=(Polygon(corners),))}, said)
        for corners, said in (
            (((1.0, 1.0), (3.0, 1.0)), ["2 corners is not possible: it must be 3 to 1000"]),
            (((1.0, 1.0), (3.0, 1.0), (3.0, 11.0)), ["(3, 11)", "inside the walls", "move"]),
            (((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)), ["no place to start"]),
            (((1.0, INF), (3.0, 1.0), (3.0, 11.0)), ["finite number"]),
        )
    ],
    *[
        ({"drives": Drives(evader=Drive(**{name: value}))}, [f"drives.evader.{name} = "])
        for name, value in (("lag", -1), ("lag", 1.5), ("lag", 11), ("turn_time", -0.1), ("turn_time", NAN))
    ],
    *[
        ({"sensors": Sensing(evader=Sensors(**numbers))}, [f"sensors.evader.{said}"])
        for numbers, said in (
            ({"range": -1.0}, "range = -1"),
            ({"range": NAN}, "range = nan"),
            ({"field_of_view": 7.1}, "field_of_view = 7.1"),
            ({"drop_out": 1.1}, "drop_out = 1.1"),
            ({"delay": 11}, "delay = 11"),
            ({"delay": 0.5}, "delay = 0.5"),
            ({"noise": Noise(position=-0.1)}, "noise.position = -0.1"),
            ({"own_noise": Noise(heading=-0.1)}, "own_noise.heading = -0.1"),
        )
    ],
    *[
        (spread(field, low, high), [said])
        for field, low, high, said in (
            ("pursuer.speed", 1.0, 2.0, "'speed' is none of"),
            ("drives.pursuer", 1.0, 2.0, "whole path"),
            ("drives", 1.0, 2.0, "whole path"),
            ("evader", 1.0, 2.0, "whole path"),
            ("pursuer.v_max.x", 1.0, 2.0, "whole path"),
            ("drives.pursuer.lag", 2.0, 1.0, "low = 2"),
            ("drives.pursuer.lag", 0.0, 11.0, "drives.pursuer.lag = "),
            ("sensors.evader.drop_out", 0.0, 1.5, "sensors.evader.drop_out = "),
        )
    ],
    (lambda: in_teams(Game(arena=Arena(x_max=2.5, y_max=2.5)), 9, 9), ["teams = 9 v 9 is not possible", "fit"]),
    (lambda: make_game("team-17v1"), ["pursuers = 17 is not possible"]),
    (lambda: make_game("team-0v1"), ["pursuers = 0 is not possible"]),
    (lambda: make_game("team-3v1").require_two("a policy"), ["robots = 3 v 1", "a policy knows games of two"]),
    (lambda: Game(teams=Teams((Unicycle(v_max=2.0),))).duel("a table"), ["alike on either side"]),
]


@pytest.mark.parametrize(("change", "said"), IMPOSSIBLE, ids=[said[0] for _, said in IMPOSSIBLE])
def test_an_impossible_value_is_named_with_its_bound_and_the_remedy(change, said):
    with pytest.raises(ValueError, match=r"\.$") as refusal:
        change() if callable(change) else Game(**change)
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
        {"sensors": Sensing(evader=Sensors())},
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
