"""Table 1 of the paper, and the robots with bodies."""

from dataclasses import replace

from apollonius.game.dynamics import Unicycle
from apollonius.game.presets import make_game, paper


def test_paper_is_table_1():
    game = paper()
    for robot in (game.pursuer, game.evader):
        assert (robot.v_min, robot.v_max, robot.u1_max, robot.u2_max, robot.radius) == (0, 1.2, 0.3, 0.8, 0)
    assert (game.arena.x_min, game.arena.x_max, game.arena.y_min, game.arena.y_max) == (0, 10, 0, 10)
    assert (game.capture_distance, game.dt, game.max_steps) == (0.3, 0.1, 1000)
    assert (game.reward.capture, game.reward.failure, game.reward.progress, game.reward.profile) == (10, 10, 3, "paper")


def test_the_robots_of_the_robot_game_have_bodies_that_do_not_meet_before_the_capture():
    game = make_game("robot")
    assert game.pursuer == game.evader == Unicycle(radius=0.2)
    assert game.capture_distance > game.pursuer.radius + game.evader.radius
    assert replace(game, pursuer=Unicycle(), evader=Unicycle(), capture_distance=0.3) == make_game("paper")
