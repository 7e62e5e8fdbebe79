"""A suite of arenas: a published list of random arenas, each with its digest.

Agents for unknown maps learn in its part `train` and are judged in `held-out`, which has kinds of
arenas that training never saw. Robots of radius up to 0.3 m can go everywhere.

Longer sides of `suite-v1` were drawn log-uniformly from 6 to 30 m, the shorter ones as two thirds
or more, gaps uniformly from a fourteenth of the longer side, 0.8 m at least, to a seventh.
`suite-v2` has long ways round and narrower passages: longer sides from 6.5 to 22 m, gaps uniformly
from 0.65 m and 0.032 longer sides, 0.8 m at least, what a chart resolves for robots of radius 0.3
m, to an eighth of the longer side, 0.2 m more at least. `suite-v3` has floors of buildings: longer
sides from 20 to 60 m, half as long or more across, 2000 m^2 at most, gaps uniformly from 0.65 m and
0.006 longer sides, 0.8 m at least, to 0.2 m more.
"""

import functools
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from apollonius.arenas.names import GALLERY, PARTS, SUITES
from apollonius.arenas.random_arena import random_arena
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.scenario import RobotKinds, Scenario
from apollonius.game.starts import Starts
from apollonius.io.document import parse_toml
from apollonius.io.errors import require
from apollonius.io.record import read_record

BUILDINGS = "suite-v3"
_LONG_GAME = 3_000
"""Time limit in buildings [steps]."""
RADIUS_IN_BUILDINGS = (0.15, 0.3)
"""Smallest and largest radius of a robot in buildings [m]."""
PAPER_PAIRS = 16
"""Pairs of the paper's robots in training."""
OTHER_PAIRS = 48
"""Pairs of other robots in training."""


@dataclass(frozen=True)
class Entry:
    """One arena of a suite: random, of a requested size [m], or of the kind `gallery`, which ships
    with the package under the same name and has neither gap nor seed. `sha256` is its
    `arena_digest`.
    """

    name: str
    part: str
    kind: str
    width: float
    height: float
    sha256: str
    gap: float | None = None
    seed: int | None = None

    def draw(self) -> Arena:
        if self.kind == "gallery":
            path = GALLERY / f"{self.name}.toml"
            return read_record(Arena, parse_toml(path.read_bytes(), path)["arena"], str(path), {})
        assert self.seed is not None, "a random arena has a seed"
        assert self.gap is not None, "a random arena has a gap"
        return random_arena(
            self.kind, self.seed, gap=self.gap, width=self.width, height=self.height
        )


@functools.cache
def _published(suite: str) -> tuple[Entry, ...]:
    data = json.loads((Path(__file__).parent / f"{suite}.json").read_text(encoding="utf-8"))
    return tuple(Entry(**entry) for entry in data["arenas"])


def suite_entries(suite: str, part: str | None = None) -> tuple[Entry, ...]:
    """Return the arenas of a suite, or of a part of it, in their order; raises InvalidInput for
    unknown ones.
    """
    require(suite in SUITES, "suite", suite, f"one of {', '.join(SUITES)}")
    require(part is None or part in PARTS, "part", part, f"one of {', '.join(PARTS)}")
    return tuple(entry for entry in _published(suite) if part in (None, entry.part))


def suite_names(suite: str, part: str | None = None) -> tuple[str, ...]:
    return tuple(entry.name for entry in suite_entries(suite, part))


def suite_arena(suite: str, name: str) -> Arena:
    """Return one arena of a suite; raises InvalidInput for an unknown one, and where it is not
    drawn as published.
    """
    entries = {entry.name: entry for entry in suite_entries(suite)}
    names = list(entries)
    bound = f"one of {', '.join(names[:2])} ... {names[-1]}"
    require(name in entries, f"arena of {suite}", name, bound)
    arena, published = entries[name].draw(), entries[name].sha256
    found_digest = arena_digest(arena)
    bound = f"{published[:12]}... as published; draw it with the version that published it"
    shown_digest = f"{found_digest[:12]}..."
    require(found_digest == published, f"SHA-256 of {suite}/{name}", shown_digest, bound)
    return arena


def arena_digest(arena: Arena) -> str:
    """Return the SHA-256 of an arena's numbers to a micrometre and its cells as bits, the same on
    every machine.
    """
    lines = ["walls", _text([arena.x_min, arena.x_max, arena.y_min, arena.y_max])]
    for disc in arena.discs:
        lines += ["disc", _text([disc.x, disc.y, disc.radius])]
    for polygon in arena.polygons:
        lines += ["polygon", *[_text(corner) for corner in polygon.vertices]]
    content = "\n".join(lines).encode()
    if arena.map:
        cells = arena.map.occupied()
        rows, columns = cells.shape
        place = _text([arena.map.x, arena.map.y, arena.map.cell])
        content += f"\nmap {rows} {columns} {place}\n".encode()
        content += np.packbits(cells).tobytes()
    return hashlib.sha256(content).hexdigest()


