"""The folder that is served: the page, the named games and the trained agents, as plain files for any web host."""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

from apollonius.agents.catalogue import SHIELDED, ZOO, find_agent, zoo_names
from apollonius.agents.store import load_agent
from apollonius.errors import require
from apollonius.game.presets import PRESETS, make_game
from apollonius.game.record import to_dict
from apollonius.game.types import Role

PAGE = Path(__file__).parent / "page"
"""The page itself: HTML, CSS and plain JavaScript."""
YOU = "you"
"""What a person is called in place of an agent."""
BUILT_IN = ("random", "still")
"""Players that the page has besides trained ones."""
BEST = {Role.PURSUER: "shielded:P_pool", Role.EVADER: "E_curriculum"}
"""Whom a person meets first."""


@dataclass(frozen=True)
class Choice:
    """What the page begins with: two players, a game, and the seed of its starts."""

    pursuer: str = BEST[Role.PURSUER]
    evader: str = YOU
    game: str = "paper"
    seed: int = 0

    def __post_init__(self) -> None:
        make_game(self.game)
        require(0 <= self.seed < 2**32, "seed", self.seed, "between 0 and 2^32 - 1")


def choose(person: Role, against: str | None, game: str, seed: int) -> tuple[Choice, dict[str, Path]]:
    """What a person asked for, and the files of agents that are not in the zoo, by the names they have in the page.

    Args:
        person: the side that the person steers.
        against: the other side's player: built in, in the zoo, or a file; `shielded:` may stand before it.
        game: name of the game.
        seed: of the starts.

    Raises:
        InvalidInput: for a game, a seed or a player there is not, or one that the page does not have.
    """
    side = Role.EVADER if person == Role.PURSUER else Role.PURSUER
    name = against or BEST[side]
    bare = name.removeprefix(SHIELDED)
    found = find_agent(name, side, make_game(game))
    playable = found.header is not None or bare in BUILT_IN
    require(playable, "--against", name, f"a trained agent, or one of {', '.join(BUILT_IN)}")
    files = {}
    if found.header is not None and bare not in zoo_names():
        path = Path(bare).resolve()
        # Two runs give their agents the same names, and those of the zoo.
        files = {f"{path.stem} of {path.parents[1].name}": path}
        name = name.removesuffix(bare) + next(iter(files))
    pursuer, evader = (name, YOU) if side == Role.PURSUER else (YOU, name)
    return Choice(pursuer, evader, game, seed), files


def write_site(folder: Path, choice: Choice | None = None, files: dict[str, Path] | None = None) -> None:
    """Write the page with all it needs.

    Args:
        folder: where to; what it holds besides stays.
        choice: what the page begins with.
        files: agents besides those of the zoo, by name.
    """
    shutil.copytree(PAGE, folder, dirs_exist_ok=True)
    (folder / "agents").mkdir(exist_ok=True)
    agents: dict[str, list[str]] = {role.name.lower(): [] for role in Role}
    paths = {name: ZOO / f"{name}.safetensors" for name in zoo_names()} | (files or {})
    published = {}
    for number, (name, path) in enumerate(paths.items()):
        published[name] = f"agents/{number}.safetensors"
        shutil.copyfile(path, folder / published[name])
        agents[load_agent(path).header.role].append(name)
    chosen = choice or Choice()
    catalogue = {
        "games": {name: to_dict(make_game(name)) for name in PRESETS},
        "agents": agents,
        "files": published,
        "chosen": {"pursuer": chosen.pursuer, "evader": chosen.evader, "game": chosen.game, "seed": chosen.seed},
    }
    (folder / "catalogue.json").write_text(json.dumps(catalogue))
