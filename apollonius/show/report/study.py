"""The report of a reproduction: claims with verdicts, figures and tables beside the paper's, and games."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from apollonius.agents.store import load_header
from apollonius.arenas.record import from_dict
from apollonius.catalogue import find_player
from apollonius.document import parse_json, read_bytes
from apollonius.errors import require
from apollonius.evaluate.claims import FULL_BUDGET, TABLE_2, TABLE_3, Claim, read_claim
from apollonius.evaluate.match import Match
from apollonius.evaluate.pairings import last_agents
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import ROLES
from apollonius.learn.folder import load_config
from apollonius.limits import SEED as SEEDS
from apollonius.limits import STUDY_GAMES
from apollonius.show.report.games import GAMES, ORDER, SEED, Shown, games_to_show
from apollonius.show.report.page import Page, Section, picture

_PAIRINGS = (("P_stage1", "still"), *((name, "random") for name in TABLE_2), *((name, "E_scratch") for name in TABLE_3))
"""The matches that the paper reports."""
_MOST_BYTES = 2**23
"""Largest `results.json` [bytes]; three seeds of the whole budget take 60 thousand."""
_LONGEST_TEXT = 2**17
"""Most characters of a finding's text."""


@dataclass(frozen=True)
class Found:
    """A finding, as `results.json` has it."""

    text: str
    pictures: tuple[str, ...]
    data: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require(len(self.text) <= _LONGEST_TEXT, "text", f"{len(self.text):,} characters", f"{_LONGEST_TEXT:,} at most")


@dataclass(frozen=True)
class Results:
    """What `apollonius reproduce` writes as `results.json`."""

    budget: str
    seeds: tuple[int, ...]
    games: int
    intervals: str
    claims: list[dict[str, Any]]
    findings: dict[str, Found]

    def __post_init__(self) -> None:
        require(self.budget.replace("-", "").isalnum(), "budget", self.budget, "the name of a preset")
        require(self.seeds, "seeds", "none", "one at least")
        for seed in self.seeds:
            SEEDS.require("seeds", seed)
        require(1 <= self.games <= STUDY_GAMES.most, "games", self.games, f"from 1 to {STUDY_GAMES.most:,}")


def load_results(path: Path) -> tuple[Results, list[Claim]]:
    """Return what a reproduction found, and its claims.

    Raises:
        InvalidInput: when it is not what `apollonius reproduce` writes, or leads outside its folder.
    """
    remedy = "run apollonius reproduce with --resume again"
    about = f"'{path}' is no result of a reproduction; {remedy}"
    content = read_bytes(path, "the results of a reproduction", remedy, _MOST_BYTES, within=path.parent)
    results = from_dict(Results, parse_json(content, about), about)
    return results, [read_claim(claim, about) for claim in results.claims]


def study_page(folder: Path) -> Page:
    """Return the report of the finished reproduction in a folder.

    Raises:
        InvalidInput: when a file is missing or not what `apollonius reproduce` writes.
    """
    results, found = load_results(folder / "results.json")
    claims = [claim.to_dict(results.budget == FULL_BUDGET) for claim in found]
    verdicts = [claim["verdict"] for claim in claims]
    held, refuted, open_, not_enough = map(verdicts.count, ("holds", "does not hold", "undecided", "not enough"))
    first, *_ = seeds = results.seeds
    summary = (
        f"Six agents, trained with budget {results.budget} and seed{'s' if len(seeds) > 1 else ''} "
        f"{', '.join(map(str, seeds))}; {results.games:,} games in a match, all on the same starts. Intervals "
        f"are 95 %, {results.intervals}. "
        f"Of {len(claims)} claims, {held} hold, {refuted} do not, {open_} are undecided, and "
        f"for {not_enough} there is not enough training."
    )
    config = folder / f"seed-{first}" / "curriculum" / "config.toml"
    load_config(config, folder)  # refuses what is none
    return Page(
        title="The paper's evaluation, again",
        summary=summary,
        claims=claims,
        sections=[
            Section(title, found.text, [picture(folder, name, title) for name in found.pictures])
            for title, found in results.findings.items()
        ],
        games=_games(folder / f"seed-{first}"),
        games_note=(
            f"Of {GAMES} games from seed {SEED} of each match that the paper reports, between the agents of seed "
            f"{first}: {ORDER}"
        ),
        config=config.read_text("utf-8"),
        command=(
            f"apollonius reproduce --budget {results.budget} --seeds {len(seeds)} --games {results.games} --out NEW"
        ),
    )


def _games(seed: Path) -> list[Shown]:
    files = {name: file for run in sorted(seed.iterdir()) for name, file in last_agents(run).items()}
    shown = []
    for pursuer, evader in _PAIRINGS:
        missing = {pursuer, evader} - {*files, "still", "random"}
        require(not missing, f"agents in '{seed}'", ", ".join(files), f"with {', '.join(missing)}; reproduce again")
        game = from_dict(Game, load_header(files[pursuer]).game, f"'{files[pursuer]}'")
        names = BySide(*(str(files.get(name, name)) for name in (pursuer, evader)))
        players = ROLES.map(lambda role, names=names, game=game: find_player(names[role], role, game))
        shown += games_to_show(Match(game, players, GAMES, SEED))
    return shown
