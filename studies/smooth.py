"""Do continuous actions make motion smoother, and do their agents win as often? Several seeds against the zoo.

    python -m studies.smooth --out runs/smooth --seeds 3

trains what is missing there by the paper's curriculum, with every seed once by soft actor-critic and once by deep
Q-learning, one process on every core, plays all pursuers against all evaders, the zoo's among them, and writes
`smooth.json`, `smooth.md` and `smooth.png`. Stopped or killed at any point, the same command goes on where it was.
"""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from apollonius.agents.kind import Named
from apollonius.errors import exit_status
from apollonius.evaluate.match import Match, MatchResult, replay_game
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import gears
from apollonius.game.types import Outcome, Role
from apollonius.jobs import Job
from apollonius.learn.config import RunConfig
from apollonius.learn.learner_config import SACConfig
from apollonius.learn.opponents.opponent_config import OpponentConfig
from apollonius.learn.stage_config import SelfPlayConfig, StageConfig
from apollonius.replay import AllActions, Trajectory
from apollonius.reproduce.finding import Finding
from apollonius.show import style
from apollonius.show.arena import draw_game
from apollonius.show.curves import draw_lines
from apollonius.show.markdown import markdown_table, mean_over_seeds
from studies import driver

ZOO = BySide(("P_curriculum", "P_scratch"), ("E_curriculum", "E_scratch", "random"))
"""Whom all of them meet beside each other: the paper's own."""
MATCH_SEED = 1
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


def run_config(kind: str, seed: int, stage_1: int, self_play: int) -> RunConfig:
    """The curriculum with one kind of action, otherwise alike; `stage_1` and `self_play` are env steps.

    Half of the games of self-play are against earlier versions: without them, two that have slowed down together
    forget what a fast opponent is like.
    """
    opponents = OpponentConfig(scheme="prioritised-hard")
    return RunConfig(
        seed=seed,
        sac=SACConfig() if kind == CONTINUOUS else None,
        fixed_target=StageConfig(env_steps=stage_1, evaluations=12, evaluation_games=500),
        self_play=SelfPlayConfig(env_steps=self_play, evaluations=12, evaluation_games=500, opponents=opponents),
    )


@dataclass(frozen=True, kw_only=True)
class Smooth(driver.AbstractStudy):
    """Both kinds of action with several seeds."""

    name = "smooth"
    seeds: int = driver.option(3)
    stage_1: int = driver.option(6_000_000, help="env steps against an evader that stays")
    self_play: int = driver.option(8_000_000, help="env steps of self-play")
    games: int = driver.option(10_000, help="games in each match")

    def trainings(self) -> driver.Trainings:
        """Of each seed, one for each kind."""
        return {
            self.out / kind / f"seed-{seed}": (
                run_config(kind, seed, self.stage_1, self.self_play),
                ("P_stage1", *driver.LAST),
            )
            for seed in range(self.seeds)
            for kind in KINDS
        }

    @property
    def matches(self) -> RoundRobin:
        """All of them and the zoo; who was trained here is called by kind and seed."""
        runs = {f"{run.parent.name} {run.name}": run for run in self.trainings()}
        return RoundRobin(self.out / "matches", driver.entrants(ZOO, runs), self.games, MATCH_SEED)

    def jobs(self) -> Iterator[Sequence[Job]]:
        """The matches of each pursuer."""
        yield self.matches.jobs()

    def finding(self) -> Finding:
        """Two tables, and both motions."""
        matches, dt = self.matches, float(self.matches.game.dt)
        found = matches.results()
        pairs = pairings(found)
        fleeing = _first_of(CONTINUOUS, matches.players.evader)
        pursuers = [_first_of(kind, matches.players.pursuer) for kind in (DISCRETE, CONTINUOUS)]
        draw([Match(matches.game, BySide(pursuer, fleeing), _TRIALS) for pursuer in pursuers], self.out / "smooth.png")
        text = comparison(pairs) + "\n\n" + table(pairs, dt)
        return Finding("Smooth motion", text, ("smooth.png",), data=driver.as_data(found))


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
            both = [BySide.of(role, kind, opponent).pair for kind in KINDS]
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


def turn_rates(actions: AllActions) -> np.ndarray:
    """The pursuer's turn rate in every step, as a share of its largest."""
    return np.array([float(gears(action)[1]) for action in actions[:, 0]])


main = partial(driver.main, Smooth)

if __name__ == "__main__":
    sys.exit(exit_status(main))
