"""What agents with continuous actions come to beside discrete ones: a table, its numbers, and both motions."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from apollonius.agents.kind import Named
from apollonius.evaluate.match import Match, MatchResult, replay_game
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import gears
from apollonius.game.types import Outcome, Role
from apollonius.replay import BothActions, Trajectory
from apollonius.reproduce.finding import Finding
from apollonius.show import style
from apollonius.show.arena import draw_game
from apollonius.show.curves import draw_lines
from apollonius.show.markdown import markdown_table, mean_over_seeds

CONTINUOUS, DISCRETE = KINDS = "continuous", "discrete"
"""The kinds of action. With one of them begins the name of an agent that was trained here; after it comes its seed."""
WINS = BySide[Callable[[MatchResult], float]](
    lambda match: match.pursuer_win_rate, lambda match: match.evader_undefeated_rate
)
"""A pursuer wins when it captures or the evader alone fails; an evader wins when it is undefeated."""
Pairings = dict[tuple[str, str], list[tuple[tuple[str, str], MatchResult]]]
"""By pursuer and evader, where all that were trained with one kind of action are one: names of both, and the match."""
_TRIALS = 50
"""Starts among which the figure looks for one from which both pursuers capture."""


def find(out: Path, matches: RoundRobin) -> Finding:
    """Two tables, and a figure of both motions.

    Args:
        out: folder of the figure.
        matches: all of them, played.
    """
    game, found = matches.game, matches.results()
    pairs = pairings(found)
    text = comparison(pairs) + "\n\n" + table(pairs, float(game.dt))
    fleeing = _first_of(CONTINUOUS, matches.players.evader)
    pursuers = [_first_of(kind, matches.players.pursuer) for kind in (DISCRETE, CONTINUOUS)]
    draw([Match(game, pursuer, fleeing, _TRIALS) for pursuer in pursuers], out / "smooth.png")
    data = [{"pursuer": pursuer, "evader": evader, **match.to_dict()} for (pursuer, evader), match in found.items()]
    return Finding("Smooth motion", text, ("smooth.png",), data={"matches": data})


def _first_of(kind: str, players: Mapping[str, Named]) -> Named:
    return next(player for name, player in players.items() if kind_of(name) == kind)


def kind_of(name: str) -> str:
    """The kind of action of an agent that was trained here; the name itself of any other."""
    kind = name.split(" ")[0]
    return kind if kind in KINDS else name


def pairings(found: Mapping[tuple[str, str], MatchResult]) -> Pairings:
    """Matches of strangers by the kinds of both sides: two of one name were trained against each other."""
    pairs: Pairings = {}
    for names, match in found.items():
        if names[0] != names[1]:
            pairs.setdefault((kind_of(names[0]), kind_of(names[1])), []).append((names, match))
    return pairs


def comparison(pairs: Pairings) -> str:
    """A row for each side and opponent: how often agents with continuous actions win there and those with discrete ones
    do, what the former have more, seed by seed, and how much both change their controls.
    """
    head = ["side", "against", "wins, continuous [%]", "wins, discrete [%]", "difference"]
    head += ["change of u, continuous", "change of u, discrete", "ratio"]
    lines: list[list[str]] = []
    for role, win in zip(Role, WINS, strict=True):
        for opponent in dict.fromkeys(pair[1 - role] for pair in pairs):
            both = [(kind, opponent) if role == Role.PURSUER else (opponent, kind) for kind in KINDS]
            if not all(pair in pairs for pair in both):  # of one seed alone, no two of a kind are strangers
                continue
            meetings = [pairs[pair] for pair in both]
            wins = [seed_means(these, role, lambda match, win=win: 100 * win(match)) for these in meetings]
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
        wins = seed_means(meetings, role, lambda match: 100 * match.pursuer_win_rate)
        cells = [mean_over_seeds(wins, "{:.1f}")]
        captured = [meeting for meeting in meetings if meeting[1].mean_capture_steps is not None]
        for steps in (lambda match: match.mean_capture_steps, lambda match: match.capture_steps_deviation):
            seconds = seed_means(captured, role, lambda match, steps=steps: dt * steps(match))
            cells.append(mean_over_seeds(seconds, "{:.1f}"))
        cells += [mean_over_seeds(seed_means(meetings, role, _change_of(side)), "{:.3f}") for side in Role]
        lines.append([*pair, *cells])
    return markdown_table(head, lines)


def seed_means(
    meetings: Sequence[tuple[tuple[str, str], MatchResult]], role: Role, value: Callable[[MatchResult], float]
) -> list[float]:
    """Of every agent of one side, the mean of a number over its matches, in the order of their names."""
    values: dict[str, list[float]] = {}
    for names, match in meetings:
        values.setdefault(names[role], []).append(value(match))
    return [float(np.mean(values[name])) for name in sorted(values)]


def _change_of(role: Role) -> Callable[[MatchResult], float]:
    return lambda match: float(np.mean((match.pursuer_change, match.evader_change)[role] or np.nan))


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
