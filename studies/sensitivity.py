"""What decides the paper's claims: the whole study again, each time with one thing changed.

`python -m studies.sensitivity --budget quick --out DIR` trains what is missing there and prints a
Markdown table, a row for each variant. Stopped, it goes on where it was.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from apollonius.game.presets import make_game
from apollonius.jobs import available_cores
from apollonius.learn.config import PRESETS, RunConfig
from apollonius.learn.learner_config import PROFILES
from apollonius.reproduce import figure4, figure6, table2, table3
from apollonius.reproduce.claims import Claim
from apollonius.reproduce.finding import percent
from apollonius.reproduce.study import Study, train_missing
from apollonius.show.markdown import markdown_table

JUDGES = (figure4, figure6, table2, table3)
"""The figures and tables that make claims of the paper."""


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


def claims_of(study: Study) -> list[Claim]:
    """The paper's claims, judged by the agents of a study."""
    return [claim for section in JUDGES for claim in section.run(study).claims]


def table(claims: dict[str, list[Claim]]) -> str:
    """Claims by variant as a Markdown table, a column each."""
    first = next(iter(claims.values()))
    paper = ["the paper", *(percent(claim.paper) for claim in first)]
    rows = [[name, *map(_cell, row)] for name, row in claims.items()]
    return markdown_table(["", *(claim.name for claim in first)], [paper, *rows])


def _cell(claim: Claim) -> str:
    low, high = claim.interval
    return f"{percent(claim.mean)} [{percent(low)}, {percent(high)}]"


def main() -> None:
    """Train and judge every variant, then print the table."""
    parser = argparse.ArgumentParser(description="What decides the paper's claims.")
    parser.add_argument("--budget", choices=PRESETS, default="quick")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--games", type=int, default=10_000)
    parser.add_argument("--out", type=Path, default=Path("runs/sensitivity"))
    options = parser.parse_args()
    claims = {}
    for name, preset in variants(PRESETS[options.budget]).items():
        folder = options.out / name.replace(" ", "-").replace("=", "is")
        folder.mkdir(parents=True, exist_ok=True)
        study = Study(folder, options.budget, preset, tuple(range(options.seeds)), options.games)
        if not train_missing(study, available_cores(), print):
            return
        claims[name] = claims_of(study)
        print(table(claims), flush=True)


if __name__ == "__main__":
    main()
