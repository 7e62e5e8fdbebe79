"""`python -m website`: the site as a static folder for any web host."""

import argparse
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from apollonius.cli import main as apollonius
from apollonius.show import palette
from apollonius.web.site import write_site
from website.sources import HERE, REPOSITORY, write_sources

_LOADS = {"script", "img", "iframe", "source", "video", "audio", "object", "embed"}
"""Elements that load what they name."""
_ADDRESSES = ("href", "src", "srcset", "data")


@dataclass
class _Reader(HTMLParser):
    """What a page can be reached by, and what it names."""

    anchors: set[str] = field(default_factory=set)
    links: list[tuple[str, bool]] = field(default_factory=list)
    """Addresses, and whether the browser loads them with the page."""

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element's own name and the addresses in it."""
        values = dict(attrs)
        self.anchors |= {name for key in ("id", "name") if (name := values.get(key))}
        loads = tag in _LOADS or (tag == "link" and values.get("rel") in ("stylesheet", "icon", "preload"))
        self.links += [(address, loads) for key in _ADDRESSES if (address := values.get(key))]


def complaints(folder: Path) -> list[str]:
    """What is wrong with a folder of pages: a line for each dead link and each resource from elsewhere.

    Links to other sites are not followed.
    """
    pages: dict[Path, _Reader] = {}
    for path in sorted(folder.rglob("*.html")):
        pages[path.resolve()] = reader = _Reader()
        reader.feed(path.read_text())
    found = [
        f"{path.relative_to(folder.resolve())}: {address}: {wrong}"
        for path, reader in pages.items()
        for address, loads in dict.fromkeys(reader.links)
        if (wrong := _wrong(path, address, loads, folder.resolve(), pages))
    ]
    return found


def _wrong(page: Path, address: str, loads: bool, folder: Path, pages: dict[Path, _Reader]) -> str:
    """What is wrong with an address in a page; nothing, if it is as it should be."""
    parts = urlsplit(address)
    if parts.scheme or parts.netloc:
        return "is loaded from elsewhere" if loads and parts.scheme not in ("data", "blob") else ""
    if parts.path.startswith("/"):
        return "works at the root of a host only"
    target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    if not target.is_relative_to(folder) or not target.is_file():
        return "leads nowhere"
    anchor = unquote(parts.fragment)
    if anchor and target in pages and anchor not in pages[target].anchors:
        return "leads to no such place in the page"
    return ""


def main() -> int:
    """Write the site; returns an exit status."""
    parser = argparse.ArgumentParser(prog="python -m website", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/site"), help="folder to write (default: %(default)s)")
    out: Path = parser.parse_args().out.resolve()
    work = out.with_name(f"{out.name}-sources")
    shutil.rmtree(out, ignore_errors=True)
    print("the documents, the gallery, the reference", flush=True)
    write_sources(work)
    _write_palette(work / "_static" / "palette.css")
    options = ["--builder", "html", "--fail-on-warning", "--keep-going", "--quiet", "--jobs", "auto"]
    options += ["--define", f"html_static_path={HERE / 'static'},{work / '_static'}"]
    folders = ["--conf-dir", str(HERE), "--doctree-dir", str(work / "doctrees")]
    subprocess.run([sys.executable, "-m", "sphinx", *options, *folders, str(work), str(out)], check=True)
    (out / "_static" / "webpack-macros.html").unlink(missing_ok=True)  # a template that the theme leaves there
    print("the playground", flush=True)
    write_site(out / "playground")
    print("the report", flush=True)
    apollonius(["report", str(REPOSITORY / "docs/results/demo"), "--out", str(out / "reports" / "demo.html")])
    found = complaints(out)
    print("\n".join([*found, f"{len(found)} dead links or resources from elsewhere"]), flush=True)
    return bool(found)


def _write_palette(path: Path) -> None:
    """The colours by meaning as CSS variables, for both kinds of pages."""
    path.parent.mkdir()
    rules: list[str] = []
    for theme, colours in (("light", palette.LIGHT), ("dark", palette.DARK)):
        lines = [f"  --{name}: {colour};" for name, colour in colours.items()]
        rules.append("\n".join([f"html[data-theme={theme}] {{", *lines, "}"]))
    path.write_text("\n\n".join(rules) + "\n")


if __name__ == "__main__":
    sys.exit(main())
