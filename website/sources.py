"""The folder that Sphinx reads: the documents, with the parts of the site and what is generated from the package."""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from apollonius.arenas.file import about_game, game_names
from website.reference import write_reference

REPOSITORY = Path(__file__).parents[1]
HERE = Path(__file__).parent


@dataclass(frozen=True)
class Part:
    """A tab of the site."""

    title: str
    front: str
    """The document that the tab opens."""
    pages: tuple[str, ...] = ()
    """The documents below it, in their order."""


PARTS = (
    Part("Start", "start", ("rules", "glossary", "waiting")),
    Part("Play", "play", ("agents", "gallery", "own_arena", "pictures")),
    Part("Train", "training", ("self_play", "smooth", "any_arena")),
    Part("Judge", "judging", ("bodies",)),
    Part("Truth", "ground_truth", ("near_optimal", "teams")),
    Part("Deploy", "deploy", ("interfaces", "jax")),
    Part("Results", "results", ("report", "paper", "laboratory")),
    Part(
        "Develop", "architecture", ("reference/index", "extending", "contributing", "changelog", "security", "licence")
    ),
)
"""The site besides its home page."""
BESIDE = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
    "LICENSE": "licence.md",
    "README.md": "index.md",
}
"""Files of the repository's root, and the pages that stand for them."""
_LINK = re.compile(r"(?<!!)\[((?:[^][]|\[[^]]*\])*)\]\(([^)\s]+)\)")


def cards() -> str:
    """Return MyST source: a line for each game that ships with the package, with a link that plays there."""
    play = '- <a class="play" href="playground/index.html?game={0}">{0}</a>: {1}'
    return "\n## Play in each\n\n" + "\n".join(play.format(name, about_game(name)) for name in game_names()) + "\n"


def documents() -> dict[str, Path]:
    """The files behind the site's pages, by the pages' names; the reference has none."""
    files = {path.name: path for path in sorted((REPOSITORY / "docs").glob("*.md"))}
    files |= {name: REPOSITORY / file for file, name in BESIDE.items()}
    return files | {path.name: path for path in sorted((HERE / "pages").glob("*.md"))}


def write_sources(folder: Path) -> None:
    """Write the folder in place of an old one."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("figures", "results"):
        shutil.copytree(REPOSITORY / "docs" / name, folder / name, ignore=shutil.ignore_patterns("paper", "demo"))
    write_reference(folder / "reference")
    for name, path in documents().items():
        text = path.read_text()
        if path.suffix != ".md":
            text = f"# The licence\n\n```text\n{text}```\n"
        if name == "gallery.md":
            text += cards()
        (folder / name).write_text(f"{at_home(text, path)}\n{_contents(name)}")


def _contents(name: str) -> str:
    """Return the hidden table of contents of the home page or of a part's front; other pages have none."""
    entries: list[str] = []
    if name == "index.md":
        entries = [f"{part.title} <{part.front}>" for part in PARTS]
    for part in PARTS:
        if name == f"{part.front}.md":
            entries = list(part.pages)
    if not entries:
        return ""
    return "\n".join(["```{toctree}", ":hidden:", *entries, "```", ""])


def at_home(text: str, document: Path) -> str:
    """Return the text with the links of the site; one to another file of the repository becomes its words."""

    def rewritten(link: re.Match[str]) -> str:
        words, to = link.groups()
        file, mark, anchor = to.partition("#")
        if "://" in to or not file:
            return link[0]
        target = (document.parent / file).resolve()
        if target.parent == REPOSITORY and target.name in BESIDE:
            # The home page has none of the README's headings.
            return f"[{words}]({BESIDE[target.name]}{mark + anchor if target.name != 'README.md' else ''})"
        if target.is_relative_to(REPOSITORY / "docs") and target.is_file():
            return f"[{words}]({target.relative_to(REPOSITORY / 'docs').as_posix()}{mark}{anchor})"
        return words

    return _LINK.sub(rewritten, text)
