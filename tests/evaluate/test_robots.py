"""Robots of a match between teams are counted, and each has a shield made for its own limits."""

import jax.numpy as jnp
import pytest

from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.robots import count_robots
from apollonius.game.by_side import BySide

UNLIKE = """
max_steps = 400
evaders = 2
[[pursuers]]
v_max = 1.6
u1_max = 0.3
[[pursuers]]
v_max = 0.8
radius = 0.25
"""


def test_robots_are_counted_by_their_status():
    counts = count_robots(BySide((jnp.array([0, 2, 3]), jnp.array([0, 0, 2])), (jnp.array([1, 1, 3]),)))
    assert counts.pursuers == {"active": 3, "captured": 0, "hit_obstacle": 2, "out_of_range": 1}
    assert counts.evaders == {"active": 0, "captured": 2, "hit_obstacle": 0, "out_of_range": 1}
    assert (counts.captured, counts.lost) == (2, BySide(3, 1))
    assert count_robots(BySide((jnp.array([4, 0]),), (jnp.array([0, 0]),))).pursuers["hit_mate"] == 1


@pytest.mark.slow
def test_shields_hold_back_robots_of_unlike_limits_each_by_its_own(tmp_path):
    """At random robots crash, as the evaders do, who have no shield."""
    path = tmp_path / "unlike.toml"
    path.write_text(UNLIKE)
    result = play_match(Match.of_names(str(path), "shielded:random", "random", games=40))
    assert result.robots.lost.pursuer == 0
    assert result.robots.lost.evader > 20
    assert result.to_dict()["robots"]["pursuers"] == {"active": 80, "captured": 0, "hit_obstacle": 0, "out_of_range": 0}


@pytest.mark.slow
def test_the_team_of_the_zoo_catches_who_gets_away_from_two_that_do_not_see_each_other():
    """200 games from the same starts; the evader knows any arena, and the nearest pursuer only."""
    caught = [
        play_match(Match.of_names("team-2v1", f"shielded:{name}", "shielded:E_any", games=200)).outcomes["captured"]
        for name in ("P_team", "P_any")
    ]
    assert caught[0] >= 194
    assert caught[0] > caught[1]
