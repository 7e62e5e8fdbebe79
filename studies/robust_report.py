"""What training with disturbed robots comes to: failures, outcomes, tracking errors; by the rules and with bodies."""

from collections.abc import Mapping, Sequence

import numpy as np

from apollonius.bodies.comparison import Comparison
from apollonius.bodies.scene import SIDES
from apollonius.evaluate.match import MatchResult
from apollonius.game.types import Role
from apollonius.reproduce.finding import Finding, mean_shares, outcome_table
from apollonius.show.markdown import markdown_table, mean_over_seeds

Comparisons = Mapping[tuple[str, str], Comparison]
"""By the names of pursuer and evader: their match by the rules and with bodies."""
ROBUST = "robust"
"""What the agents of all seeds are called together."""


def find(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> Finding:
    """All tables.

    Args:
        found: all matches.
        pursuers, evaders: of each side whom training went on from and a stranger; all others are its seeds.
    """
    text = "\n\n".join(tell(found, pursuers, evaders) for tell in (gap_table, outcomes, tracking))
    data = [{"pursuer": pursuer, "evader": evader, **match.to_dict()} for (pursuer, evader), match in found.items()]
    return Finding("Training with disturbed robots", text, data={"matches": data})


def gap_table(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> str:
    """A row for each side and opponent: in how many games the agent that training went on from fails, in how many those
    of the seeds do, and how much of what bodies add to the former the latter are without.

    Where the opponent is of a seed, each seed's agent meets its own, and what they are compared with is the match of
    the two that training went on from.
    """
    head = ["of", "against", "fails by the rules [%]", "with bodies [%]"]
    head += ["trained so, by the rules [%]", "with bodies [%]", "of the gap closed [%]"]
    lines: list[list[str]] = []
    for role, base, others in ((Role.PURSUER, pursuers[0], evaders), (Role.EVADER, evaders[0], pursuers)):
        for opponent in (*others, ROBUST):
            own = opponent == ROBUST
            first = _failures(found, role, base, others[0] if own else opponent)
            trained = [_failures(found, role, seed, seed if own else opponent) for seed in seeds_of(found)]
            gap = first["bodies"] - first["rules"]
            closed = [100 * (first["bodies"] - rates["bodies"]) / gap for rates in trained if gap > 0]
            lines.append([
                role.name.lower(), opponent, f"{first['rules']:.1f}", f"{first['bodies']:.1f}",
                *(mean_over_seeds([rates[kind] for rates in trained], "{:.1f}") for kind in ("rules", "bodies")),
                mean_over_seeds(closed, "{:.0f}"),
            ])  # fmt: skip
    return markdown_table(head, lines)


def _failures(found: Comparisons, role: Role, own: str, opponent: str) -> dict[str, float]:
    """In how many of its games an agent fails, by the rules and with bodies [%]."""
    match = found[(own, opponent) if role == Role.PURSUER else (opponent, own)]
    rates = match.differences[f"{role.name.lower()} fails"]
    return {"rules": 100 * rates.rules, "bodies": 100 * rates.bodies}


def outcomes(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> str:
    """How the games of both agents that training went on from end, those of the seeds, in the mean over these, and
    those of two strangers; and how often the pursuer wins.
    """
    columns: list[tuple[str, dict[str, float]]] = []
    for name, matches in _pairings(found, pursuers, evaders).items():
        columns.append((f"{name}, by the rules", _shares([match.rules for match in matches])))
        columns.append((f"{name}, with bodies", _shares([match.bodies for match in matches])))
    return outcome_table(columns)


def tracking(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> str:
    """How far a step of the bodies is from one by the rules: root mean squares, in the mean over seeds."""
    lines = []
    for name, matches in _pairings(found, pursuers, evaders).items():
        for side in SIDES:
            errors = [match.tracking[side] for match in matches]
            rms = {what: float(np.mean([error[what].rms for error in errors])) for what in errors[0]}
            lines.append([name, side, f"{rms['speed']:.3f}", f"{rms['heading']:.3f}", f"{1000 * rms['position']:.1f}"])
    return markdown_table(["match", "of", "speed [m/s]", "heading [rad]", "position [mm]"], lines)


def seeds_of(found: Comparisons) -> list[str]:
    """Names of the seeds' agents: the only ones that meet one of their own name."""
    return [pursuer for pursuer, evader in found if pursuer == evader]


def _pairings(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> dict[str, list[Comparison]]:
    """The matches of the two agents that training went on from, and of the seeds', by what they are called."""
    seeds = seeds_of(found)
    return {
        f"{pursuers[0]} and {evaders[0]}": [found[(pursuers[0], evaders[0])]],
        f"{ROBUST} and {evaders[0]}": [found[(seed, evaders[0])] for seed in seeds],
        f"{pursuers[0]} and {ROBUST}": [found[(pursuers[0], seed)] for seed in seeds],
        f"{ROBUST} and {ROBUST}": [found[(seed, seed)] for seed in seeds],
        f"{pursuers[1]} and {evaders[1]}": [found[(pursuers[1], evaders[1])]],
    }


def _shares(results: Sequence[MatchResult]) -> dict[str, float]:
    """Share of each outcome and of the pursuer's wins, in the mean over matches."""
    return mean_shares(results) | {"pursuer_wins": float(np.mean([result.pursuer_win_rate for result in results]))}
