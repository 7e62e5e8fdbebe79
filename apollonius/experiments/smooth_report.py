"""What agents with continuous actions come to beside discrete ones: a table, its numbers, and both motions."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.agents.catalogue import find_agent
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.store import write_atomically
from apollonius.evaluate.match import replay_game
from apollonius.evaluate.statistics import mean_band
from apollonius.game.dynamics import gears
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.replay import BothActions, Trajectory
from apollonius.show import style
from apollonius.show.arena import draw_game
from apollonius.show.curves import draw_lines

CONTINUOUS = "continuous"
"""Begins the names of agents with continuous actions; after it comes the run."""
Match = dict[str, Any]
_TRIALS = 50
"""Starts among which the figure looks for one from which both pursuers capture."""


def write_results(
    out: Path, rows: Mapping[str, Mapping[str, Match]], pursuers: Mapping[str, str], evaders: Mapping[str, str]
) -> str:
    """Write `smooth.json`, `smooth.md` and `smooth.png`; returns the table.

    Args:
        rows: matches by pursuer and evader, as `MatchResult.to_dict` has them.
        pursuers, evaders: by name, the agents or their files.
    """
    game = make_game("paper")
    written = table(rows, float(game.dt))
    write_atomically(out / "smooth.json", json.dumps(rows, indent=1).encode())
    write_atomically(out / "smooth.md", (written + "\n").encode())
    pair = [next(agent for name, agent in pursuers.items() if is_continuous(name) == kind) for kind in (False, True)]
    evader = next(agent for name, agent in evaders.items() if not is_continuous(name))
    policies = [find_agent(agent, Role.PURSUER, game).policy for agent in pair]
    draw(game, policies, find_agent(evader, Role.EVADER, game).policy, out / "smooth.png")
    return written


def is_continuous(name: str) -> bool:
    """Whether an agent's name is that of one with continuous actions."""
    return name.startswith(CONTINUOUS)


def table(rows: Mapping[str, Mapping[str, Match]], dt: float) -> str:
    """A row for each pairing, all continuous agents of a side being one: means over their seeds, and how far 95 %
    intervals reach (Student's t over seeds). Where both sides are continuous, the seeds are the pursuer's, and each has
    its mean over all evaders.
    """
    pairs: dict[tuple[str, str], dict[str, list[Match]]] = {}
    for pursuer, row in rows.items():
        for evader, match in row.items():
            kinds = [CONTINUOUS if is_continuous(name) else name for name in (pursuer, evader)]
            seeds = pairs.setdefault((kinds[0], kinds[1]), {})
            seeds.setdefault(pursuer if is_continuous(pursuer) else evader, []).append(match)
    head = ["pursuer", "evader", "pursuer wins [%]", "capture time [s]", "its deviation [s]"]
    lines = [[*head, "pursuer's change of u", "evader's change of u"], ["---"] * (len(head) + 2)]
    for pair, seeds in pairs.items():
        wins = [[100 * match["pursuer_win_rate"] for match in seed] for seed in seeds.values()]
        cells = [mean_over_seeds(wins, "{:.1f}")]
        for name in ("mean_capture_steps", "capture_steps_deviation"):
            seconds = [[dt * match[name] for match in seed if match[name] is not None] for seed in seeds.values()]
            cells.append(mean_over_seeds(seconds, "{:.1f}"))
        for side in ("pursuer", "evader"):
            changes = [[float(np.mean(match[f"{side}_change"])) for match in seed] for seed in seeds.values()]
            cells.append(mean_over_seeds(changes, "{:.3f}"))
        lines.append([*pair, *cells])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def mean_over_seeds(values: Sequence[Sequence[float]], form: str) -> str:
    """The mean over seeds of the mean of each one's values, and half its interval where there are several seeds."""
    means = [sum(seed) / len(seed) for seed in values if seed]
    if not means:
        return "-"
    middle = form.format(sum(means) / len(means))
    if len(means) < 2:
        return middle
    low, high = mean_band(np.asarray(means)[:, None])
    return f"{middle} ± {form.format(float(high[0] - low[0]) / 2)}"


def draw(game: Game, pursuers: Sequence[AbstractPolicy], evader: AbstractPolicy, path: Path) -> None:
    """The games of a discrete and a continuous pursuer from the same start, and their turn rates: from the first start
    from which both capture, if there is one.
    """
    courses: list[Trajectory] = []
    for index in range(_TRIALS):
        courses = [replay_game(game, pursuer, evader, _TRIALS, 0, index) for pursuer in pursuers]
        if all(course.outcome == Outcome.CAPTURED for course in courses):
            break
    titles = ("discrete", CONTINUOUS)
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
