"""The report of a training run, one HTML file: how its agents learned, how good they are, and games
that they play.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from apollonius.agents.built_in import PLAYERS
from apollonius.evaluate.claims import paper_shares
from apollonius.evaluate.match import Match, play_games, record_game, worst_first
from apollonius.evaluate.pairings import last_matches
from apollonius.evaluate.result import MatchResult, read_result
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS, names_of
from apollonius.io.document import parse_json, read_bytes, write_atomically
from apollonius.io.errors import require
from apollonius.learn.config import FIXED_TARGET, SELF_PLAY
from apollonius.learn.folder import load_config
from apollonius.learn.metrics import load_metrics
from apollonius.play.replay import Replay, as_data
from apollonius.show import palette
from apollonius.show.curves import learning_pictures

GAMES = 200
"""Games of each pairing among which those that are shown are found."""
SEED = 1
LONGEST = 50_000
"""Most steps of such a game; the paper's have 1,000 at most."""
MAX_BYTES = 3_000_000
"""Largest report: one that can be sent by mail."""
_DIGITS = 3
"""Decimals of the states in the page: a millimetre, which is less than a pixel."""
_BAR = (
    "captured", "evader_hit_obstacle", "evader_out_of_range", "no_result",
    "both_failed", "pursuer_out_of_range", "pursuer_hit_obstacle", "territory_reached",
)  # fmt: skip
"""Outcomes from the pursuer's best to its worst, as bars show those that can be."""
_HERE = Path(__file__).parent


def for_page(replay: Replay) -> dict[str, Any]:
    """Return a game as the page's script reads it: a replay without actions, its states rounded.

    Of a game of teams `until` says for each robot the first step at which it is out of play, or
    None.
    """
    data = as_data(replay) | {"states": replay.states.astype(float).round(_DIGITS).tolist()}
    del data["actions"]
    if replay.game.teams:
        steps = replay.in_play().sum(axis=0).tolist()
        data["until"] = [step if step < len(replay.states) else None for step in steps]
    return data


def games_to_show(match: Match) -> list[tuple[Replay, int]]:
    """Return one game for each outcome of a match, in the order of `worst_first`, and how many
    games ended in this way; raises InvalidInput if they are too long.
    """
    bound = f"at most {LONGEST:,}, or no page could hold them"
    require(
        match.game.max_steps <= LONGEST,
        "steps of a game that a report shows",
        match.game.max_steps,
        bound,
    )
    results = play_games(match)
    outcomes = np.asarray(results.outcome)
    first: dict[int, int] = {}
    for index in worst_first(results):
        first.setdefault(int(outcomes[index]), index)
    return [
        (record_game(match, index), int(np.sum(outcomes == outcome)))
        for outcome, index in first.items()
    ]


@dataclass(frozen=True)
class JudgedMatch:
    """The result of a match between two agents, and the paper's shares of outcomes, as far as it
    reports them.
    """

    pursuer: str
    evader: str
    result: MatchResult
    paper: dict[str, float]

    @property
    def paper_win_rate(self) -> float:
        """The pursuer's win rate in the paper, of the outcomes that it reports."""
        return sum(self.paper.get(outcome, 0.0) for outcome in names_of(PURSUER_WINS))


def load_matches(path: Path) -> list[JudgedMatch]:
    """Return the matches of an `evaluation.json`, or nothing without one; raises InvalidInput for
    another file.
    """
    if not path.exists():
        return []
    remedy, run = "remove it, or train again", path.parent.resolve().name
    content = read_bytes(path, "what training wrote", remedy, within=path.parent)
    matches = []
    for name, data in parse_json(content, f"'{path}' has no results of matches; {remedy}").items():
        pair = name.split(" against ")
        require(len(pair) == 2, f"'{path}': match", name, f"NAME against NAME; {remedy}")
        names = [name if name in PLAYERS else f"{run}/{name}" for name in pair]
        matches.append(
            JudgedMatch(names[0], names[1], read_result(data, f"'{path}'"), paper_shares(*pair))
        )
    return matches


