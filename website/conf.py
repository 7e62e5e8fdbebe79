"""Settings by which Sphinx makes the site of the folder that `website.sources` has written."""

import inspect
import re
from pathlib import Path
from typing import Any

from sphinx.ext.napoleon import Config  # pyright: ignore[reportMissingImports]
from sphinx.ext.napoleon.docstring import GoogleDocstring  # pyright: ignore[reportMissingImports]

from apollonius.version import __version__

HERE = Path(__file__).parent
_GOOGLE: Any = Config(napoleon_use_rtype=False, napoleon_attr_annotations=False)

project = html_title = "Apollonius"
author = "The Apollonius authors"
copyright = "the Apollonius authors, under the MIT licence"
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx_copybutton"]
myst_heading_anchors = 4
_ABOUT = "Learns, solves and plays pursuit-evasion games between mobile robots among obstacles."
myst_html_meta = {
    "description": _ABOUT,
    "property=og:title": project,
    "property=og:description": _ABOUT,
}
default_role = "code"
add_module_names = False
autosummary_generate = False
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_preserve_defaults = True
autodoc_mock_imports = ["jax2onnx", "mujoco", "onnxruntime", "ray"]  # extras
maximum_signature_line_length = 100
toc_object_entries_show_parents = "hide"
python_use_unqualified_type_names = True

html_theme = "pydata_sphinx_theme"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_favicon = html_logo = str(HERE.parent / "apollonius" / "web" / "page" / "icon.svg")
html_show_sourcelink = html_copy_source = False
html_show_search_summary = False  # which it fetches: from a folder nothing can be
html_sidebars: dict[str, list[str]] = {"index": [], "start": [], "report": []}
html_theme_options = {
    "logo": {"text": project},
    "header_links_before_dropdown": 8,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": {"**": ["page-toc"], "index": [], "report": []},
    "pygments_light_style": "github-light",
    "pygments_dark_style": "github-dark",
    "footer_start": ["copyright"],
    "footer_end": [],
    "back_to_top_button": False,
    "search_bar_text": "Search",
}


def setup(app: Any) -> None:
    """Connect the functions below."""
    app.connect("autodoc-process-docstring", _as_written)
    app.connect("autodoc-process-signature", _in_short)
    app.connect("autodoc-skip-member", _is_default)


def _as_written(
    app: Any, what: Any, name: str, documented: Any, options: Any, lines: list[str]
) -> None:
    """Turn docstrings into reStructuredText: stars are escaped, and sections in Google's style are
    read.
    """
    for number, line in enumerate(lines):
        parts = re.split(r"(`[^`]*`)", line)
        lines[number] = "".join(
            part if part.startswith("`") else re.sub(r"([*|])", r"\\\1", part) for part in parts
        )
    # of which Napoleon takes what stands before a colon for a type
    if what not in ("attribute", "data", "property"):
        lines[:] = GoogleDocstring(lines, _GOOGLE, app, what, name, documented, options).lines()


def _in_short(
    app: Any,
    what: str,
    name: str,
    documented: Any,
    options: Any,
    arguments: str | None,
    result: str | None,
) -> tuple[str | None, str | None]:
    """Shorten types to the names in the source."""
    module = r"\b(?:jaxlib\._jax|jax\._src\.\w+|numpy|pathlib|collections\.abc)\.(?=\w)"
    return arguments and re.sub(module, "", arguments), result and re.sub(module, "", result)


def _is_default(
    app: Any, what: str, name: str, member: Any, skip: bool, options: Any
) -> bool | None:
    """Skip a function that is the default of a field, which its class documents."""
    return True if inspect.isfunction(member) and member.__name__ != name else None
