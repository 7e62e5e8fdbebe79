"""The page of a report: what stands on it, and the one HTML file that it becomes."""

import base64
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup
from PIL.PngImagePlugin import PngImageFile

from apollonius.document import read_bytes, write_atomically
from apollonius.errors import InvalidInput, require
from apollonius.evaluate.result import MatchResult
from apollonius.game.outcome import PURSUER_WINS, names_of
from apollonius.show import palette
from apollonius.show.report.games import Shown

MAX_BYTES = 3_000_000
"""Largest report: one that can be sent by mail."""
_PIXELS = 1.5
"""Pixels of a picture's file to one of the page, for screens with fine ones."""
_NARROWEST = 0.55
"""How small a picture may become on a narrow screen; beyond that the reader moves it sideways."""
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
    """A part of the page with a heading: words, then pictures."""

    title: str
    text: str = ""
    """Markdown; HTML in it is shown as it is written."""
    pictures: Sequence[Markup] = ()


@dataclass(frozen=True)
class Page:
    """A report before it is HTML. What it leaves empty is left out of the page."""

    title: str
    summary: str
    """One or two sentences: what this is."""
    warnings: Sequence[str] = ()
    """What is missing or not finished, and what to do."""
    claims: Sequence[dict[str, Any]] = ()
    """As `Claim.to_dict` writes them."""
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
    """The page as HTML. Whatever comes from files is escaped."""
    environment = Environment(
        loader=PackageLoader("apollonius.show", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"]["allow_nan"] = False
    environment.filters["markdown"] = _markdown
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


def picture(folder: Path, name: str, label: str) -> Markup:
    """Return an element that holds a PNG file, at the size of its letters' design; narrow screens show it smaller.

    Raises:
        InvalidInput: when the file is outside the folder, too large, or no PNG.
    """
    content = read_bytes(folder / name, "a picture of the report", "make it again", MAX_BYTES, within=folder)
    try:
        with PngImageFile(io.BytesIO(content)) as opened:
            width = opened.width / _PIXELS
    except Exception as error:  # Pillow raises what it likes for a damaged file
        raise InvalidInput(f"'{folder / name}' is no PNG file ({error}): make it again.") from error
    return Markup(
        '<img class="print" alt="{}" style="width: {:.0f}px; min-width: {:.0f}px" src="data:image/png;base64,{}">'
    ).format(label, width, _NARROWEST * width, base64.b64encode(content).decode())


def _markdown(text: str) -> Markup:
    return Markup(MarkdownIt("commonmark", {"html": False}).enable("table").render(text))


def replay_script() -> Markup:
    """The player of games, with the modules of the web page that draw them."""
    return Markup(bundled(Path(__file__).parents[1] / "replay.js"))


_IMPORT = re.compile(r'^import \{([^}]+)\} from "([^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?:const|class|function\*?) (\w+)", re.MULTILINE)
_COMMENT = re.compile(r"^ *(?://[^\n]*|/\*\*.*?\*/)\n", re.MULTILINE | re.DOTALL)


def bundled(entry: Path) -> str:
    """A module with all that it imports before it, each as an object of what it exports; comments are left out.

    Args:
        entry: the module's file; its imports name files relative to it, and form no circle.
    """
    objects: dict[Path, str] = {}

    def imported(path: Path) -> str:
        text = re.sub(_COMMENT, "", path.read_text())
        return _IMPORT.sub(lambda found: _taken(found[1], obtained(path.parent / found[2])), text)

    def obtained(path: Path) -> str:
        name = f"{path.stem}Module"
        if path.resolve() not in objects:
            text = imported(path)
            exports = ", ".join(_EXPORT.findall(text))
            inner = re.sub("^export ", "", text, flags=re.MULTILINE)
            objects[path.resolve()] = f"const {name} = (() => {{\n{inner}return {{ {exports} }};\n}})();\n"
        return name

    text = imported(entry)
    return "".join(objects.values()) + text


def _taken(names: str, module: str) -> str:
    return f"const {{{names.replace(' as ', ': ')}}} = {module};\n"
