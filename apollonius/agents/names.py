"""Names of players, which are known without JAX: one that is misspelt is refused at once."""

from pathlib import Path

ZOO = Path(__file__).parent / "zoo"
"""Folder of the trained agents that ship with the package."""
FROM_ZOO = "zoo/"
"""Prefix that marks the name of an agent that ships with the package."""
AGENTS = "agents"
"""The folder of a training run that its agents lie in."""
RUNS = Path("runs")
"""The folder that training runs lie in unless they were put elsewhere."""
SIDES = "pursuer", "evader"
BUILT_IN = {
    "random": (SIDES, "draws each action"),
    "still": (SIDES, "brakes and stays"),
    "pure-pursuit": (SIDES[:1], "heads for the evader"),
    "intercept": (SIDES[:1], "heads for where both could meet"),
    "voronoi-pursuit": (SIDES[:1], "of a team: takes room from the evader"),
    "encirclement": (SIDES[:1], "of a team: closes in from all sides"),
    "flee": (SIDES[1:], "straight away from the pursuer"),
    "flee-aware": (SIDES[1:], "to where it is farthest away in 4 s without a contact"),
    "search": (SIDES[:1], "of limited sight: to where the evader can be"),
    "hide": (SIDES[1:], "of limited sight: out of the pursuer's sight"),
    "territory": (SIDES, "to the nearest point of a territory that the evader reaches first"),
}
"""Players that need no file: the sides that they play, and what they do
(`apollonius.agents.built_in`).
"""

LISTED = "apollonius players lists all that there are"
"""The end of a message about an unknown name."""
SHIELDED = "shielded:"
"""Prefix that puts the player of a name behind a shield."""
IDENTIFYING = "identifying:"
"""Prefix that makes the player of a name learn its robot's drive while it drives."""
SEARCHING = "searching:"
"""Prefix that makes the pursuer of a name search while it does not see its opponent."""
FLANKING = "flanking:"
"""Prefix that makes the pursuer of a name, in a team, go round to the evader's other side."""
PREFIXES = IDENTIFYING, SHIELDED, SEARCHING, FLANKING
"""Prefixes of wrappers, in their order."""


def prefixes_of(name: str) -> list[str]:
    """Return the prefixes of wrappers with which a player's name begins, in whatever order."""
    prefixes, rest = list[str](), name
    while rest.startswith(PREFIXES):
        prefixes.append(next(prefix for prefix in PREFIXES if rest.startswith(prefix)))
        rest = rest.removeprefix(prefixes[-1])
    return prefixes


def bare_name(name: str) -> str:
    """Return a player's name without the prefixes of wrappers."""
    return name[len("".join(prefixes_of(name))) :]


def zoo_names() -> list[str]:
    """Return the names of the agents that ship with the package."""
    return sorted(path.stem for path in ZOO.glob("*.safetensors"))


def sides_of(name: str) -> tuple[str, ...]:
    """Return the sides that a built-in player or an agent of the zoo plays; either for one of
    another package.
    """
    if name in BUILT_IN:
        return BUILT_IN[name][0]
    if ":" in name:
        return SIDES
    return SIDES[:1] if name.startswith(("P_", "pursuer")) else SIDES[1:]


def agents_folders(run: str) -> list[Path]:
    """List the folders that may hold the agents of a training run, named by its folder or by its
    name among `RUNS`.
    """
    return [Path(run) / AGENTS, RUNS / run / AGENTS]