def report_of(folder: Path) -> dict[str, Any]:
    """Return all that the report of a training run shows, finished or not, by the names in
    `report.html`.
    """
    config = load_config(folder / "config.toml", folder)
    lines = load_metrics(folder / "metrics.jsonl", within=folder)
    stages = {
        name: plan.stage for name, plan in config.plans.items() if name in (FIXED_TARGET, SELF_PLAY)
    }
    by_stage = {name: [line for line in lines if line.stage == name] for name in stages}
    env_steps = {name: lines[-1].env_steps if lines else 0 for name, lines in by_stage.items()}
    matches = load_matches(folder / "evaluation.json")
    matches_to_play = last_matches(folder, config.game, GAMES, SEED).values()
    games = [game for match in matches_to_play for game in games_to_show(match)]
    warnings = list[str]()
    for name, stage in stages.items():
        if env_steps[name] < stage.env_steps:
            share = f"{name} stands at {env_steps[name]:,} of {stage.env_steps:,} env steps"
            warnings.append(f"Not finished: {share}. Go on with: apollonius resume {folder}")
    if not matches:
        warnings += [
            (
                "Not judged: the run has no evaluation.json, which apollonius train writes "
                "when it has finished."
            )
        ]
    if not games:
        warnings += ["No games to show: no stage has ended, so there are no agents yet."]
    return {
        "folder": folder,
        "title": f"Training run {folder.resolve().name}",
        "summary": f"{_describe(config.game)} Stages: {', '.join(stages)}; seed {config.seed}.",
        "warnings": warnings,
        "matches": matches,
        "stages": {name: (plan, by_stage[name]) for name, plan in stages.items()},
        "pictures": {
            name: learning_pictures(stage_lines, config.evaders)
            for name, stage_lines in by_stage.items()
            if stage_lines
        },
        "games": games,
        "config": (folder / "config.toml").read_text(encoding="utf-8"),
    }


def _describe(game: Game) -> str:
    arena = game.arena
    obstacles = f"{len(arena.discs)} discs" + (
        f", {len(arena.polygons)} polygons" if arena.polygons else ""
    )
    obstacles += f", {len(arena.extra)} others" if arena.extra else ""
    obstacles += f", the map {Path(arena.map.file).name}" if arena.map else ""
    return (
        f"Arena {arena.x_max - arena.x_min:g} m by {arena.y_max - arena.y_min:g} m, {obstacles}; "
        f"capture within {game.capture_distance:g} m; at most {game.max_steps * game.dt:g} s."
    )


def save_report(report: Mapping[str, Any], path: Path) -> None:
    """Write a report as one HTML file, atomically; raises InvalidInput where it is larger than
    `MAX_BYTES`.
    """
    html = render(report).encode(errors="replace")
    bound = f"at most {MAX_BYTES:,}; make the figures in the folder smaller"
    require(len(html) <= MAX_BYTES, "size of the report [bytes]", f"{len(html):,}", bound)
    write_atomically(path, html)


def render(report: Mapping[str, Any]) -> str:
    """Return a report as HTML, with everything from files escaped."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.policies["json.dumps_kwargs"]["allow_nan"] = False
    return environment.from_string((_HERE / "report.html").read_text(encoding="utf-8")).render(
        **report,
        replays=[for_page(replay) for replay, _ in report["games"]],
        asked={"games": GAMES, "seed": SEED},
        bar=[
            outcome
            for outcome in _BAR
            if any(outcome in match.result.outcomes for match in report["matches"])
        ],
        light=palette.LIGHT,
        dark=palette.DARK,
        style=Markup((_HERE / "report.css").read_text(encoding="utf-8")),
        player=Markup(bundle(_HERE / "replay.js")),
    )


_IMPORT = re.compile(r'^import \{([^}]+)\} from "([^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?:const|class|(?:async )?function\*?) (\w+)", re.MULTILINE)
_COMMENT = re.compile(r"^ *(?://[^\n]*|/\*\*.*?\*/)\n", re.MULTILINE | re.DOTALL)


def bundle(entry: Path) -> str:
    """Return a module after all that it imports, each as an object of its exports, without
    comments.

    Imports name files relative to it, and form no circle.
    """
    objects: dict[Path, str] = {}

    def text_of(path: Path) -> str:
        def imported(statement: re.Match[str]) -> str:
            source = (path.parent / statement[2]).resolve()
            name = f"{source.stem}Module"
            if source not in objects:
                text = text_of(source)
                exports = ", ".join(_EXPORT.findall(text))
                inner = re.sub("^export ", "", text, flags=re.MULTILINE)
                objects[source] = (
                    f"const {name} = (() => {{\n{inner}return {{ {exports} }};\n}})();\n"
                )
            return f"const {{{statement[1].replace(' as ', ': ')}}} = {name};\n"

        return _IMPORT.sub(imported, _COMMENT.sub("", path.read_text(encoding="utf-8")))

    text = text_of(entry)
    return "".join(objects.values()) + text
