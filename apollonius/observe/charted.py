"""An observation by a chart of the player's own, for games whose arena has none."""

from dataclasses import dataclass, replace

from jaxtyping import Array, Float

from apollonius.game.chart import Chart
from apollonius.observe.observation import AbstractObservation, Whole
from apollonius.observe.view import View


@dataclass(frozen=True)
class Charted(Whole):
    """What an observation says of a view with this chart.

    Attributes:
        observation: reads a chart.
        chart: of the arena that is played in.
    """

    observation: AbstractObservation
    chart: Chart

    def __call__(self, view: View) -> Float[Array, " size"]:
        """The numbers for a view."""
        return self.observation(replace(view, arena=replace(view.arena, chart=self.chart)))
