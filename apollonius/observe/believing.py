"""The view of a robot that does not always see its opponent: how long ago that was, and where to look for it."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.chart import COARSE
from apollonius.observe import belief
from apollonius.observe.egocentric import COURSES, EGOCENTRIC, on_two_scales, paths_from
from apollonius.observe.observation import AbstractObservation, turned
from apollonius.observe.view import View


class Believing(AbstractObservation):
    """`egocentric`, of the last sighting, and the belief.

    The sighting's age a as 1 / (1 + a) and log(1 + a) / 2, and the share of the arena's cells where the opponent can be
    (3). Of the cell that is worth most to look at (`apollonius.observe.belief.prospects`) cosine and sine of the
    bearing, and the distance d and the path length w to it as 1 / (1 + d) and log(1 + d) / 2 (6); in sixteen directions
    how much longer that path would be from 1.5 m ahead, over 1.5 m, and where those point where it gets shorter (18).

    A side that sees everything has an age of 0, and believes what it sees. A network for `egocentric` can be trained
    further with weights of 0 for the rest.
    """

    name = "belief"
    size = EGOCENTRIC.size + 9 + COURSES + 2
    charted = True
    extends = EGOCENTRIC.name

    def __call__(self, view: View) -> Float[Array, " size"]:
        """Return the numbers of a view; errors as of `egocentric`."""
        first, courses = EGOCENTRIC.with_courses(view)
        chart, own, opponent = view.chart, view.own.state, view.opponent
        cell, share = chart.nearest_cell(opponent.state.x, opponent.state.y), jnp.zeros(())
        if view.belief is not None:
            cell = belief.best_look(chart, view.belief, own)
            share = jnp.mean((view.belief >= 0).astype(jnp.float32))
        x, y = chart.middles()
        dx, dy = x[0, cell % COARSE] - own.x, y[cell // COARSE, 0] - own.y
        distance, (cos, sin) = jnp.hypot(dx, dy), turned(own.heading)
        far = jnp.maximum(distance, 1e-6)
        here = chart.cell_weights(own.x, own.y)
        numbers = [
            *on_two_scales(jnp.asarray(opponent.age, jnp.float32)),
            share,
            (cos * dx + sin * dy) / far,
            (cos * dy - sin * dx) / far,
            *on_two_scales(distance),
            *on_two_scales(jnp.maximum(chart.path_length_from(cell, here), distance)),
        ]
        return jnp.concatenate([first, jnp.stack(numbers), paths_from(chart, cell, own, here, courses)])


BELIEVING = Believing()
