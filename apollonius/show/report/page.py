"""The page of a report: what stands on it, and the one HTML file that it becomes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from apollonius.evaluate.match import Match, play_games, record_game, worst_first
from apollonius.evaluate.result import MatchResult
from apollonius.game.outcome import PURSUER_WINS, names_of
from apollonius.io.document import write_atomically
from apollonius.io.errors import require
from apollonius.play.replay import Replay, as_data
from apollonius.show import palette
from apollonius.show.words import in_play

GAMES = 200
"""Games of each pairing among which those that are shown are found."""
SEED = 1
LONGEST = 50_000
"""Most steps of such a game; the paper's have 1,000 at most."""
ORDER = (
    "one for every way in which they end, those that the pursuer lost first; beside each how long it lasts, and "
    "how many of the games end so."
)
"""Which they are, in words."""
_DIGITS = 3
"""Decimals of the states in the page: a millimetre, which is less than a pixel."""


@dataclass(frozen=True)
class Shown:
    """A game to watch."""

    replay: Replay
    times: int
    """How many games of this pairing ended in this way."""

    @property
    def pairing(self) -> str:
        return f"{self.replay.pursuer} against {self.replay.evader}"

    @property
    def outcome(self) -> str:
        return self.replay.outcome.name.lower()

    @property
    def seconds(self) -> float:
        """Its length [s]."""
        return len(self.replay.actions) * float(self.replay.game.dt)

    def to_dict(self) -> dict[str, Any]:
        """Return the game as the page's script reads it: a replay without actions, its states rounded.

        Of a game of teams `until` says for each robot the first step at which it is out of play, or None.
        """
        data = as_data(self.replay) | {"states": self.replay.states.astype(float).round(_DIGITS).tolist()}
        del data["actions"]
        if self.replay.game.teams:
            steps = in_play(self.replay).sum(axis=0).tolist()
            data["until"] = [step if step < len(self.replay.states) else None for step in steps]
        return data


def games_to_show(match: Match) -> list[Shown]:
    """Return one game for each outcome that occurs in a match, in the order of `worst_first`.

    Raises:
        InvalidInput: when its games may last for more than `LONGEST` steps.
    """
    bound = f"at most {LONGEST:,}, or no page could hold them"
    require(match.game.max_steps <= LONGEST, "steps of a game that a report shows", match.game.max_steps, bound)
    results = play_games(match)
    outcomes = np.asarray(results.outcome)
    first: dict[int, int] = {}
    for index in worst_first(results):
        first.setdefault(int(outcomes[index]), index)
    return [Shown(record_game(match, index), int(np.sum(outcomes == outcome))) for outcome, index in first.items()]


MAX_BYTES = 3_000_000
"""Largest report: one that can be sent by mail."""
_BAR = (
    "captured", "evader_hit_obstacle", "evader_out_of_range", "no_result",
    "both_failed", "pursuer_out_of_range", "pursuer_hit_obstacle", "territory_reached",
)  # fmt: skip
"""Outcomes from the pursuer's best to its worst, as bars show those that can be."""


@dataclass(frozen=True)
class Judged:
    """What a match between two agents came to."""

    pursuer: str
    evader: str
    result: MatchResult
    paper: dict[str, float]
    """The paper's shares of outcomes for such a pairing, as far as it reports them."""

    @property
    def paper_win_rate(self) -> float:
        """The pursuer's win rate in the paper, of the outcomes that it reports."""
        return sum(self.paper.get(outcome, 0.0) for outcome in names_of(PURSUER_WINS))


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading: paragraphs, then pictures."""

    title: str
    words: Sequence[str]
    pictures: Sequence[Markup]


@dataclass(frozen=True)
class Page:
    """A report before it is HTML. What it leaves empty is left out of the page."""

    title: str
    summary: str
    """One or two sentences: what this is."""
    warnings: Sequence[str] = ()
    """What is missing or not finished, and what to do."""
    matches: Sequence[Judged] = ()
    matches_note: str = ""
    facts: Sequence[Sequence[str]] = ()
    """A table: its head, then its rows."""
    sections: Sequence[Section] = ()
    games: Sequence[Shown] = ()
    games_note: str = ""
    config: str = ""
    """The configuration's file."""
    command: str = ""
    """What makes all this again."""


def save_page(page: Page, path: Path) -> None:
    """Write a page as one HTML file, atomically.

    Raises:
        InvalidInput: when it would be larger than `MAX_BYTES`; nothing is written.
    """
    html = render(page).encode(errors="replace")
    bound = f"at most {MAX_BYTES:,}; make the figures in the folder smaller"
    require(len(html) <= MAX_BYTES, "size of the report [bytes]", f"{len(html):,}", bound)
    write_atomically(path, html)


def render(page: Page) -> str:
    """Return the page as HTML, with everything from files escaped."""
    environment = Environment(
        loader=PackageLoader("apollonius.show", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"]["allow_nan"] = False
    environment.filters["words"] = lambda name: name.replace("_", " ")
    return environment.get_template("page.html").render(
        page=page,
        replays=[shown.to_dict() for shown in page.games],
        bar=[outcome for outcome in _BAR if any(outcome in match.result.outcomes for match in page.matches)],
        light=palette.LIGHT,
        dark=palette.DARK,
        style=Markup(files("apollonius.show").joinpath("report/page.css").read_text()),
        player=replay_script(),
    )


def replay_script() -> Markup:
    """Return the player of games with the modules of the web page that draw them."""
    return Markup(bundled(Path(__file__).parents[1] / "replay.js"))


_IMPORT = re.compile(r'^import \{([^}]+)\} from "([^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?:const|class|(?:async )?function\*?) (\w+)", re.MULTILINE)
_COMMENT = re.compile(r"^ *(?://[^\n]*|/\*\*.*?\*/)\n", re.MULTILINE | re.DOTALL)


def bundled(entry: Path) -> str:
    """Return a module after all that it imports, each as an object of its exports, without comments.

    Args:
        entry: the module's file; its imports name files relative to it, and form no circle. A file beside it is taken
            in place of one of the same name elsewhere.
    """
    objects: dict[Path, str] = {}

    def imported(path: Path) -> str:
        text = re.sub(_COMMENT, "", path.read_text())
        return _IMPORT.sub(
            lambda found: f"const {{{found[1].replace(' as ', ': ')}}} = {obtained(path.parent / found[2])};\n", text
        )

    def obtained(path: Path) -> str:
        name = f"{path.stem}Module"
        if path.resolve() not in objects:
            beside = entry.parent / path.name
            text = imported(beside if beside.exists() else path)
            exports = ", ".join(_EXPORT.findall(text))
            inner = re.sub("^export ", "", text, flags=re.MULTILINE)
            objects[path.resolve()] = f"const {name} = (() => {{\n{inner}return {{ {exports} }};\n}})();\n"
        return name

    text = imported(entry)
    return "".join(objects.values()) + text
