"""What decides the paper's claims: the whole reproduction again, each time with one thing changed.

    python -m studies.sensitivity --budget quick

trains what is missing and tells the claims in a table, a row for each variant.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from apollonius.errors import exit_status
from apollonius.game.presets import make_game
from apollonius.learn.config import PRESETS, RunConfig
from apollonius.learn.learner_config import PROFILES
from apollonius.reproduce import figure4, figure6, table2, table3
from apollonius.reproduce.claims import Claim
from apollonius.reproduce.finding import Finding, percent
from apollonius.reproduce.study import Study
from apollonius.show.markdown import markdown_table
from studies import driver

JUDGES = (figure4, figure6, table2, table3)
"""The figures and tables that make claims of the paper."""


@dataclass(frozen=True, kw_only=True)
class Sensitivity(driver.AbstractStudy):
    """A reproduction for each variant of a budget."""

    name = "sensitivity"
    budget: str = driver.option("quick", choices=PRESETS, help="of each reproduction")
    seeds: int = driver.option(1)
    games: int = driver.option(10_000, help="games in each match")

    def studies(self) -> dict[str, Study]:
        """The reproductions by what was changed."""
        return {
            name: Study(
                self.out / name.replace(" ", "-").replace("=", "is"),
                self.budget,
                preset,
                tuple(range(self.seeds)),
                self.games,
            )
            for name, preset in variants(PRESETS[self.budget]).items()
        }

    def trainings(self) -> driver.Trainings:
        """Those of all variants."""
        return {folder: training for study in self.studies().values() for folder, training in study.trainings().items()}

    def finding(self) -> Finding:
        """The claims of each variant."""
        claims = {
            name: [claim for section in JUDGES for claim in section.run(study).claims]
            for name, study in self.studies().items()
        }
        data = {name: [claim.to_dict() for claim in row] for name, row in claims.items()}
        return Finding("What decides the claims", table(claims), data=data)


def variants(preset: RunConfig) -> dict[str, RunConfig]:
    """The preset, and the preset with one thing changed: c, the start speeds, the obstacles, the profile."""
    game = preset.game
    plain = replace(PROFILES["paper"], games=16, env_steps_per_update=16)
    return {
        "as reproduced": preset,
        "c = 3 in self-play": replace(preset, self_play=replace(preset.self_play, progress=3.0)),
        "moving starts": replace(preset, game=replace(game, starts=replace(game.starts, speed="moving"))),
        "four small discs": replace(preset, game=make_game("four-small")),
        "one large disc": replace(preset, game=make_game("one-large")),
        "plain DQN": replace(preset, dqn=plain),
    }


def table(claims: Mapping[str, Sequence[Claim]]) -> str:
    """Claims by variant as a Markdown table, a column each."""
    first = next(iter(claims.values()))
    paper = ["the paper", *(percent(claim.paper) for claim in first)]
    rows = [[name, *map(_cell, row)] for name, row in claims.items()]
    return markdown_table(["", *(claim.name for claim in first)], [paper, *rows])


def _cell(claim: Claim) -> str:
    low, high = claim.interval
    return f"{percent(claim.mean)} [{percent(low)}, {percent(high)}]"


main = partial(driver.main, Sensitivity)

if __name__ == "__main__":
    sys.exit(exit_status(main))
