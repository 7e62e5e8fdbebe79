"""The folder that Sphinx reads: the documents, with the parts of the site and what is generated from the package."""

import re
import shutil
from dataclasses import dataclass
from html import escape
from pathlib import Path

import tomli_w

from apollonius.arenas.file import GALLERY, about_game, find_game, game_names
from apollonius.arenas.record import to_dict
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.show.arena import draw_arena
from apollonius.show.style import inline_svg
from website.reference import write_reference

_INCHES = 3.6
"""The longer side of an arena's picture."""


def cards() -> str:
    """MyST source: a section for each game that ships with the package."""
    return "\n## Arena by arena\n\n" + "\n".join(_card(name, find_game(name)) for name in game_names())


def _card(name: str, game: Game) -> str:
    arena = game.arena
    width, height = float(arena.x_max - arena.x_min), float(arena.y_max - arena.y_min)
    scale = _INCHES / max(width, height)
    label = f"The arena {name} from above"
    picture = inline_svg(lambda axes: draw_arena(axes, arena), label, scale * width + 0.8, scale * height + 0.7)
    numbers = {
        "size": f"{width:g} m by {height:g} m",
        "obstacles": _obstacles(game),
        "capture": f"centres closer than {float(game.capture_distance):g} m",
        "pursuer": _limits(game.pursuer),
        "evader": "the same" if game.evader == game.pursuer else _limits(game.evader),
        "longest game": f"{game.max_steps * float(game.dt):g} s",
    }
    rows = "".join(f"<tr><th scope='row'>{key}</th><td>{escape(value)}</td></tr>" for key, value in numbers.items())
    return f"""### {name}

{about_game(name)}

```{{raw}} html
<div class="arena-card">
<div class="picture">{picture}</div>
<div><table class="table">{rows}</table>
<p><a class="play" href="playground/index.html?game={name}">Play here</a></p></div>
</div>
<details><summary>Its file</summary>
```

```toml
{_file(name, game).strip()}
```

```{{raw}} html
</details>
```
"""


def _file(name: str, game: Game) -> str:
    """What a file says that makes this game: the one that ships, or all numbers of a preset."""
    path = GALLERY / f"{name}.toml"
    return path.read_text() if path.exists() else tomli_w.dumps(to_dict(game))


def _obstacles(game: Game) -> str:
    counts = {"disc": len(game.arena.discs), "polygon": len(game.arena.polygons)}
    found = ", ".join(f"{count} {kind}{'s' * (count > 1)}" for kind, count in counts.items() if count)
    return found or "none"


def _limits(robot: Unicycle) -> str:
    return (
        f"{robot.v_min:g} to {robot.v_max:g} m/s, {robot.u1_max:g} m/s², {robot.u2_max:g} rad/s, "
        f"radius {robot.radius:g} m"
    )


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
"""What the site consists of besides its home page."""
BESIDE = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
    "LICENSE": "licence.md",
    "README.md": "index.md",
}
"""Files of the repository's root, and the pages that stand for them."""
_LINK = re.compile(r"(?<!!)\[((?:[^][]|\[[^]]*\])*)\]\(([^)\s]+)\)")


def documents() -> dict[str, Path]:
    """The files behind the site's pages, by the pages' names; the reference has none."""
    files = {path.name: path for path in sorted((REPOSITORY / "docs").glob("*.md"))}
    files |= {name: REPOSITORY / file for file, name in BESIDE.items()}
    return files | {path.name: path for path in sorted((HERE / "pages").glob("*.md"))}


def write_sources(folder: Path) -> None:
    """Write the folder anew."""
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
    """The hidden table of contents of the home page and of a part's front; other pages have none."""
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
    """The text with its links as they are in the site: to pages, to files that it has, to other sites.

    What else the repository holds is named, and no link.
    """

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
