"""What attacks come to in several arenas: the worst that any attacker does to each player, side by side."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from apollonius.agents.trained import ANY
from apollonius.catalogue import SHIELDED
from apollonius.evaluate.statistics import mean_interval
from apollonius.exploit.losses import Losses
from apollonius.game.types import Role
from apollonius.show.markdown import markdown_table

SPECIALIST = "specialist"
"""Who was trained in the arena."""
SOLVED = "solved"
"""Who plays by the game solved there."""
_COMPARED = ("any arena", SPECIALIST, "classical", SOLVED)
Attacks = Mapping[str, Mapping[str, Mapping[str, Losses]]]
"""By side, player and attacker."""


def read_attacks(folder: Path) -> Attacks:
    """All that is kept of one arena."""
    found: dict[str, dict[str, dict[str, Losses]]] = {role.name.lower(): {} for role in Role}
    for path in sorted(folder.glob("*.json")):
        kept = json.loads(path.read_text())
        losses = Losses(**{**kept["result"], "interval": tuple(kept["result"]["interval"])})
        key = kept["key"]
        found[key["role"]].setdefault(key["player"], {})[key["attacker"]] = losses
    return found


@dataclass(frozen=True)
class Worst:
    """What a player is left with by whoever does best against it. Rates are in [0, 1]."""

    loses: float
    """To the attacker that beats it most often."""
    sure: float
    """Share of its wins less that of its losses, against the attacker where that is least."""


def worst(attacks: Attacks, role: Role, player: str) -> Worst:
    """The worst that any attacker of an arena does to a player."""
    found = attacks[role.name.lower()][player].values()
    return Worst(max(one.loses for one in found), min(one.wins - one.loses for one in found))


def arena_players(attacks: Attacks, role: Role) -> dict[str, str]:
    """Who is compared in an arena: by what each is there, its name."""
    classical = next(name for name in attacks[role.name.lower()] if name.startswith(SHIELDED))
    return {"any arena": ANY[role], SPECIALIST: SPECIALIST, "classical": classical, SOLVED: SOLVED}


def arena_table(found: Mapping[str, Attacks], role: Role) -> str:
    """A row for each arena: what each player loses to its worst attacker; an upper bound on what it is sure of."""
    lines = []
    for arena, attacks in found.items():
        players = arena_players(attacks, role)
        worsts = [worst(attacks, role, name) for name in players.values()]
        cells = [f"{100 * one.loses:.0f} ({100 * one.sure:+.0f})" for one in worsts]
        lines.append([arena, *cells])
    means = [[worst(one, role, arena_players(one, role)[kind]) for one in found.values()] for kind in _COMPARED]
    mean = [f"{_mean([one.loses for one in kind]):.1f} ({_mean([one.sure for one in kind]):+.1f})" for kind in means]
    return markdown_table([role.name.lower(), *_COMPARED], [*lines, ["mean", *mean]])


def verdict(found: Mapping[str, Attacks], role: Role) -> str:
    """In how many arenas the player of any arena does at least as well as others, and its regret."""

    def sure(attacks: Attacks, kind: str) -> float:
        return worst(attacks, role, arena_players(attacks, role)[kind]).sure

    own = {arena: sure(attacks, "any arena") for arena, attacks in found.items()}
    said = [
        f"as {kind} in {sum(own[arena] >= sure(attacks, kind) for arena, attacks in found.items())}"
        for kind in (SPECIALIST, "classical")
    ]
    regret = [sure(attacks, SOLVED) - own[arena] for arena, attacks in found.items()]
    low, high = mean_interval(regret, -2.0, 2.0)
    return (
        f"Against the worst of its attackers {ANY[role]} does at least as well {', '.join(said)} of "
        f"{len(found)} arenas, and "
        f"{np.mean(regret):.2f} worse than the solved game's player ({low:.2f} to {high:.2f})."
    )


def _mean(rates: Sequence[float]) -> float:
    return 100 * float(np.mean(rates))
