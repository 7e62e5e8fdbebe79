"""The report of a training run: how its agents learned, how good they are, and games that they play."""

import json
import tomllib
from pathlib import Path
from typing import Any

from markupsafe import Markup

from apollonius.agents.built_in import PLAYERS
from apollonius.arenas.record import from_dict
from apollonius.errors import InvalidInput
from apollonius.evaluate.match import MatchResult
from apollonius.evaluate.pairings import last_matches
from apollonius.evaluate.paper import paper_shares
from apollonius.evaluate.trend import self_play_trend
from apollonius.game.game import Game
from apollonius.show.report.games import GAMES, ORDER, SEED, Shown, games_to_show
from apollonius.show.report.learning import learning_pictures
from apollonius.show.report.page import Judged, Page, Section

_STAGES = {"fixed-target": "fixed_target", "self-play": "self_play"}
"""Names of the stages, and of their tables in the configuration."""


def training_page(folder: Path) -> Page:
    """The report of the training run in a folder, finished or not.

    Raises:
        InvalidInput: when a file of the run is missing or not what training writes.
    """
    try:
        text = (folder / "config.toml").read_text()
        config = tomllib.loads(text)
        lines = _lines(folder / "metrics.jsonl")
        stages = [stage for stage in _STAGES if config["stages"] in (stage, "both")]
        facts = [_fact(stage, lines, config) for stage in stages]
        matches = _matches(folder / "evaluation.json", folder.resolve().name)
        game = from_dict(Game, config["game"], f"'{folder / 'config.toml'}'")
        sections = [section for stage in stages if (section := _learning(stage, lines, config))]
        seed = config["seed"]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        if isinstance(error, InvalidInput):
            raise
        message = f"'{folder}' is no whole training run ({type(error).__name__}: {error}): train it again."
        raise InvalidInput(message) from error
    games = _games(folder, game)
    return Page(
        title=f"Training run {folder.resolve().name}",
        summary=f"{_described(game)} Stages: {', '.join(stages)}; seed {seed}.",
        warnings=_warnings(folder, facts, matches, games),
        matches=matches,
        matches_note=(
            "Greedy agents, judged when the training had ended. Bars go from the pursuer's best outcome to its worst. "
            "Where the paper reports a match between agents trained in the same way, its shares stand beside ours."
        ),
        sections=sections,
        games=games,
        games_note=f"Of {GAMES} games of each pairing from seed {SEED}, {ORDER}",
        facts=[("stage", "env steps", "planned", "episodes", "updates", "minutes", "env steps per second"), *facts],
        config=text,
        command=f"apollonius train --config {folder / 'config.toml'} --out NEW",
    )


def _lines(path: Path) -> list[dict[str, Any]]:
    """The lines of a run's metrics; none where it has not begun."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []


def _described(game: Game) -> str:
    arena = game.arena
    obstacles = f"{len(arena.discs)} discs" + (f", {len(arena.polygons)} polygons" if arena.polygons else "")
    obstacles += f", the map {Path(arena.map.file).name}" if arena.map else ""
    return (
        f"Arena {arena.x_max - arena.x_min:g} m by {arena.y_max - arena.y_min:g} m, {obstacles}; "
        f"capture within {game.capture_distance:g} m; at most {game.max_steps * game.dt:g} s."
    )


def _fact(stage: str, lines: list[dict[str, Any]], config: dict[str, Any]) -> tuple[str, ...]:
    """A row of the table of stages: how far training came, and how fast it was."""
    planned = f"{config[_STAGES[stage]]['env_steps']:,}"
    own = [line for line in lines if line["stage"] == stage]
    if not own:
        return stage, "0", planned, "0", "0", "-", "-"
    last = own[-1]
    rate = f"{last['env_steps'] / last['seconds']:,.0f}" if last["seconds"] else "-"
    counts = (f"{last[name]:,}" for name in ("episodes", "updates"))
    return stage, f"{last['env_steps']:,}", planned, *counts, f"{last['seconds'] / 60:.1f}", rate


def _warnings(folder: Path, facts: list[tuple[str, ...]], matches: list[Judged], games: list[Shown]) -> list[str]:
    """What the run lacks, in words."""
    found = []
    for stage, done, planned, *_ in facts:
        if int(done.replace(",", "")) < int(planned.replace(",", "")):
            found.append(
                f"Not finished: {stage} stands at {done} of {planned} env steps. Go on with: apollonius resume {folder}"
            )
    if not matches:
        found.append("Not judged: the run has no evaluation.json, which apollonius train writes when it has finished.")
    if not games:
        found.append("No games to show: no stage has ended, so there are no agents yet.")
    return found


def _matches(path: Path, run: str) -> list[Judged]:
    """The matches that judged the run; none where it was not judged."""
    judged = []
    for name, result in (json.loads(path.read_text()) if path.is_file() else {}).items():
        pursuer, evader = name.split(" against ")
        judged_as = from_dict(MatchResult, result, f"'{path}'")
        ours = [name if name in PLAYERS else f"{run}/{name}" for name in (pursuer, evader)]
        judged.append(Judged(ours[0], ours[1], judged_as, paper_shares(pursuer, evader)))
    return judged


def _learning(stage: str, lines: list[dict[str, Any]], config: dict[str, Any]) -> Section | None:
    own = [line for line in lines if line["stage"] == stage]
    if not own:
        return None
    pictures = [Markup(svg) for svg in learning_pictures(own, against=config["evaders"])]
    games = config[_STAGES[stage]]["evaluation_games"]
    text = (
        f"Greedy games: {games:,} from fixed starts, with Wilson 95 % intervals over games as bands. Rewards and "
        "losses: running means over the games and updates of training, in which players explore."
    )
    if stage == "self-play":
        text = f"{text}\n\n{self_play_trend([line['evaluation'] for line in own if 'evaluation' in line])}".rstrip()
    return Section(f"Learning: {stage}", text, pictures)


def _games(folder: Path, game: Game) -> list[Shown]:
    matches = last_matches(folder, game, GAMES, SEED).values()
    return [shown for match in matches for shown in games_to_show(match)]
