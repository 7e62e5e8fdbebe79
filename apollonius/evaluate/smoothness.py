"""How smooth motion is: by how much both controls change from one step to the next."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from apollonius.game.dynamics import gears
from apollonius.playout import AbstractWatcher, Results
from apollonius.rollout import Transition


class Course(eqx.Module):
    """A game so far: both sides' latest gears, the sums of their changes, and the number of steps.

    Rows are the pursuer and the evader, columns u1 and u2, as shares of their largest values.
    """

    gears: Float[Array, "2 2"]
    changes: Float[Array, "2 2"]
    steps: Int[Array, ""]


class Changes(AbstractWatcher):
    """Adds up |change of u|."""

    def begin(self) -> Course:
        """Nothing yet; how a game's first controls come about is no change."""
        return Course(jnp.zeros((2, 2)), jnp.zeros((2, 2)), jnp.zeros((), jnp.int32))

    def follow(self, known: Course, transition: Transition) -> Course:
        """One step more."""
        now = jnp.stack([jnp.stack(gears(side.action)) for side in transition.sides])
        change = jnp.where(known.steps > 0, jnp.abs(now - known.gears), 0.0)
        return Course(now, known.changes + change, known.steps + 1)


def mean_change(results: Results) -> Float[np.ndarray, "2 2"]:
    """Mean |change of u| per step over all steps of games that `Changes` watched; rows and columns as in `Course`.

    A control that goes from one end to the other changes by 2. Games of a single step have none to change.
    """
    course: Course = results.watched
    changed = np.maximum(np.asarray(course.steps) - 1, 0).sum()
    return np.asarray(course.changes, np.float64).sum(axis=0) / max(1, changed)
