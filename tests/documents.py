"""The code blocks of README, docs and the site's own pages, as a reader of the page sees them.

A block says what it is after its fence: `python` and `sh` are run, `toml` is a game, `c` is compiled, `text` is output,
a formula or a drawing.
"""

import shlex
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

REPOSITORY = Path(__file__).parents[1]
PAGES = tuple(sorted((REPOSITORY / "website" / "pages").glob("*.md")))
"""Pages that the site has besides the documents; their links are those of the site."""
DOCUMENTS = (
    REPOSITORY / "README.md",
    REPOSITORY / "CONTRIBUTING.md",
    REPOSITORY / "CHANGELOG.md",
    REPOSITORY / "SECURITY.md",
    REPOSITORY / "examples" / "README.md",
    REPOSITORY / "jaxpr2c" / "README.md",
    *sorted((REPOSITORY / "docs").rglob("*.md")),
    *PAGES,
)
LANGUAGES = ("python", "sh", "toml", "c", "text")


@dataclass(frozen=True)
class Block:
    """A block of code, with the line of its document in which it begins."""

    document: Path
    line: int
    language: str
    code: str

    def __str__(self) -> str:
        return f"{name_of(self.document)}:{self.line}"

    def commands(self) -> list[list[str]]:
        """The words of each command, which only `sh` has, without comments and the environment's folder."""
        text = self.code if self.language == "sh" else ""
        lines = text.replace("\\\n", " ").replace(".venv/bin/", "").splitlines()
        return [words for line in lines if (words := shlex.split(line, comments=True))]


def name_of(document: Path) -> str:
    return str(document.relative_to(REPOSITORY))


def blocks(document: Path) -> list[Block]:
    """The blocks of a document in their order; indented ones have no language. What the site's generator is told, as
    `{raw} html`, is none.
    """
    tokens = MarkdownIt().parse(document.read_text(encoding="utf-8"))
    return [
        Block(document, token.map[0] + 1, token.info, token.content)
        for token in tokens
        if token.type in ("fence", "code_block") and token.map and not token.info.startswith("{")
    ]


def asides(document: Path) -> list[list[str]]:
    """The words of the commands that stand in the text, between backticks: whole ones, not the bare name of one."""
    tokens = MarkdownIt().enable("table").parse(document.read_text(encoding="utf-8"))
    spans = [part.content for token in tokens for part in token.children or () if part.type == "code_inline"]
    return [words for span in spans if (words := span.split())[0] == "apollonius" and len(words) > 2]


ALL = [block for document in DOCUMENTS for block in blocks(document)]
"""Every block of every document."""
