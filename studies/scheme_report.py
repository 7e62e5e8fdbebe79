"""What the schemes of self-play come to: a table, its numbers, and a figure."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from apollonius.evaluate.tournament import Tournament
from apollonius.game.by_side import BySide
from apollonius.game.types import ROLES, Role
from apollonius.learn.folder import load_config
from apollonius.reproduce.finding import Finding
from apollonius.show import style
from apollonius.show.curves import draw_lines
from apollonius.show.markdown import markdown_table, mean_over_seeds
from studies import judgement
from studies.judgement import Effort, Judgement, judge, judged


@dataclass(frozen=True)
class Measured:
    """What was measured of a run.

    Attributes:
        seconds: of its training.
        judgements: of either side's agents, by the percentage of self-play at which each was kept.
        elo: of either side's last agent, and the reach of its 95 % interval.
    """

    seconds: float
    judgements: BySide[dict[int, Judgement]]
    elo: BySide[tuple[float, float]]

    def losses(self, role: Role) -> list[float]:
        """How much a side loses at least, as self-play goes on [%]."""
        return [100 * judgement.most for judgement in self.judgements[role].values()]


Schemes = Mapping[str, Sequence[Measured]]
"""The runs of each scheme, one for each seed."""


def find(out: Path, runs: Mapping[str, Path], effort: Effort, played: Tournament) -> Finding:
    """A table of all schemes and, if any earlier agents were judged, a figure.

    Args:
        runs: by name, SCHEME/seed-N, folders of runs that were judged.
        played: the tournament of their last agents.
    """
    env_steps = load_config(next(iter(runs.values())) / "config.toml").self_play.env_steps
    ratings: dict[str, dict[str, dict[str, float]]] = played.to_dict()["ratings"]
    schemes: dict[str, list[Measured]] = {}
    for name, run in runs.items():
        *_, last_line = (run / "metrics.jsonl").read_text().splitlines()
        judgements = ROLES.map(lambda role, run=run: {at: judge(run, role, at, effort) for at in judged(run, role)})
        rated = BySide(ratings["pursuers"][name], ratings["evaders"][name])
        elo = rated.map(lambda row: (row["elo"], row["high"] - row["elo"]))
        schemes.setdefault(name.split("/")[0], []).append(Measured(json.loads(last_line)["seconds"], judgements, elo))
    curves = any(len(run.losses(Role.PURSUER)) > 1 for runs in schemes.values() for run in runs)
    if curves:
        draw(schemes, out / "schemes.png", env_steps)
    settings = {"env_steps": env_steps, **asdict(effort), "rating_games": played.games}
    data = {"settings": settings, "schemes": {name: [asdict(run) for run in runs] for name, runs in schemes.items()}}
    return Finding("Schemes of self-play", table(schemes), ("schemes.png",) if curves else (), data=data)


def table(schemes: Schemes) -> str:
    """A row for each scheme: means over seeds, and how far 95 % intervals reach (Student's t over seeds)."""
    wins = [(Role.PURSUER, name, f"pursuer wins against {name}") for name in judgement.ZOO.evader]
    wins += [(Role.EVADER, name, f"evader unbeaten by {name}") for name in judgement.ZOO.pursuer]
    head = ["scheme", "pursuer loses at least", "evader loses at least", "pursuer's Elo", "evader's Elo"]
    lines: list[list[str]] = []
    for scheme, runs in schemes.items():
        cells = [scheme, *(_share(runs, role, lambda agent: agent.most) for role in Role)]
        cells += [mean_over_seeds([run.elo[role][0] for run in runs], "{:.0f}") for role in Role]
        cells += [_share(runs, role, lambda agent, name=name: 1 - agent.against[name].rate) for role, name, _ in wins]
        lines.append([*cells, mean_over_seeds([run.seconds / 60 for run in runs], "{:.1f}")])
    return markdown_table([*head, *(words for *_, words in wins), "minutes"], lines)


def _share(runs: Sequence[Measured], role: Role, rate: Callable[[Judgement], float]) -> str:
    return mean_over_seeds([100 * rate(run.judgements[role][100]) for run in runs], "{:.1f}") + " %"


def draw(schemes: Schemes, path: Path, env_steps: int) -> None:
    """Both sides' losses against env steps, a line for each scheme: the mean over the seeds that have a curve."""
    with style.picture(path, columns=2, width=5.2, height=3.4) as panels:
        for axes, role in zip(panels, Role, strict=True):
            lines = {}
            for scheme, runs in schemes.items():
                curves = [run for run in runs if len(run.losses(role)) > 1]
                if curves:
                    steps = [env_steps * percent / 100 for percent in curves[0].judgements[role]]
                    lines[scheme] = (steps, np.mean([run.losses(role) for run in curves], axis=0).tolist())
            draw_lines(axes, lines)
            axes.set_title(f"how much the {role.name.lower()} loses at least [% of games]")
            axes.set_xlabel("env steps")
        panels[-1].legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))  # beside the lines, which fill the panel
