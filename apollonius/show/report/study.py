"""The report of a reproduction: claims with verdicts, figures and tables beside the paper's, and games."""

import json
from pathlib import Path

from apollonius.agents.store import load_header
from apollonius.arenas.record import from_dict
from apollonius.catalogue import find_player
from apollonius.errors import InvalidInput
from apollonius.evaluate.match import Match
from apollonius.evaluate.pairings import last_agents
from apollonius.evaluate.paper import TABLE_2, TABLE_3
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import ROLES
from apollonius.show.report.games import GAMES, ORDER, SEED, Shown, games_to_show
from apollonius.show.report.page import Page, Section, picture

_PAIRINGS = (("P_stage1", "still"), *((name, "random") for name in TABLE_2), *((name, "E_scratch") for name in TABLE_3))
"""The matches that the paper reports."""


def study_page(folder: Path) -> Page:
    """The report of the finished reproduction in a folder.

    Raises:
        InvalidInput: when a file is missing or not what `apollonius reproduce` writes.
    """
    path = folder / "results.json"
    try:
        results = json.loads(path.read_text())
        sections = [
            Section(title, found["text"], [picture(folder / name, title) for name in found["pictures"]])
            for title, found in results["findings"].items()
        ]
        claims, budget = results["claims"], results["budget"]
        verdicts = [claim["verdict"] for claim in claims]
        held, refuted, open_, not_enough = map(verdicts.count, ("holds", "does not hold", "undecided", "not enough"))
        first, *_ = seeds = results["seeds"]
        summary = (
            f"Six agents, trained with budget {budget} and seed{'s' if len(seeds) > 1 else ''} "
            f"{', '.join(map(str, seeds))}; {results['games']:,} games in a match, all on the same starts. Intervals "
            f"are 95 %, {results['intervals']}. "
            f"Of {len(claims)} claims, {held} hold, {refuted} do not, {open_} are undecided, and "
            f"for {not_enough} there is not enough training."
        )
        command = f"apollonius reproduce --budget {budget} --seeds {len(seeds)} --games {results['games']} --out NEW"
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        again = "run apollonius reproduce with --resume again"
        raise InvalidInput(f"'{path}' is not of this version ({type(error).__name__}: {error}): {again}.") from error
    return Page(
        title="The paper's evaluation, again",
        summary=summary,
        claims=claims,
        sections=sections,
        games=_games(folder / f"seed-{first}"),
        games_note=(
            f"Of {GAMES} games from seed {SEED} of each match that the paper reports, between the agents of seed "
            f"{first}: {ORDER}"
        ),
        config=(folder / f"seed-{first}" / "curriculum" / "config.toml").read_text(),
        command=command,
    )


def _games(seed: Path) -> list[Shown]:
    files = {name: file for run in sorted(seed.iterdir()) for name, file in last_agents(run).items()}
    shown = []
    for pursuer, evader in _PAIRINGS:
        game = from_dict(Game, load_header(files[pursuer]).game, f"'{files[pursuer]}'")
        names = BySide(*(str(files.get(name, name)) for name in (pursuer, evader)))
        players = ROLES.map(lambda role, names=names, game=game: find_player(names[role], role, game))
        shown += games_to_show(Match(game, players, GAMES, SEED))
    return shown
