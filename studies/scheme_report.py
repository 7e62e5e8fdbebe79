"""What the schemes of self-play come to: a table, its numbers, and a figure."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.document import write_atomically
from apollonius.game.types import Role
from apollonius.learn.folder import load_config
from apollonius.show import style
from apollonius.show.curves import draw_lines
from apollonius.show.markdown import markdown_table, mean_over_seeds
from studies.scheme_measures import ZOO, Effort, everyone


def write_results(out: Path, runs: Sequence[Path], effort: Effort) -> str:
    """Write `schemes.json`, `schemes.md` and, if any earlier agents were judged, `schemes.png`; returns the table.

    Args:
        runs: folders of runs that were judged, as SCHEME/SEED.
    """
    found, env_steps = results(out, runs, effort), load_config(runs[0] / "config.toml").self_play.env_steps
    record = {"settings": {"env_steps": env_steps, **asdict(effort)}, "schemes": found}
    write_atomically(out / "schemes.json", json.dumps(record, indent=1).encode())
    write_atomically(out / "schemes.md", (table(found) + "\n").encode())
    if any(len(curve) > 2 for row in found.values() for curve in row["curve"]):
        draw(found, out / "schemes.png", env_steps)
    return table(found)


def results(out: Path, runs: Sequence[Path], effort: Effort) -> dict[str, Any]:
    """All that was measured, by scheme, a list over seeds each."""
    rated = everyone(out, runs, effort).tournament().ratings
    by_scheme: dict[str, Any] = {}
    for index, run in enumerate(runs):
        judged = json.loads((run / "judged.json").read_text())
        lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
        row = by_scheme.setdefault(run.parent.name, {"seconds": [], "pursuer": [], "evader": [], "curve": []})
        row["seconds"].append(lines[-1]["seconds"])
        row["curve"].append({name: loss["most"] for name, loss in judged.items()})
        for side, points, reach in (
            ("pursuer", rated.pursuers, rated.pursuer_reach),
            ("evader", rated.evaders, rated.evader_reach),
        ):
            elo = {"elo": float(points[index]), "elo_reach": float(reach[index])}
            row[side].append(judged[f"{side}-100"] | elo)
    return by_scheme


def table(by_scheme: dict[str, Any]) -> str:
    """A row for each scheme: means over seeds, and how far 95 % intervals reach (Student's t over seeds)."""
    head = ["scheme", "pursuer loses at least", "evader loses at least", "pursuer's Elo", "evader's Elo"]
    against = {"pursuer": ZOO[Role.EVADER], "evader": ZOO[Role.PURSUER]}
    head += [f"pursuer wins against {name}" for name in against["pursuer"]]
    head += [f"evader unbeaten by {name}" for name in against["evader"]]
    lines: list[list[str]] = []
    for scheme, row in by_scheme.items():
        cells = [scheme]
        cells += [_share([agent["most"] for agent in row[side]]) for side in ("pursuer", "evader")]
        cells += [mean_over_seeds([agent["elo"] for agent in row[side]], "{:.0f}") for side in ("pursuer", "evader")]
        for side in ("pursuer", "evader"):
            for name in against[side]:
                cells.append(_share([1 - agent["against"][name]["rate"] for agent in row[side]]))
        lines.append([*cells, mean_over_seeds([seconds / 60 for seconds in row["seconds"]], "{:.1f}")])
    return markdown_table([*head, "minutes"], lines)


def _share(values: Sequence[float]) -> str:
    return mean_over_seeds([100 * value for value in values], "{:.1f}") + " %"


def draw(by_scheme: dict[str, Any], path: Path, env_steps: int) -> None:
    """Both sides' losses against env steps, a line for each scheme: the mean over the seeds that have a curve."""
    with style.picture(path, columns=2, width=5.2, height=3.4) as panels:
        for axes, side in zip(panels, ("pursuer", "evader"), strict=True):
            lines = {}
            for scheme, row in by_scheme.items():
                curves = [curve for curve in row["curve"] if len(curve) > 2]
                if curves:
                    percents = sorted(int(name.split("-")[1]) for name in curves[0] if name.startswith(side))
                    losses = [[100 * curve[f"{side}-{percent}"] for percent in percents] for curve in curves]
                    lines[scheme] = (
                        [env_steps * percent / 100 for percent in percents],
                        np.mean(losses, axis=0).tolist(),
                    )
            draw_lines(axes, lines)
            axes.set_title(f"how much the {side} loses at least [% of games]")
            axes.set_xlabel("env steps")
        panels[-1].legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))  # beside the lines, which fill the panel
