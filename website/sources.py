"""The folder that Sphinx reads: the documents, with the parts of the site."""

import json
import os
import re
import shutil
from pathlib import Path

from apollonius.arenas.file import describe_game, game_names

HERE = Path(__file__).parent
REPOSITORY = HERE.parent
DOCS = REPOSITORY / "docs"


def _folder(name: str, pages: str) -> tuple[str, ...]:
    """Return the documents of a folder, the one that its tab opens first."""
    return f"{name}/index", *(f"{name}/{page}" for page in pages.split())


PARTS = {
    "Get started": ("start",),
    "Tutorials": _folder("tutorials", "play train floor_plan own_learner"),
    "How-to": _folder(
        "how-to",
        "runs extend evaluate solve environments jax teams lidar export ros2 turtlebot "
        "pictures reproduce cache",
    ),
    "Reference": (
        *_folder(
            "reference",
            "command config api/index rules game_files run_folder agents arenas browser ros_node "
            "glossary",
        ),
        "jaxpr2c",
    ),
    "Concepts": _folder(
        "concepts",
        "paper self_play shield solver any_arena sensing movers pursuers robots simulation "
        "architecture",
    ),
    "Benchmarks": _folder(
        "benchmarks",
        "as_printed replication leaderboard entrants scenarios generalisation buildings speed",
    ),
    "Project": ("contributing", "changelog", "security", "licence", "report"),
}
"""The tabs of the site besides its home page, each with its documents: first the one that it opens.
"""
BESIDE = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
    "LICENSE": "licence.md",
    "README.md": "index.md",
    "jaxpr2c/README.md": "jaxpr2c.md",
}
"""Files outside of the documents' folder, and the pages that stand for them."""
_ONLY_IN_THE_REPOSITORY = {"laboratory.md"}
_BLOCK = re.compile(r"^(```(?:python|sh|toml)\n.*?^```\n)", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"(?<!!)\[((?:[^][]|\[[^]]*\])*)\]\(([^)\s]+)\)")


def cards() -> str:
    """Return MyST source: a line for each game that ships with the package, with a link that plays
    there.
    """
    play = '- <a class="play" href="../playground/index.html?game={0}">{0}</a>: {1}'
    return (
        "\n## Play in each\n\n"
        + "\n".join(play.format(name, describe_game(name)) for name in game_names())
        + "\n"
    )


def leaderboard() -> str:
    """Return MyST source: a row for each card of the benchmark, the best of each track and side
    first.
    """
    cards = [
        json.loads(path.read_text(encoding="utf-8"))
        for path in (REPOSITORY / "benchmarks" / "leaderboard").glob("*.json")
    ]
    rows = [
        (
            "| track | side | agent | worth | worst against | worst tenth | crashes | forfeits "
            "| us a decision |"
        )
    ]
    rows.append("|---|---|---|---|---|---|---|---|---|")
    for card in sorted(
        cards, key=lambda card: (card["track"], card["side"], -card["score"]["net_win_rate"])
    ):
        score, (low, high) = card["score"], card["score"]["interval"]
        cells = [
            card["track"],
            card["side"],
            f"`{card['agent']}`",
            f"{score['net_win_rate']:+.2f} [{low:+.2f}, {high:+.2f}]",
        ]
        cells += [
            f"`{score['opponent']}`",
            f"{score['worst_tenth']:+.2f}",
            f"{score['crashes']:.1%}",
        ]
        cells += [f"{score['forfeits']:.1%}", f"{card['decision_us']:.0f}"]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n## The cards\n\n" + "\n".join(rows) + "\n"


def sections_of_readme() -> str:
    """Return the sections of the README that the home page shows: from the environments to the list
    of documents.
    """
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    return "\n" + text[text.index("## Environments") : text.index("## Documentation")]


def documents() -> dict[str, Path]:
    """Return the files behind the site's pages, by the pages' names; generated pages have none."""
    paths = [
        path for path in sorted(DOCS.rglob("*.md")) if path.name not in _ONLY_IN_THE_REPOSITORY
    ]
    files = {path.relative_to(DOCS).as_posix(): path for path in paths}
    files |= {name: REPOSITORY / file for file, name in BESIDE.items()}
    return files | {path.name: path for path in sorted((HERE / "pages").glob("*.md"))}


