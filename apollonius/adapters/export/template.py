"""Text with places to fill in: the files in `templates/`, which are the exported policies but for their numbers.

Lines that follow one that says `@discrete` or `@continuous`, `@charted` or `@uncharted` are for policies of that kind
only, up to `@both`.
"""

from pathlib import Path
from string import Template

from apollonius.adapters.export.blueprint import FALLBACK, FALLBACK_GEARS, LARGEST, Blueprint

TEMPLATES = Path(__file__).parent / "templates"
_KINDS = ("@both", "@discrete", "@continuous", "@charted", "@uncharted")


def fill(template: str, blueprint: Blueprint, **values: object) -> str:
    """The file of this name in `templates/`, its places filled in."""
    kinds = (
        "@both",
        "@continuous" if blueprint.continuous else "@discrete",
        "@charted" if blueprint.charted else "@uncharted",
    )
    kind, kept = "@both", []
    for line in (TEMPLATES / template).read_text().splitlines(keepends=True):
        if line.strip() in _KINDS:
            kind = line.strip()
        elif kind in kinds:
            kept.append(line)
    return Template("".join(kept)).substitute(_shared(blueprint), **values)


def _shared(blueprint: Blueprint) -> dict[str, object]:
    """Return the values that every template fills in."""
    return {
        "title": blueprint.title,
        "dt": f"{blueprint.game.dt:g}",
        "largest": f"{LARGEST:,.0f}",
        "fallback": FALLBACK,
        "fallback_gears": ", ".join(f"{gear:g}" for gear in FALLBACK_GEARS),
    }
