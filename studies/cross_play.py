"""Do both sides beat their own past? Every pursuer kept during self-play against every evader kept.

    python -m studies.cross_play runs/first --games 2000

tells the pursuer's win rates with Wilson 95 % intervals in a table: a row is a pursuer, a column an evader, evenly
spaced over the stage. A pursuer that improves wins more further down; an evader that does lets it win less further to
the right. `all` is the sum of a row or a column.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from apollonius.agents.store import load_header
from apollonius.errors import exit_status
from apollonius.evaluate.pairings import last_agents
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.by_side import BySide
from apollonius.jobs import Job
from apollonius.learn.folder import agent_file, load_config
from apollonius.reproduce.finding import Finding
from apollonius.show.markdown import markdown_table
from studies import driver


@dataclass(frozen=True, kw_only=True)
class CrossPlay(driver.AbstractStudy):
    """The agents that a run of self-play has kept, against each other."""

    name = "cross_play"
    run: Path = driver.option(type=Path, help="folder of a training run with self-play")
    games: int = driver.option(2000, help="games in each match")
    seed: int = driver.option(0, help="of the starts")

    def jobs(self) -> Iterator[Sequence[Job]]:
        """The matches of each pursuer."""
        yield self.matches.jobs()

    @property
    def matches(self) -> RoundRobin:
        """All agents, by the percentage of self-play at which they were kept."""
        percents = load_config(self.run / "config.toml").self_play.snapshot_percents
        (evader,) = [name for name, file in last_agents(self.run).items() if load_header(file).role == "evader"]
        kept = BySide(evader.replace("E_", "P_", 1), evader).map(
            lambda name: {f"{percent} %": str(agent_file(self.run, name, percent)) for percent in percents}
        )
        return RoundRobin(self.out / "matches", kept, self.games, self.seed)

    def finding(self) -> Finding:
        """The table."""
        played = self.matches.tournament()
        wins = played.wins.astype(int)
        rows = [table_row(name, row, self.games) for name, row in zip(played.pursuers, wins, strict=True)]
        rows.append(table_row("all", wins.sum(axis=0), self.games * len(wins)))
        text = markdown_table(["pursuer \\ evader", *played.evaders, "all"], rows)
        return Finding(f"The pursuers of {self.run} against its evaders", text, data=played.to_dict())


def table_row(name: str, wins: np.ndarray, games: int) -> list[str]:
    """A row of the table: wins out of so many games each, and out of all of them."""
    counts = [*((int(won), games) for won in wins), (int(wins.sum()), games * len(wins))]
    intervals = [(won / of, *wilson_interval(won, of)) for won, of in counts]
    return [name, *(f"{rate:.1%} [{low:.1%}, {high:.1%}]" for rate, low, high in intervals)]


main = partial(driver.main, CrossPlay)

if __name__ == "__main__":
    sys.exit(exit_status(main))
