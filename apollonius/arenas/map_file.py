"""ROS occupancy maps as files: the YAML of map_server, and the PGM or PNG image that it names."""

import functools
import hashlib
import io
import math
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import scipy  # its parts are loaded where they are used
from jaxtyping import Bool, Int

from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.io.document import read_bytes, to_json, write_atomically
from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import require_memory

_MOST_CELLS = 10_000
"""Most cells along a side: the field of such a map takes 400 MB, and 12 seconds."""
_BYTES_A_CELL = 110
"""Memory that reading a map and surveying it takes, measured, rounded up."""
_MOST_YAML = 2**14
"""Largest YAML file [bytes]; map_server's have some 150."""
_MOST_IMAGE = 5 * _MOST_CELLS**2
"""Largest image file [bytes]: as text, a cell may take four digits and a blank."""
_BLACK, _FREE = 0, 254
"""Grey levels that map_server writes for occupied and free cells."""
_UNKNOWN = 205 / 255
"""Grey level that map_server writes for unknown cells, as a share of white."""
_CHANNELS = {"1": "L", "P": "RGB", "LA": "RGBA"} | {
    mode: mode for mode in ("L", "I;16", "I", "RGB", "RGBA")
}
"""The kind of image whose channels are those of a kind."""
_DEEP = ("I;16", "I")
"""Kinds with 16 bits for each channel."""
_TRUTHS = {"false": 0, "no": 0, "off": 0, "n": 0, "true": 1, "yes": 1, "on": 1, "y": 1}
"""YAML's words for true and false, in small letters."""


def load_map(path: Path, digest: str | None = None) -> OccupancyMap:
    """Return the map of a YAML file with `image`, `resolution`, `origin`, `negate`,
    `occupied_thresh`, `free_thresh`.

    A cell is free where its occupancy, the image's darkness, is below `free_thresh`. All others are
    occupied: those above `occupied_thresh`, and the unknown ones between. A key of the package's
    own, `least_obstacle` [m^2], takes out connected occupied cells that cover less. Other keys are
    ignored, as map_server does. Raises InvalidInput for a file that is missing or unreadable, an
    impossible value, a turned map, and another digest.
    """
    text, content = _files(path)
    found_digest = hashlib.sha256(text + content).hexdigest()
    bound = "the map of this game, which has changed since; restore it"
    shown_digest = f"SHA-256 {found_digest[:12]}..."
    require(digest in (None, found_digest), f"map '{path}'", shown_digest, bound)
    return _map(path.resolve(), found_digest, text, content)


def share_of_unknown_cells(path: Path) -> float:
    """Return the share of a map's cells that are of map_server's grey for unknown and yet below
    `free_thresh`.
    """
    text, content = _files(path)
    values = _read_yaml(text, f"map '{path}'")
    dark = _darkness(values, content, f"map '{path}'")
    unknown = _UNKNOWN if values["negate"] else 1 - _UNKNOWN
    return float(np.mean((np.abs(dark - unknown) < 1e-4) & (dark < values["free_thresh"])))


def _files(path: Path) -> tuple[bytes, bytes]:
    text = read_bytes(path, "the YAML file of a ROS map", "check the path", _MOST_YAML)
    image = path.parent / str(_read_yaml(text, f"map '{path}'")["image"])
    return text, read_bytes(
        image, f"the image of the map '{path}'", "check the path, or crop it", _MOST_IMAGE
    )


@functools.lru_cache(maxsize=2)
def _map(path: Path, digest: str, text: bytes, content: bytes) -> OccupancyMap:
    """Return the map of two files' contents; the latest two are cached, as one game reads its map
    several times.
    """
    name = f"map '{path}'"
    values = _read_yaml(text, name)
    free = _darkness(values, content, name) < values["free_thresh"]
    x, y, _ = values["origin"]
    occupied = np.ascontiguousarray(~free[::-1])
    if values["least_obstacle"]:
        parts, _ = label_parts(occupied)
        areas = np.bincount(parts.ravel())[parts] * values["resolution"] ** 2
        occupied &= areas >= values["least_obstacle"]
    field = distance_field(occupied, values["resolution"])
    return OccupancyMap(jnp.asarray(field), x, y, values["resolution"], str(path), digest)


