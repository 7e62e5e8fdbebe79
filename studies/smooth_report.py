"""What agents with continuous actions come to beside discrete ones: a table, its numbers, and both motions."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.catalogue import find_player
from apollonius.document import write_atomically
from apollonius.evaluate.match import Match, replay_game
from apollonius.evaluate.tournament import Tournament
from apollonius.game.dynamics import gears
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.replay import BothActions, Trajectory
from apollonius.show import style
from apollonius.show.arena import draw_game
from apollonius.show.curves import draw_lines
from apollonius.show.markdown import markdown_table, mean_over_seeds

CONTINUOUS, DISCRETE = KINDS = "continuous", "discrete"
"""The kinds of action. With one of them begins the name of an agent that was trained here; after it comes its seed."""
Facts = dict[str, Any]
Pairings = dict[tuple[str, str], list[tuple[tuple[str, str], Facts]]]
"""By pursuer and evader, where all that were trained with one kind of action are one: names of both, and the match."""
_TRIALS = 50
"""Starts among which the figure looks for one from which both pursuers capture."""


def write_results(
    out: Path, rows: Mapping[str, Mapping[str, Facts]], pursuers: Mapping[str, str], evaders: Mapping[str, str]
) -> str:
    """Write `smooth.json`, `smooth.md` and `smooth.png`; returns both tables.

    Args:
        rows: matches by pursuer and evader, as `MatchResult.to_dict` has them.
        pursuers, evaders: by name, the agents or their files.
    """
    game = make_game("paper")
    pairs = pairings(rows)
    written = comparison(pairs) + "\n\n" + table(pairs, float(game.dt))
    write_atomically(out / "smooth.json", json.dumps(rows, indent=1).encode())
    write_atomically(out / "smooth.md", (written + "\n").encode())
    pair = [next(agent for name, agent in pursuers.items() if kind_of(name) == kind) for kind in (DISCRETE, CONTINUOUS)]
    evader = next(agent for name, agent in evaders.items() if kind_of(name) == CONTINUOUS)
    fleeing = find_player(evader, Role.EVADER, game)
    draw([Match(game, find_player(agent, Role.PURSUER, game), fleeing, _TRIALS) for agent in pair], out / "smooth.png")
    return written


def rows_of(tournament: Tournament) -> dict[str, dict[str, Facts]]:
    """The matches of a tournament by pursuer and evader."""
    return {
        pursuer: {evader: match.to_dict() for evader, match in zip(tournament.evaders, row, strict=True)}
        for pursuer, row in zip(tournament.pursuers, tournament.matches, strict=True)
    }


def kind_of(name: str) -> str:
    """The kind of action of an agent that was trained here; the name itself of any other."""
    kind = name.split(" ")[0]
    return kind if kind in KINDS else name


def pairings(rows: Mapping[str, Mapping[str, Facts]]) -> Pairings:
    """Matches of strangers by the kinds of both sides: two of one name were trained against each other."""
    found: Pairings = {}
    for pursuer, row in rows.items():
        for evader, match in row.items():
            if pursuer != evader:
                found.setdefault((kind_of(pursuer), kind_of(evader)), []).append(((pursuer, evader), match))
    return found


def comparison(pairs: Pairings) -> str:
    """A row for each side and opponent: how often agents with continuous actions win there and those with discrete ones
    do, what the former have more, seed by seed, and how much both change their controls.

    A pursuer wins when it captures or the evader alone fails; an evader's wins are the games in which it is undefeated.
    """
    head = ["side", "against", "wins, continuous [%]", "wins, discrete [%]", "difference"]
    head += ["change of u, continuous", "change of u, discrete", "ratio"]
    lines: list[list[str]] = []
    for role, win in ((Role.PURSUER, "pursuer_win_rate"), (Role.EVADER, "evader_undefeated_rate")):
        for opponent in dict.fromkeys(pair[1 - role] for pair in pairs):
            both = [(kind, opponent) if role == Role.PURSUER else (opponent, kind) for kind in KINDS]
            if not all(pair in pairs for pair in both):  # of one seed alone, no two of a kind are strangers
                continue
            meetings = [pairs[pair] for pair in both]
            wins = [seed_means(these, role, lambda match, win=win: 100 * match[win]) for these in meetings]
            more = [one - other for one, other in zip(*wins, strict=True)]
            changes = [seed_means(these, role, _change_of(role)) for these in meetings]
            smooth, rough = (float(np.mean(change)) for change in changes)
            lines.append([
                role.name.lower(), opponent, *(mean_over_seeds(win, "{:.1f}") for win in wins),
                mean_over_seeds(more, "{:+.1f}", "{:.1f}"), *(mean_over_seeds(change, "{:.3f}") for change in changes),
                f"{smooth / rough:.2f}" if rough else "-",
            ])  # fmt: skip
    return markdown_table(head, lines)


def table(pairs: Pairings, dt: float) -> str:
    """A row for each pairing, agents of a kind being one: means over their seeds, each a mean over all opponents of the
    other kind. Where both sides were trained here, the seeds are the pursuer's.
    """
    head = ["pursuer", "evader", "pursuer wins [%]", "capture time [s]", "its deviation [s]"]
    head += ["pursuer's change of u", "evader's change of u"]
    lines: list[list[str]] = []
    for pair, meetings in pairs.items():
        role = Role.PURSUER if pair[0] in KINDS else Role.EVADER
        wins = seed_means(meetings, role, lambda match: 100 * match["pursuer_win_rate"])
        cells = [mean_over_seeds(wins, "{:.1f}")]
        for name in ("mean_capture_steps", "capture_steps_deviation"):
            captured = [meeting for meeting in meetings if meeting[1][name] is not None]
            seconds = seed_means(captured, role, lambda match, name=name: dt * match[name])
            cells.append(mean_over_seeds(seconds, "{:.1f}"))
        cells += [mean_over_seeds(seed_means(meetings, role, _change_of(side)), "{:.3f}") for side in Role]
        lines.append([*pair, *cells])
    return markdown_table(head, lines)


def seed_means(
    meetings: Sequence[tuple[tuple[str, str], Facts]], role: Role, value: Callable[[Facts], float]
) -> list[float]:
    """Of every agent of one side, the mean of a number over its matches, in the order of their names."""
    values: dict[str, list[float]] = {}
    for names, match in meetings:
        values.setdefault(names[role], []).append(value(match))
    return [float(np.mean(values[name])) for name in sorted(values)]


def _change_of(role: Role) -> Callable[[Facts], float]:
    return lambda match: float(np.mean(match[f"{role.name.lower()}_change"]))


def draw(matches: Sequence[Match], path: Path) -> None:
    """The games of a discrete and a continuous pursuer from the same start, and their turn rates: from the first start
    from which both capture, if there is one.
    """
    game = matches[0].game
    courses: list[Trajectory] = []
    for index in range(_TRIALS):
        courses = [replay_game(match, index) for match in matches]
        if all(course.outcome == Outcome.CAPTURED for course in courses):
            break
    titles = (DISCRETE, CONTINUOUS)
    with style.picture(path, columns=3, width=3.8, height=4.0) as panels:
        for axes, course, title in zip(panels, courses, titles, strict=False):
            draw_game(axes, game, course, title)
        rates = {
            title: ((np.arange(len(share)) * float(game.dt)).tolist(), share.tolist())
            for title, share in zip(titles, (turn_rates(course.actions) for course in courses), strict=True)
        }
        draw_lines(panels[2], rates)
        panels[2].set_title("the pursuer's turn rate, of its largest")
        panels[2].set_xlabel("time [s]")
        panels[2].legend()


def turn_rates(actions: BothActions) -> np.ndarray:
    """The pursuer's turn rate in every step, as a share of its largest."""
    return np.array([float(gears(action)[1]) for action in actions[:, 0]])
