"""The folder that is served: the page, the named games and the trained agents, as plain files for
any web host.
"""

import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.agents.built_in import BY_CHART, PLAYERS, BuiltIn
from apollonius.agents.names import FLANKING, SEARCHING
from apollonius.agents.store import load_header
from apollonius.agents.trained import ANY, ZOO, find_trained, zoo_names
from apollonius.arenas.file import (
    find_game,
    game_in_one_arena,
    game_names,
    load_game,
    split_team,
    to_dict,
)
from apollonius.benchmark.scenarios import FOLDER, NAMES
from apollonius.catalogue import SHIELDED, find_player
from apollonius.game.arena import Disc
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap
from apollonius.game.polygon import Polygon
from apollonius.game.types import BySide, Role
from apollonius.io.document import parse_json, to_json
from apollonius.io.errors import require
from apollonius.io.limits import SEED

PAGE = Path(__file__).parent / "page"
"""HTML, CSS and plain JavaScript."""
LEARNERS = Path(__file__).parent / "learners"
"""The pursuer of one short training after shares of it."""
LEARNING = LEARNERS / "learning.json"
"""Capture rates of these pursuers, as `python -m website.learners` has measured them."""
YOU = "you"
"""The name of a person in place of an agent's."""
ANY_ARENA = ("egocentric", "team")
"""Observations of agents that play in any arena."""
READS = ("paper", "encoded", *ANY_ARENA)
"""Observations for which the page has a program."""
ROBOTS = 6
"""Most robots of a side in the page, whose programs always have as many places for them."""
SHUTTLES, DOORS, WALKERS = 4, 6, 12
"""Most shuttles, doors and walkers, likewise."""
OWN = ".wasm"
"""Suffix of the files of users' own players (`apollonius.web.programs.write_player`)."""
_MADE = f"one that the page makes: {', '.join(READS)}; choose another player"


@dataclass(frozen=True)
class FirstMatch:
    """The first match of the page: players, difficulty, game and seed of the starts; or a level.

    A person leads a side of several robots. `agents` and `games` do not ship with the package, and
    have the names by which the page knows them; a game of teams is listed as the game of two.
    """

    pursuer: str = f"{SHIELDED}{ANY[Role.PURSUER]}"
    evader: str = YOU
    game: str = "paper"
    difficulty: str = "fair"
    seed: int = 0
    level: int | None = None
    agents: dict[str, Path] = field(default_factory=dict)
    games: dict[str, Game] = field(default_factory=dict)


def choose_match(person: Role, against: str | None, game: str, seed: int) -> FirstMatch:
    """Make the first match of a person.

    Args:
        person: The person's side.
        against: Name or file of the opponent; None for the best one.
        game: Name or file of the game.
        seed: Seed of the starts.

    Raises:
        InvalidInput: For a game, seed or player that does not exist, or that the page cannot play.
    """
    SEED.require("seed", seed)
    rules = game_in_one_arena(game, "the page")
    _require_playable(rules, game)
    team, game_name = split_team(game)
    games = {} if game_name in game_names() else {Path(game_name).stem: find_game(game_name)}
    side = person.other
    opponent = against or SHIELDED + ANY[side]
    bare = opponent.removeprefix(SHIELDED)
    name, agents = _page_agent(bare, side, rules, opponent)
    players = BySide.of(side, opponent.removesuffix(bare) + name, YOU)
    is_first = against is None and person == Role.EVADER and (game, seed) == ("paper", 0)
    arena = Path(game_name).stem if games else game_name
    return FirstMatch(
        pursuer=players.pursuer,
        evader=players.evader,
        game=f"{team}/{arena}" if team else arena,
        difficulty="fair" if against is None else "sharp",
        seed=seed,
        level=1 if is_first else None,
        agents=agents,
        games=games,
    )


def _page_agent(bare: str, side: Role, rules: Game, opponent: str) -> tuple[str, dict[str, Path]]:
    """Return a player's name in the page, and its file by this name if it does not ship with it.

    Args:
        bare: name or file of the player, without a shield.
        side: the player's side.
        rules: the game.
        opponent: the player as a person named it.
    """
    if bare.endswith(OWN):
        path = Path(bare)
        is_there = path.is_file() and path.read_bytes()[:4] == b"\0asm"
        bound = "a file that apollonius.web.programs.write_player has written"
        require(is_there, "opponent", bare, bound)
        return path.stem, {path.stem: path}
    header = find_player(opponent, side, rules).header
    if header is None or bare.startswith((SEARCHING, FLANKING)):
        rule_names = [
            rule for rule in PLAYERS if rule not in BY_CHART and BuiltIn().fits(rule, side, rules)
        ]
        bound = f"a trained agent, a {OWN} file, or one of {', '.join(rule_names)}"
        require(bare in rule_names, "opponent", opponent, bound)
        return bare, {}
    require(header.observation in READS, "observation", header.observation, _MADE)
    path = find_trained(bare)[1].resolve()
    if path.parent == ZOO.resolve():
        return path.stem, {}
    # Two runs give their agents the same names, and those of the zoo.
    name = f"{path.stem} of {path.parents[1].name}"
    return name, {name: path}