def write_sources(folder: Path) -> None:
    """Write the folder in place of an old one."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("figures", "results"):
        shutil.copytree(DOCS / name, folder / name, ignore=shutil.ignore_patterns("paper", "demo"))
    for name, path in documents().items():
        text = path.read_text(encoding="utf-8")
        if path.suffix != ".md":
            text = f"# The licence\n\n```text\n{text}```\n"
        if name == "reference/arenas.md":
            text += cards()
        if name == "benchmarks/leaderboard.md":
            text += leaderboard()
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        page = at_home(text, path)
        if name == "index.md":
            page += at_home(sections_of_readme(), REPOSITORY / "README.md")
        if name.startswith("tutorials/") and path.stem != "index":
            (folder / name).with_suffix(".ipynb").write_text(notebook(text), encoding="utf-8")
            title, _, below = page.partition("\n")
            page = f"{title}\n\n[Download as a notebook]({path.stem}.ipynb)\n{below}"
        (folder / name).write_text(f"{page}\n{_contents(name)}", encoding="utf-8")


INSTALL = """\
import os
import sysconfig
from importlib.metadata import PackageNotFoundError, distribution

SOURCE = "./apollonius"  # a checkout or a wheel
try:
    distribution("apollonius")
except PackageNotFoundError:
    %pip install --quiet "{SOURCE}[plot]"
os.environ["PATH"] = sysconfig.get_path("scripts") + os.pathsep + os.environ["PATH"]
os.environ.pop("FORCE_COLOR", None)  # no moving bars, which a notebook cannot show"""
"""First cell of each notebook: its commands are those of the package that it imports."""


def notebook(text: str) -> str:
    """Return a tutorial as a Jupyter notebook, in which Python, commands and named files are cells
    to run, and the first one installs the package where it is missing.

    What waits for a person, `apollonius play`, and what a program prints stay text, and links
    become their words. A cell of commands stops where one fails.
    """
    magic = {"python": "", "sh": "%%sh -e\n", "toml": "%%writefile {}\n"}
    cells: list[dict[str, object]] = [_code_cell(INSTALL)]
    for part in filter(str.strip, _BLOCK.split(text)):
        language, _, code = part.removeprefix("```").removesuffix("```\n").partition("\n")
        file_name = re.match(r"# (\S+)\n", code)
        runs = part.startswith("```") and language in magic and (language != "toml" or file_name)
        if runs and "apollonius play" not in code:
            source = magic[language].format(file_name and file_name[1]) + code.rstrip("\n")
            cells += [_code_cell(source)]
        else:
            words = _LINK.sub(lambda link: link[0] if "://" in link[2] else link[1], part)
            cells += [{"cell_type": "markdown", "metadata": {}, "source": words.strip("\n")}]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return json.dumps(
        {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 4}, indent=1
    )


def _code_cell(source: str) -> dict[str, object]:
    return {
        "cell_type": "code",
        "execution_count": None,
        "metadata": {},
        "outputs": [],
        "source": source,
    }


def _contents(name: str) -> str:
    """Return the hidden table of contents of the home page or of a part's front; other pages have
    none.
    """
    entries = {f"{front}.md": [f"/{page}" for page in pages] for front, *pages in PARTS.values()}
    entries["index.md"] = [f"{title} <{front}>" for title, (front, *_) in PARTS.items()]
    entry = entries.get(name)
    return "\n".join(["```{toctree}", ":hidden:", *entry, "```", ""]) if entry else ""


def at_home(text: str, document: Path) -> str:
    """Return the text with the links of the site; one to another file of the repository becomes its
    words.

    Pages of the site alone already have its links.
    """
    if document.is_relative_to(HERE / "pages"):
        return text
    folder = document.parent if document.is_relative_to(DOCS) else DOCS

    def rewritten(link: re.Match[str]) -> str:
        words, to = link.groups()
        file, mark, anchor = to.partition("#")
        if "://" in to or not file:
            return link[0]
        target = (document.parent / file).resolve()
        beside = BESIDE.get(os.path.relpath(target, REPOSITORY))
        if beside is not None:
            # The home page has none of the README's headings.
            anchored = mark + anchor if beside != "index.md" else ""
            return f"[{words}]({os.path.relpath(DOCS / beside, folder)}{anchored})"
        if (
            target.is_relative_to(DOCS)
            and target.is_file()
            and target.name not in _ONLY_IN_THE_REPOSITORY
        ):
            return f"[{words}]({os.path.relpath(target, folder)}{mark}{anchor})"
        return words

    return _LINK.sub(rewritten, text)
