"""Names of players, which are known without JAX: one that is misspelt is refused at once."""

from pathlib import Path

ZOO = Path(__file__).parent / "zoo"
"""Folder of the trained agents that ship with the package."""
FROM_ZOO = "zoo/"
"""Prefix that marks the name of an agent that ships with the package."""
BUILT_IN = (
    "random", "still", "pure-pursuit", "intercept", "voronoi-pursuit", "encirclement", "flee", "flee-aware",
    "search", "hide", "territory",
)  # fmt: skip
"""Players that need no file; what they do says `apollonius.agents.built_in`."""

SHIELDED = "shielded:"
"""Prefix that puts the player of a name behind a shield."""


def zoo_names() -> list[str]:
    """Return the names of the agents that ship with the package."""
    return sorted(path.stem for path in ZOO.glob("*.safetensors"))
