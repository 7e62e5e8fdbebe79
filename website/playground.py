"""The playground of the site: the page as `apollonius play` serves it, and scripts that open it from a folder."""

import base64
import json
import re
import shutil
from pathlib import Path

from apollonius.web.site import write_site

_SCRIPTS = Path(__file__).parent / "scripts"
"""One script leads to `offline.html`, one loads the page there."""
_MODULE = re.compile(r'<script type="module" src="([^"]+)"></script>')
_IMPORT = re.compile(r'(?:from|import)\s*\(?"\./([^"]+\.js)"')
"""What a module needs, at once or when it is first wanted."""
_DATA = (".json", ".safetensors", ".f32")


def write_playground(folder: Path) -> None:
    """Write the page, to be served by any web host or opened from the folder.

    A browser loads no module and fetches no file for a page that comes from `file:`. So the folder holds everything
    as plain scripts, too, and `offline.html`, which loads them.

    Args:
        folder: to write to; new.
    """
    write_site(folder)
    page = (folder / "index.html").read_text()
    (entry,) = _MODULE.findall(page)
    (folder / "offline").mkdir()
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix in _DATA and name != "package.json":
            arguments = json.dumps([name, base64.b64encode(path.read_bytes()).decode()])
            (folder / "offline" / f"{name.replace('/', '-')}.js").write_text(f"apolloniusFile(...{arguments});\n")
    (folder / "offline" / "modules.js").write_text(f"apolloniusModules({json.dumps(in_order(folder, entry))});\n")
    for script in _SCRIPTS.glob("*.js"):
        shutil.copy(script, folder / script.name)
    (folder / "index.html").write_text(page.replace("<head>", '<head>\n    <script src="from_folder.js"></script>'))
    # Of a page that comes from a folder `'self'` is no address, and its modules are blobs.
    allowed = page.replace("-src 'self'", "-src 'self' file: blob:")
    (folder / "offline.html").write_text(_MODULE.sub('<script src="offline.js"></script>', allowed))


def in_order(folder: Path, entry: str) -> list[list[str]]:
    """Return the names and sources of a module and its imports, each after its own imports."""
    found: dict[str, str] = {}

    def visit(name: str) -> None:
        if name not in found:
            source = (folder / name).read_text()
            for imported in _IMPORT.findall(source):
                visit(imported)
            found[name] = source

    visit(entry)
    return [[name, source] for name, source in found.items()]
