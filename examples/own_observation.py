"""See otherwise: an observation of your own, a camera that sees only what is ahead.

    python examples/own_observation.py

A pursuer that reads it turns on the spot until it sees the evader, then drives towards it. It
prints how many standing evaders it captures, and how soon, for each field of view:

"""

import math
from dataclasses import dataclass

import jax.numpy as jnp

import apollonius


@dataclass(frozen=True)
class Camera(apollonius.AbstractObservation):
    """Two numbers: whether the opponent is in the picture, and its bearing [rad], 0 if not."""

    name = "camera"
    size = 2
    angle: float = 1.0
    """The field of view [rad]."""

    def __call__(self, view):
        own, other = view.own.state, view.opponent.state
        bearing = jnp.arctan2(other.y - own.y, other.x - own.x) - own.heading
        bearing = jnp.arctan2(jnp.sin(bearing), jnp.cos(bearing))
        is_seen = jnp.abs(bearing) < self.angle / 2
        return jnp.stack([is_seen.astype(jnp.float32), jnp.where(is_seen, bearing, 0.0)])


class Follower(apollonius.AbstractPolicy):
    """Brakes and turns left until it sees the opponent, then speeds up towards it."""

    camera: Camera

    @property
    def observation(self):
        return self.camera

    def __call__(self, observations, memory, bits):
        is_seen, bearing = observations
        steer = jnp.where(bearing > 0.1, 2, jnp.where(bearing < -0.1, 0, 1))
        return jnp.where(is_seen > 0, 6 + steer, 2).astype(jnp.int32), memory


def main(games: int = 1_000, degrees: tuple = (15, 30, 60, 120, 360)) -> None:
    """Play a match for each field of view, all from the same starts."""
    game = apollonius.make_game("paper")
    evader = apollonius.find_player("still", apollonius.Role.EVADER, game)
    for width in degrees:
        camera = Camera(angle=math.radians(width))
        follower = apollonius.NamedPlayer("follower", Follower(camera))
        match = apollonius.Match(game, apollonius.BySide(follower, evader), games)
        result = apollonius.play_match(match)
        share = result.outcomes["captured"] / games
        seconds = (result.mean_capture_steps or 0.0) * game.dt
        print(f"{width:3} degrees: {share:.1%} captured, after {seconds:.1f} s on average")

    # Files of agents and configs of trainings call it by its name, once it is registered.
    apollonius.register_observation(Camera())
    print("registered:", apollonius.find_observation("camera"))


if __name__ == "__main__":
    main()
