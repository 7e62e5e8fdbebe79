"""The folder that is served: the page, the named games and the trained agents, as plain files for any web host."""

import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.agents.built_in import PLAYERS, BuiltIn
from apollonius.agents.store import load_header
from apollonius.agents.trained import ZOO, find_trained, zoo_names
from apollonius.arenas.file import find_game, game_in_one_arena, game_names, split_team
from apollonius.arenas.record import to_dict
from apollonius.catalogue import SHIELDED, find_player
from apollonius.game.arena import Disc
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Polygon
from apollonius.game.types import Role
from apollonius.io.document import to_json
from apollonius.io.errors import require
from apollonius.io.limits import SEED

PAGE = Path(__file__).parent / "page"
"""The page itself: HTML, CSS and plain JavaScript."""
YOU = "you"
"""What a person is called in place of an agent."""
AT_HOME = ("paper", "zero-sum")
"""Games in the arena that most agents were trained in."""
BEST = {Role.PURSUER: "P_optimal", Role.EVADER: "E_optimal"}
"""Whom a person meets there."""
ANYWHERE = {Role.PURSUER: "P_any", Role.EVADER: "E_any"}
"""Whom a person meets everywhere else."""
AS_TEAM = {Role.PURSUER: "P_team", Role.EVADER: "E_any"}
"""Whom in a game of teams."""
ANY_ARENA = ("egocentric", "team")
"""Observations of agents that play in any arena."""
READS = ("paper", "encoded", *ANY_ARENA)
"""Observations that the page makes: of the others it has no program."""
ROBOTS = 6
"""Most robots of a side in the page, whose programs look at as many whether they are there or not."""
_BEGINS_WITH = ("pursuer", "evader", "game", "difficulty", "seed", "level")
_MADE = f"one that the page makes: {', '.join(READS)}; choose another player"


@dataclass(frozen=True)
class Choice:
    """What the page begins with: who plays either side, how hard the one is, a game and the starts' seed; or a level.

    A person leads a side of several robots. `agents` and `games` are those that do not ship with the package, by the
    names they have in the page; of a game of teams it is the game of two.
    """

    pursuer: str = f"{SHIELDED}{BEST[Role.PURSUER]}"
    evader: str = YOU
    game: str = "paper"
    difficulty: str = "fair"
    seed: int = 0
    level: int | None = None
    agents: dict[str, Path] = field(default_factory=dict)
    games: dict[str, Game] = field(default_factory=dict)


def choose(person: Role, against: str | None, game: str, seed: int) -> Choice:
    """What a person asked for.

    Args:
        person: the side that the person steers.
        against: the other side's player: built in, in the zoo, or a file; `shielded:` may stand before it.
        game: name or file of the game.
        seed: of the starts.

    Raises:
        InvalidInput: for a game, a seed or a player there is not, or one that the page does not have.
    """
    SEED.require("seed", seed)
    rules = game_in_one_arena(game, "the page")
    bound = f"discs, polygons and a map, as in the page, and the game '{game}' has others"
    rules.arena.require_only((Disc, Polygon, OccupancyMap), bound)
    for side, bodies in zip(("pursuers", "evaders"), rules.bodies, strict=True):
        require(len(bodies) <= ROBOTS, side, len(bodies), f"at most {ROBOTS} in the page; simulate larger teams")
    team, of_two = split_team(game)
    games = {} if of_two in game_names() else {Path(of_two).stem: find_game(of_two)}
    side = person.other
    is_first = against is None and person == Role.EVADER and (game, seed) == ("paper", 0)
    name = against or SHIELDED + (AS_TEAM if rules.teams else BEST if game in AT_HOME else ANYWHERE)[side]
    bare = name.removeprefix(SHIELDED)
    found = find_player(name, side, rules)
    playable = found.header is not None or bare in PLAYERS
    rule_players = [rule for rule in PLAYERS if BuiltIn().fits(rule, side, rules)]
    require(playable, "opponent", name, f"a trained agent, or one of {', '.join(rule_players)}")
    agents = {}
    if found.header is not None:
        require(found.header.observation in READS, "observation", found.header.observation, _MADE)
        path = find_trained(bare)[1].resolve()
        # Two runs give their agents the same names, and those of the zoo.
        agents = {} if path.parent == ZOO.resolve() else {f"{path.stem} of {path.parents[1].name}": path}
        name = name.removesuffix(bare) + next(iter(agents), path.stem)
    players, difficulty = BySide.of(side, name, YOU).pair, "fair" if against is None else "sharp"
    arena, level = Path(of_two).stem if games else of_two, 1 if is_first else None
    known = f"{team}/{arena}" if team else arena
    return Choice(*players, known, difficulty, seed, level, agents, games)


def write_site(folder: Path, choice: Choice | None = None) -> None:
    """Write the page with all it needs.

    Args:
        folder: where to; what it holds besides stays.
        choice: what the page begins with.
    """
    chosen = choice or Choice()
    shutil.copytree(PAGE, folder, dirs_exist_ok=True)
    (folder / "agents").mkdir(exist_ok=True)
    names: dict[str, list[str]] = {role.name.lower(): [] for role in Role}
    published, anywhere = {}, []
    paths = {name: ZOO / f"{name}.safetensors" for name in zoo_names()} | chosen.agents
    for number, (name, path) in enumerate(paths.items()):
        header = load_header(path)
        if header.observation in READS:
            published[name] = f"agents/{number}.safetensors"
            shutil.copyfile(path, folder / published[name])
            names[header.role].append(name)
            anywhere += [name] if header.observation in ANY_ARENA else []
    games = {name: find_game(name) for name in game_names()} | chosen.games
    catalogue = {
        "games": {name: to_dict(game) for name, game in games.items()},
        "maps": {name: _write_map(game.arena.map, folder) for name, game in games.items() if game.arena.map},
        "agents": names,
        "anywhere": anywhere,
        "files": published,
        "chosen": {name: getattr(chosen, name) for name in _BEGINS_WITH},
    }
    (folder / "catalogue.json").write_text(to_json(catalogue))


def _write_map(occupancy: OccupancyMap, folder: Path) -> dict[str, Any]:
    """What the page knows of a map besides its file's name; its field is a file beside the page."""
    field = np.asarray(occupancy.field, "<f4")
    path = Path("maps") / f"{occupancy.digest}.f32"
    (folder / path.parent).mkdir(exist_ok=True)
    (folder / path).write_bytes(field.tobytes())
    rows, columns = field.shape
    place = {"x": occupancy.x, "y": occupancy.y, "cell": occupancy.cell}
    return place | {"rows": rows, "columns": columns, "field": path.as_posix()}