def _text(numbers: Sequence[Any]) -> str:
    """Return numbers to six places; 0 without a sign."""
    return " ".join(f"{round(float(number), 6) + 0.0:.6f}" for number in numbers)


def is_scenario(name: str) -> bool:
    """Check whether a name is of a part of a suite, or lists several of its arenas."""
    suite, _, within = name.partition("/")
    return suite in SUITES and (within in PARTS or "," in within)


def scenario_game(name: str) -> Game:
    """Return the paper's rules in the arenas of a scenario.

    In `train`, and in buildings, robots are of many kinds (`kinds`), and games begin nearer to
    walls and obstacles, so that the larger robots find a start. Raises InvalidInput for an unknown
    scenario.
    """
    scenario = find_scenario(name)
    starts = Starts(clearance=0.15) if scenario.kinds else Starts()
    game = Game(starts=starts, scenario=scenario)
    return replace(game, max_steps=_LONG_GAME) if name.startswith(BUILDINGS) else game


@functools.cache
def find_scenario(name: Any) -> Scenario:
    """Return the arenas of a part of a suite, in `train` and in buildings with its robots, or of a
    list.

    Raises InvalidInput for unknown ones, and where one is not drawn as published.
    """
    arenas = _arenas(name)
    suite, within = name.split("/")
    has_kinds = within == "train" or suite == BUILDINGS
    kinds = draw_robot_kinds(suite) if has_kinds else None
    return Scenario.of(arenas, kinds, name)


def single_arena_games(game: Game) -> list[Game]:
    """Return the game in each arena of its scenario alone, itself without one.

    Raises InvalidInput where an arena is not drawn as published.
    """
    if game.scenario is None:
        return [game]
    return list(map(game.in_arena, _arenas(game.scenario.name)))


def _arenas(name: Any) -> list[Arena]:
    return [suite_arena(*arena.split("/")) for arena in arena_names(name)]


def arena_names(name: Any) -> list[str]:
    """Return the names of the arenas of a scenario, as `suite-v1/maze-00`.

    Raises InvalidInput for an unknown one.
    """
    parts = [f"{suite}/{part}" for suite in SUITES for part in PARTS]
    is_known = isinstance(name, str) and is_scenario(name)
    require(
        is_known,
        "scenario",
        name,
        f"one of {', '.join(parts)}, or some arenas, as '{SUITES[0]}/maze-00,maze-01'",
    )
    suite, within = name.split("/")
    names = suite_names(suite, within) if within in PARTS else within.split(",")
    require(len(set(names)) == len(names), "scenario", name, "a list of different arenas")
    return [f"{suite}/{arena}" for arena in names]


def draw_robot_kinds(suite: str = SUITES[0]) -> RobotKinds:
    """Draw the robots of training: the paper's two robots, and log-uniform pairs of others.

    In `suite-v1` every other pair has bodies; in `suite-v2` all have, and every other pair of the
    paper's robots too; in buildings all. The evader is caught within 0.2 to 0.4 m between bodies.
    """
    rng = np.random.default_rng(0)

    def draw(low: float, high: float, paper: float) -> np.ndarray:
        other_values = np.exp(rng.uniform(np.log(low), np.log(high), OTHER_PAIRS))
        return np.concatenate([np.full(PAPER_PAIRS, paper), other_values]).astype(np.float32)

    pursuer_v = draw(0.6, 2.0, 1.2)
    evader_v = np.clip(pursuer_v * draw(1 / 1.4, 1.4, 1.0), 0.6, 2.0)

    def body(v: np.ndarray) -> Unicycle:
        u1, u2 = draw(0.15, 1.2, 0.3), draw(0.4, 2.0, 0.8)
        every_other = np.arange(len(v)) % 2
        radius = draw(0.05, 0.25, 0.0) * every_other
        if suite != SUITES[0]:
            is_other = np.arange(len(v)) >= PAPER_PAIRS
            radius = rng.uniform(0, 0.3, len(v)).astype(np.float32) * (every_other | is_other)
        if suite == BUILDINGS:
            radius = rng.uniform(*RADIUS_IN_BUILDINGS, len(v)).astype(np.float32)
        return Unicycle(
            jnp.zeros(len(v)), *(jnp.asarray(leaf, jnp.float32) for leaf in (v, u1, u2, radius))
        )

    pursuer, evader = body(pursuer_v), body(evader_v)
    capture = jnp.asarray(draw(0.2, 0.4, 0.3)) + pursuer.radius + evader.radius
    return RobotKinds(pursuer, evader, capture)
