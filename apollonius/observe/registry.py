"""All observations by name."""

from apollonius.io import extensions
from apollonius.io.errors import InvalidInput, closest_names, require, unknown_name
from apollonius.observe.egocentric import EGOCENTRIC
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.paper import ENCODED, PAPER
from apollonius.observe.team import TEAM

OWN = PAPER, ENCODED, EGOCENTRIC, TEAM
"""Observations of this package."""
OBSERVATIONS: dict[str, AbstractObservation] = {
    observation.name: observation for observation in OWN
}
"""By their names in files and configurations; those of other packages from when their names are
first looked up.
"""
_KIND = "an AbstractObservation of the same name"


def observation_names() -> list[str]:
    """Return the names of all observations, those of other packages too."""
    return list(
        dict.fromkeys([*OBSERVATIONS, *extensions.extension_names(extensions.OBSERVATIONS)])
    )


def has_observation(name: str) -> bool:
    """Check whether an observation has the name; raises InvalidInput for a broken one of another
    package.
    """
    if name not in OBSERVATIONS:
        part = extensions.load_extension(extensions.OBSERVATIONS, name, _KIND)
        if part is None:
            return False
        if not isinstance(part, AbstractObservation) or part.name != name:
            raise extensions.unfit_extension(extensions.OBSERVATIONS, name, _KIND, part)
        register_observation(part)
    return True


def find_observation(name_or_observation: str | AbstractObservation) -> AbstractObservation:
    """Return the observation of a name, or the one that is given; raises InvalidInput for anything
    else.
    """
    if isinstance(name_or_observation, AbstractObservation):
        return name_or_observation
    name = str(name_or_observation)
    if not has_observation(name):
        names = observation_names()
        bound = f"choose one of {', '.join(names)}, or give an AbstractObservation"
        raise InvalidInput(unknown_name("observation", name, bound, closest_names(name, names)))
    return OBSERVATIONS[name]


def register_observation(observation: AbstractObservation) -> None:
    """Make an observation known by its name, to `find_observation` as to files and trainings.

    Raises InvalidInput if another one has the name.
    """
    registered = OBSERVATIONS.setdefault(observation.name, observation)
    require(
        registered == observation,
        "observation",
        observation.name,
        "a name that no other observation has",
    )
