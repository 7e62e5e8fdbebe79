"""Text with places to fill in: the files in `templates/`, which are the exported policies but for their numbers."""

from pathlib import Path
from string import Template

from apollonius.adapters.export.blueprint import FALLBACK, LARGEST, Blueprint

TEMPLATES = Path(__file__).parent / "templates"


def fill(template: str, **values: object) -> str:
    """The file of this name in `templates/`, its places filled in."""
    return Template((TEMPLATES / template).read_text()).substitute(values)


def shared(blueprint: Blueprint) -> dict[str, object]:
    """What is written alike in every language."""
    return {
        "title": blueprint.title,
        "dt": f"{blueprint.game.dt:g}",
        "largest": f"{LARGEST:,.0f}",
        "fallback": FALLBACK,
    }
