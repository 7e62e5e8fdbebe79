"""A pursuer of a team that flanks: the one that is not the nearest to the evader goes round to its
other side.

Two that each take the shortest path chase an evader round a loop for ever, both the same way round.
"""

from dataclasses import replace

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.agents.path_following import cell_middle
from apollonius.agents.policy import AbstractValueWrapper, Memory
from apollonius.agents.surrounding import path_length_to, path_lengths_from, place_cells
from apollonius.game.types import RandomBits, tree_where
from apollonius.observe.view import View

_BEYOND = 2.0
"""Detour through the evader [m] up to which a place is beyond it, seen from a mate; like the
lengths below, on the scale of the paper's robots.
"""
_APART = 3.0
"""Detour through the evader [m] from which on a place is reached past it."""
_LEAST, _MOST = 16.0, 60.0
"""Lengths of the loops [m] that it goes round; in shorter ones it does without."""
_FAR = 1e3
"""Length of a way that does not lead round [m]."""


class Flanking(AbstractValueWrapper):
    """Another pursuer, in whose view the evader is where `flanking_view` puts it."""

    @property
    def needs_chart(self) -> bool:
        return True

    def score(
        self, view: View, memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        return self.score_view(flanking_view(view), memory, bits)


def flanking_view(view: View) -> View:
    """Return the view of a pursuer that flanks the nearest evader: it is at rest in the middle of
    the way round to it, if there is one.

    The way round leads over a place that lies beyond the evader as seen from each mate nearer to it
    by path, but not as seen from the pursuer itself: the shortest path there does not pass the
    evader, the mate's does, to within some metres. The view stays as it is for the pursuer that is
    nearest by path, and for one that is on the other side already.
    """
    chart, evader = view.chart, view.opponent
    length_from_evader = path_length_to(view, evader.state)
    own_length = length_from_evader(view.own.state.x, view.own.state.y)
    cells = place_cells(chart)
    from_own, from_evader = path_lengths_from(view, view.own), path_lengths_from(view, evader)
    is_round = own_length + from_evader - from_own >= _APART
    is_behind = jnp.asarray(False)
    for mate in view.mates:
        state = mate.state
        mate_length = length_from_evader(state.x, state.y)
        between = path_length_to(view, state)(view.own.state.x, view.own.state.y)
        is_nearer = jnp.asarray(mate.active) & (mate_length < own_length)
        is_beyond = mate_length + from_evader - path_lengths_from(view, mate) <= _BEYOND
        is_round &= ~is_nearer | is_beyond
        is_behind |= is_nearer & (mate_length + own_length - between > _BEYOND)
    best = jnp.argmin(jnp.where(is_round, jnp.maximum(from_own, from_evader), _FAR))
    loop = own_length + from_own[best] + from_evader[best]
    flanks = is_behind & is_round[best] & (loop > _LEAST) & (loop < _MOST)
    place = cell_middle(chart, cells[best])
    opponents = tuple(
        replace(robot, state=tree_where(flanks, place, robot.state)) for robot in view.opponents
    )
    return replace(view, opponents=opponents)
