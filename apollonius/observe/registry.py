"""All observations by name: a new one is a file beside this one, and a line here."""

from apollonius.io.errors import require
from apollonius.observe.egocentric import EGOCENTRIC
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.paper import ENCODED, PAPER
from apollonius.observe.team import TEAM

_ALL = PAPER, ENCODED, EGOCENTRIC, TEAM
OBSERVATIONS: dict[str, AbstractObservation] = {one.name: one for one in _ALL}
"""By their names in files and configurations."""


def find_observation(name: str) -> AbstractObservation:
    """Return the observation of this name; raises InvalidInput for an unknown one, and lists the known ones."""
    require(name in OBSERVATIONS, "observation", name, f"one of {', '.join(OBSERVATIONS)}")
    return OBSERVATIONS[name]
