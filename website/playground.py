"""The playground of the site: the page as `apollonius play` serves it, and scripts that open it
from a folder.
"""

import base64
import json
import shutil
from pathlib import Path

from apollonius.show.report import bundle
from apollonius.web.site import write_site

_SCRIPTS = Path(__file__).parent / "scripts"
"""One script leads to `offline.html`, one loads files there."""
_PLAYER = '<script type="module" src="player.js"></script>'
_LEAD = '<a id="lead" target="_top" hidden></a>'
"""A link that the page leaves empty unless it is in a frame."""
_DATA = (".json", ".safetensors", ".f32")


def write_playground(folder: Path) -> None:
    """Write the page to a new folder, to be served by any web host or opened from the folder.

    A browser loads no module and fetches no file for a page that comes from `file:`. So the folder
    holds everything as plain scripts, too, and `offline.html`, which loads them.
    """
    write_site(folder)
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert _PLAYER in page
    assert _LEAD in page
    page = page.replace(
        _LEAD, '<a id="lead" target="_top" href="../index.html" aria-label="Back to the site">‹</a>'
    )
    (folder / "offline").mkdir()
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix in _DATA and name != "package.json":
            file = json.dumps([name, base64.b64encode(path.read_bytes()).decode()])
            (folder / "offline" / f"{name.replace('/', '-')}.js").write_text(
                f"apolloniusFile(...{file});\n", encoding="utf-8"
            )
    (folder / "offline" / "player.js").write_text(
        f"(() => {{\n{bundle(folder / 'player.js')}}})();\n", encoding="utf-8"
    )
    for script in _SCRIPTS.glob("*.js"):
        shutil.copy(script, folder / script.name)
    (folder / "index.html").write_text(
        page.replace("<head>", '<head>\n    <script src="from_folder.js"></script>'),
        encoding="utf-8",
    )
    scripts = '<script src="offline.js"></script><script defer src="offline/player.js"></script>'
    # Of a page that comes from a folder `'self'` is no address.
    (folder / "offline.html").write_text(
        page.replace("-src 'self'", "-src 'self' file:").replace(_PLAYER, scripts), encoding="utf-8"
    )