def _require_playable(rules: Game, name: str) -> None:
    """Raise InvalidInput for a game with parts that the page does not know."""
    bound = f"discs, polygons and a map, as in the page, and the game '{name}' has others"
    rules.arena.require_only((Disc, Polygon, OccupancyMap), bound)
    for side, bodies in zip(("pursuers", "evaders"), rules.bodies, strict=True):
        require(
            len(bodies) <= ROBOTS,
            side,
            len(bodies),
            f"at most {ROBOTS} in the page; simulate larger teams",
        )
    collide = rules.teams is not None and rules.teams.mates_collide
    require(
        not collide,
        "mates_collide",
        collide,
        "false in the page, where team mates pass through each other",
    )
    if rules.movers is not None:
        numbers = {"shuttles": len(rules.movers.shuttles), "doors": len(rules.movers.doors)}
        numbers["walkers"] = int(rules.movers.number_of_walkers)
        for kind, most in (("shuttles", SHUTTLES), ("doors", DOORS), ("walkers", WALKERS)):
            bound = f"at most {most} in the page; evaluate games with more"
            require(numbers[kind] <= most, f"movers.{kind}", numbers[kind], bound)
    limited = [name for name in ("sensors", "drives") if getattr(rules, name) is not None]
    require(
        not limited,
        "game",
        f"'{name}'",
        f"without {' and '.join(limited)}, which the page does not know",
    )


def write_site(folder: Path, choice: FirstMatch | None = None) -> None:
    """Write the page and all files that it loads into a folder, whose other files stay, with its
    first match.
    """
    first_choice = choice or FirstMatch()
    shutil.copytree(PAGE, folder, dirs_exist_ok=True)
    agents = _write_agents(first_choice, folder)
    named_games = {name: find_game(name) for name in game_names()}
    games = {
        name: game
        for name, game in named_games.items()
        if game.sensors is None and game.drives is None
    } | first_choice.games
    catalogue = {
        "games": {name: to_dict(game) for name, game in games.items()},
        "maps": {
            name: _write_map(game.arena.map, folder)
            for name, game in games.items()
            if game.arena.map
        },
        "agents": agents.names,
        "anywhere": agents.anywhere,
        "files": agents.files,
        "scenarios": [_scenario_level(name) for name in NAMES],
        "learning": parse_json(LEARNING.read_bytes(), str(LEARNING)),
        "chosen": {
            name: value
            for name, value in vars(first_choice).items()
            if name not in ("agents", "games")
        },
    }
    (folder / "catalogue.json").write_text(to_json(catalogue), encoding="utf-8")


def _scenario_level(name: str) -> dict[str, Any]:
    """Return the level of the page for a scenario: its game, start, task and line."""
    path = FOLDER / f"{name}.json"
    scenario = parse_json(path.read_bytes(), str(path))
    robots = scenario["pursuers"] + scenario["evaders"]
    return {
        "name": name,
        **{key: scenario[key] for key in ("task", "side", "line", "hold")},
        "start": [number for robot in robots for number in robot],
        "rules": to_dict(load_game(path.with_suffix(".toml"))),
    }


@dataclass(frozen=True)
class _PageAgents:
    """Trained agents of the page: their names by side, those that play in any arena, and the
    files' places by name.
    """

    names: dict[str, list[str]]
    anywhere: list[str]
    files: dict[str, str]


def _write_agents(choice: FirstMatch, folder: Path) -> _PageAgents:
    """Copy the agents that the page can play, those of its first match too."""
    (folder / "agents").mkdir(exist_ok=True)
    agents = _PageAgents({role.name.lower(): [] for role in Role}, [], {})
    paths = {name: ZOO / f"{name}.safetensors" for name in zoo_names()}
    learners = sorted(LEARNERS.glob("*.safetensors"), key=_by_number)
    paths |= {path.stem: path for path in learners} | choice.agents
    for number, (name, path) in enumerate(paths.items()):
        header = None if path.suffix == OWN else load_header(path)
        if header is None or header.observation in READS:
            agents.files[name] = f"agents/{number}{path.suffix}"
            shutil.copyfile(path, folder / agents.files[name])
            for side in [header.role] if header else agents.names:
                agents.names[side].append(name)
            if header is None or header.observation in ANY_ARENA:
                agents.anywhere.append(name)
    return agents


def _by_number(path: Path) -> tuple[int, str]:
    """Return a key that sorts `learner-5` before `learner-25`."""
    return len(path.stem), path.stem


def _write_map(occupancy: OccupancyMap, folder: Path) -> dict[str, Any]:
    """Write a map's field as a file beside the page, and return its place and size."""
    field = np.asarray(occupancy.field, "<f4")
    path = Path("maps") / f"{occupancy.digest}.f32"
    (folder / path.parent).mkdir(exist_ok=True)
    (folder / path).write_bytes(field.tobytes())
    rows, columns = field.shape
    place = {"x": occupancy.x, "y": occupancy.y, "cell": occupancy.cell}
    return place | {"rows": rows, "columns": columns, "field": path.as_posix()}
