"""Parts of other packages, by their entry points: read only for a name that is not known, and where
all are listed.
"""

from typing import TYPE_CHECKING, Any

from apollonius.io.errors import InvalidInput, format_value

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PLAYERS = "apollonius.players"
"""Group of policies, by names that begin with their package: `mine:policy`."""
OBSERVATIONS = "apollonius.observations"
"""Group of observations, by the names that they have in files."""
ALGORITHMS = "apollonius.algorithms"
"""Group of algorithms of learning, by the kinds that they have in configs."""
OBSTACLES = "apollonius.obstacles"
"""Group of kinds of obstacles, by the names of their tables in game files."""


def extension_names(group: str) -> list[str]:
    """Return the names of all parts of a group; nothing is imported for that."""
    return sorted({_name(entry) for entry in _entries(group)})


def load_extension(group: str, name: str, kind: str) -> Any:
    """Import the part of this name, None if no package has it.

    Raises InvalidInput, which names the package and says of what `kind` the part must be, for one
    that cannot be imported, and where two packages have the name.
    """
    entries = [entry for entry in _entries(group) if _name(entry) == name]
    if not entries:
        return None
    if len(entries) > 1:
        packages = " and ".join(sorted({f"'{_package(entry)}'" for entry in entries}))
        raise InvalidInput(
            f"the packages {packages} both have '{format_value(name)}' in {group}: uninstall one."
        )
    try:
        return entries[0].load()
    except Exception as error:  # whatever a module of somebody else's raises
        raise unfit_extension(group, name, kind, f"{type(error).__name__}: {error}") from error


def unfit_extension(group: str, name: str, kind: str, reason: object) -> InvalidInput:
    """Return the refusal of a part of another package: what it is instead of its kind, or why it
    cannot be imported.
    """
    entry = next(entry for entry in _entries(group) if _name(entry) == name)
    line = f"{format_value(entry.name)} = {format_value(entry.value)}"
    return InvalidInput(
        f"the package '{_package(entry)}' has '{line}' in {group}, which must be {kind} "
        f"and is not ({format_value(reason)}): mend it, or uninstall the package."
    )


def _entries(group: str) -> list["EntryPoint"]:
    from importlib.metadata import entry_points  # not needed for most names, and takes its time

    return list(entry_points(group=group))


def _package(entry: "EntryPoint") -> str:
    """Return the name of an entry point's package; of one without metadata, that of its module."""
    return (entry.dist and entry.dist.name) or entry.module.partition(".")[0]


def _name(entry: "EntryPoint") -> str:
    return f"{_package(entry)}:{entry.name}" if entry.group == PLAYERS else entry.name
