"""The playground in the site: the page as `apollonius play` serves it, and what it takes to open it from a folder."""

import base64
import json
import re
import shutil
from pathlib import Path

from apollonius.web.site import write_site

_SCRIPTS = Path(__file__).parent / "scripts"
"""What leads to `offline.html`, and what loads the page there."""
_MODULE = re.compile(r'<script type="module" src="([^"]+)"></script>')
_IMPORT = re.compile(r'(?:(?:from|import)\s*\(?|new URL\()"\./([^"]+\.js)"')
"""What a module needs: at once, when it is first wanted, and as a worker."""
_DATA = (".json", ".safetensors", ".f32")


def write_playground(folder: Path) -> None:
    """Write the page, so that it plays on any web host, and opened from this folder too.

    A browser loads no module and fetches no file for a page that comes from `file:`. So the folder holds everything
    once more as plain scripts, and `offline.html`, to which the page leads there and which loads them.

    Args:
        folder: where to; new.
    """
    write_site(folder)
    page = (folder / "index.html").read_text()
    (entry,) = _MODULE.findall(page)
    (folder / "offline").mkdir()
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix in _DATA and name != "package.json":
            told = json.dumps([name, base64.b64encode(path.read_bytes()).decode()])
            (folder / "offline" / f"{name.replace('/', '-')}.js").write_text(f"apolloniusFile(...{told});\n")
    (folder / "offline" / "modules.js").write_text(f"apolloniusModules({json.dumps(in_order(folder, entry))});\n")
    for script in _SCRIPTS.glob("*.js"):
        shutil.copy(script, folder / script.name)
    (folder / "index.html").write_text(page.replace("<head>", '<head>\n    <script src="from_folder.js"></script>'))
    # Of a page that comes from a folder `'self'` is no address, and its modules are blobs.
    allowed = page.replace("-src 'self'", "-src 'self' file: blob:")
    (folder / "offline.html").write_text(_MODULE.sub('<script src="offline.js"></script>', allowed))


def in_order(folder: Path, entry: str) -> list[list[str]]:
    """The names and sources of a module and all that it imports, each after those that it imports itself."""
    found: dict[str, str] = {}

    def visit(name: str) -> None:
        if name not in found:
            source = (folder / name).read_text()
            for imported in _IMPORT.findall(source):
                visit(imported)
            found[name] = source

    visit(entry)
    return [[name, source] for name, source in found.items()]