def label_parts(
    cells: Bool[np.ndarray, "rows columns"], corners: bool = True
) -> tuple[Int[np.ndarray, "rows columns"], int]:
    """Number the connected parts of a grid from 1, and count them; cells also touch at `corners` or
    not.
    """
    numbered = np.zeros(cells.shape, np.int32)
    structure = np.ones((3, 3)) if corners else None
    count: Any = scipy.ndimage.label(cells, structure=structure, output=numbered)
    return numbered, int(count)


def keep_largest(
    cells: Bool[np.ndarray, "rows columns"],
) -> tuple[Bool[np.ndarray, "rows columns"], int]:
    """Return the largest part of a grid that is connected along sides, and the number of parts."""
    numbered, count = label_parts(cells, corners=False)
    sizes = np.bincount(numbered.ravel(), minlength=count + 1)
    return (numbered == 1 + np.argmax(sizes[1:])) if count else cells, count


def count_islands(free: Bool[np.ndarray, "rows columns"]) -> int:
    """Count the pieces of what is not free that are apart from the outside, not even touching it at
    corners.
    """
    return label_parts(np.pad(~free, 1, constant_values=True))[1] - 1


def save_map(cells: OccupancyMap, path: Path) -> None:
    """Write a map as a YAML file and a `.pgm` image beside it, from which `load_map` reads the same
    field.
    """
    from PIL import Image

    image = path.with_suffix(".pgm")
    content = io.BytesIO()
    shades = np.where(cells.occupied()[::-1], _BLACK, _FREE).astype(np.uint8)
    Image.fromarray(shades).save(content, "PPM")
    write_atomically(image, content.getvalue())
    # JSON is YAML, whatever is in a name.
    values = {
        "image": image.name,
        "resolution": float(cells.cell),
        "origin": [float(cells.x), float(cells.y), 0.0],
    }
    values |= {"negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196}
    lines = [f"{key}: {to_json(value)}\n" for key, value in values.items()]
    write_atomically(path, "".join(lines).encode())


def _read_yaml(text: bytes, name: str) -> dict[str, Any]:
    """Return the checked values, as numbers."""
    values = _parse_yaml(text, name)
    for key in ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"):
        require(key in values, f"{name}: {key}", "missing", "given, as map_server wants it")
    image = values["image"]
    require(isinstance(image, str) and image, f"{name}: image", image, "the name of a file")
    numbers = {"least_obstacle": 0} | values
    numbers["negate"] = _TRUTHS.get(str(values["negate"]).lower(), values["negate"])
    for key in ("resolution", "negate", "occupied_thresh", "free_thresh", "least_obstacle"):
        numbers[key] = _number(numbers[key], f"{name}: {key}")
    _require_ranges(values, numbers, name)
    mode = values.get("mode", "trinary")
    require(mode == "trinary", f"{name}: mode", mode, "trinary, as cells are either free or not")
    numbers["origin"] = _read_origin(values["origin"], name)
    return numbers


def _parse_yaml(text: bytes, name: str) -> dict[str, Any]:
    """Return the keys and values of a YAML file, as text."""
    import yaml

    class Loader(yaml.BaseLoader):
        """A loader of texts, lists and mappings alone, without aliases, by which a line can hold a
        million.
        """

        def compose_node(self, parent: Any, index: Any) -> Any:
            is_alias = self.check_event(yaml.AliasEvent)
            if is_alias or getattr(self.peek_event(), "tag", None) is not None:
                raise yaml.YAMLError("aliases such as *this and tags such as !this are not read")
            return super().compose_node(parent, index)

    try:
        values = yaml.load(text, Loader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        problem = f"{name} is no YAML file: {str(error) or 'it is nested too deeply'}"
        raise InvalidInput(f"{problem}; correct it.") from error
    kind = type(values).__name__
    bound = "keys with values: image, resolution, origin ..."
    require(isinstance(values, dict), name, kind, bound)
    return values


def _require_ranges(values: dict[str, Any], numbers: dict[str, Any], name: str) -> None:
    """Refuse numbers that are out of range; messages show the resolution and `negate` as
    written.
    """
    bound = "metres in a cell, more than 0"
    is_possible = 0 < numbers["resolution"] <= 1e3
    require(is_possible, f"{name}: resolution", values["resolution"], bound)
    bound = "0 or false (dark is occupied), 1 or true"
    require(numbers["negate"] in (0, 1), f"{name}: negate", values["negate"], bound)
    least = numbers["least_obstacle"]
    bound = "m^2 of the smallest obstacle that stays, 0 or more"
    require(least >= 0, f"{name}: least_obstacle", least, bound)
    free, occupied = numbers["free_thresh"], numbers["occupied_thresh"]
    bound = f"above 0, up to occupied_thresh = {occupied} <= 1"
    require(0 < free <= occupied <= 1, f"{name}: free_thresh", free, bound)


def _read_origin(origin: Any, name: str) -> list[float]:
    """Return x, y [m] and yaw, 0, of the lower left corner."""
    is_place = isinstance(origin, list) and len(origin) == 3
    shown_origin = str(origin).replace("'", "")
    bound = "[x, y, yaw] of the lower left corner, in metres and radians"
    require(is_place, f"{name}: origin", shown_origin, bound)
    x, y, yaw = (_number(number, f"{name}: origin") for number in origin)
    bound = "0, as walls lie along x and y; turn the image and set it to 0"
    require(yaw == 0, f"{name}: origin, yaw", yaw, bound)
    return [x, y, yaw]


def _number(value: Any, name: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    require(abs(number) <= 1e6, name, value, "a number within 1e6 of 0")
    return number


def _darkness(values: dict[str, Any], content: bytes, name: str) -> np.ndarray:
    """Return the darkness of every pixel, from 0 to 1 (of the lightest where negated), the first
    row at the top.

    As map_server has it, that is the mean of red, green and blue, and of the opacity too where the
    image has one.
    """
    from PIL.PngImagePlugin import PngImageFile
    from PIL.PpmImagePlugin import PpmImageFile

    image_name = f"{name}: image"
    # `Image.open` has a bound of its own, in lines of its own.
    kind = PngImageFile if content.startswith(b"\x89PNG") else PpmImageFile
    try:
        with kind(io.BytesIO(content)) as image:
            bound = "grey or of colours; convert it to PGM"
            require(image.mode in _CHANNELS, image_name, f"of kind {image.mode}", bound)
            size = image.size
            bound = f"at most {_MOST_CELLS:,} cells along each side; crop it"
            require(max(size) <= _MOST_CELLS, image_name, size, bound)
            require_memory(image_name, size, _BYTES_A_CELL * size[0] * size[1], "crop it")
            is_deep = image.mode in _DEEP
            clear = image.has_transparency_data and not is_deep
            channels = image.convert("RGBA" if clear else _CHANNELS[image.mode]).split()
            sums = sum(np.asarray(channel, np.float32) for channel in channels)
            light = np.asarray(sums / ((65_535 if is_deep else 255) * len(channels)))
    except InvalidInput:
        raise
    except Exception as error:  # Pillow raises what it likes for a damaged file
        remedy = "copy it again, or convert it to one of these"
        problem = f"{image_name} is no whole PGM or PNG file ({error})"
        raise InvalidInput(f"{problem}: {remedy}.") from error
    return light if values["negate"] else 1 - light
