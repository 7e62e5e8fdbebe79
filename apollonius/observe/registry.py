"""All observations by name."""

from apollonius.io.errors import InvalidInput, nearest, require, unknown_name
from apollonius.observe.egocentric import EGOCENTRIC
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.paper import ENCODED, PAPER
from apollonius.observe.team import TEAM

_ALL = PAPER, ENCODED, EGOCENTRIC, TEAM
OBSERVATIONS: dict[str, AbstractObservation] = {one.name: one for one in _ALL}
"""By their names in files and configurations."""


def find_observation(given: str | AbstractObservation) -> AbstractObservation:
    """Return the observation of a name, or the one that is given; raises InvalidInput for anything else."""
    if isinstance(given, AbstractObservation):
        return given
    name = str(given)
    if name not in OBSERVATIONS:
        known = f"choose one of {', '.join(OBSERVATIONS)}, or give an AbstractObservation"
        raise InvalidInput(unknown_name("observation", name, known, nearest(name, OBSERVATIONS)))
    return OBSERVATIONS[name]


def register_observation(observation: AbstractObservation) -> None:
    """Make an observation known by its name, to `find_observation` as to files and trainings.

    Raises InvalidInput if another one has the name.
    """
    known = OBSERVATIONS.setdefault(observation.name, observation)
    require(known == observation, "observation", observation.name, "a name that no other observation has")
