"""Libraries that only some commands need, by the extra of the package that installs them."""

from importlib.util import find_spec

from apollonius.errors import InvalidInput

EXTRAS = {
    "plot": {
        "matplotlib": "matplotlib", "jinja2": "jinja2", "markupsafe": "markupsafe", "markdown_it": "markdown-it-py",
    },
    "gym": {"gymnasium": "gymnasium", "pettingzoo": "pettingzoo"},
    "video": {"imageio_ffmpeg": "imageio-ffmpeg"},
    "ray": {"ray": "ray"},
    "export": {"onnx": "onnx", "onnxruntime": "onnxruntime"},
    "sim": {"mujoco": "mujoco"},
}  # fmt: skip
"""Modules of each extra, and what pip calls them."""


def install(extra: str) -> str:
    """Return the words that say how to install the libraries of an extra: they work with and without a checkout."""
    missing = [name for module, name in EXTRAS[extra].items() if find_spec(module) is None]
    return f"pip install {' '.join(missing or EXTRAS[extra].values())} (the extra '{extra}')"


def missing(extra: str) -> str | None:
    """Return what has to be done before the libraries of an extra can be used; None if they are all there."""
    if all(find_spec(module) for module in EXTRAS[extra]):
        return None
    return install(extra)


def require_extra(extra: str, what: str) -> None:
    """Refuse work, before it begins, that needs libraries which are not installed.

    Args:
        what: what needs them, for the message.

    Raises:
        InvalidInput: with the command that installs them.
    """
    if remedy := missing(extra):
        raise InvalidInput(f"{what} needs libraries that are not installed: {remedy}.")
