"""Build otherwise: a kind of obstacle of your own, here a round wall around the game.

    python examples/own_obstacle.py

Contacts, starts and players ask an obstacle only how far away it is. It writes round.png, a game
within the round wall, and prints:

    square: shielded:intercept wins 92.0% of 1000 games
    round: shielded:intercept wins 90.4% of 1000 games
"""

import math
from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp

import apollonius
from apollonius.game.obstacle import AbstractObstacle
from apollonius.show.animation import save_animation

PURSUER = "shielded:intercept"
EVADER = "shielded:flee-aware"


class RoundWall(AbstractObstacle):
    """Everything that is farther than a radius [m] from (x, y) [m]."""

    x: float
    y: float
    radius: float

    def clearance(self, x, y):
        """Return the distance [m] from a point to the wall; negative beyond it."""
        return self.radius - jnp.hypot(x - self.x, y - self.y)

    def clearance_along(self, before, after):
        """Return the least clearance on a straight step: at an end, as a disc is convex."""
        ends = [self.clearance(robot.x, robot.y) for robot in (before, after)]
        return jnp.minimum(*ends)

    def outline(self):
        """Return the corners of its picture: along the circle, and back along a square."""
        turns = [math.tau * number / 60 for number in range(61)]
        circle = [(math.cos(turn), math.sin(turn)) for turn in turns]
        square = [(1, 0), (1, -1), (-1, -1), (-1, 1), (1, 1), (1, 0)]
        corners = circle + square
        return tuple((self.x + self.radius * x, self.y + self.radius * y) for x, y in corners)


class RoundArena(apollonius.Arena):
    """An arena with one more kind of obstacle, which is a field."""

    round_walls: tuple[RoundWall, ...] = ()


def main(games: int = 1_000, pursuer: str = PURSUER, evader: str = EVADER) -> None:
    """Play matches with and without the round wall, and draw a game within it."""
    square = apollonius.make_game("paper")
    wall = RoundWall(x=5.0, y=5.0, radius=5.0)
    arena = RoundArena(discs=square.arena.discs, round_walls=(wall,))
    circular = replace(square, arena=arena)

    for name, game in (("square", square), ("round", circular)):
        match = apollonius.Match.of_names(game, pursuer, evader, games)
        result = apollonius.play_match(match)
        print(f"{name}: {pursuer} wins {result.pursuer_win_rate:.1%} of {games} games")

    save_animation(apollonius.record_game(match, 0), Path("round.png"))


if __name__ == "__main__":
    main()
