"""A survey of an arena as a picture. Needs Pillow only."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageColor

from apollonius.game.survey import Survey
from apollonius.show.palette import EVADER, OBSTACLE, OTHER, PAPER


def save_plan(survey: Survey, path: Path) -> None:
    """Write the picture: obstacles, parts of the free space that are cut off from the largest, and the evader's havens.

    What is neither, but lighter than an obstacle, is where the pursuer's body does not fit.
    """
    pursuer, evader = survey.parts
    pixels = np.full((*survey.blocked.shape, 3), ImageColor.getrgb(PAPER), np.uint8)
    pixels[pursuer == 0] = np.mean([ImageColor.getrgb(PAPER), ImageColor.getrgb(OBSTACLE)], axis=0).astype(np.uint8)
    for parts in (pursuer, evader):
        sizes = np.bincount(parts[parts > 0], minlength=1)
        pixels[(parts > 0) & (parts != np.argmax(sizes))] = ImageColor.getrgb(OTHER)
    pixels[survey.haven] = ImageColor.getrgb(EVADER)
    pixels[survey.blocked] = ImageColor.getrgb(OBSTACLE)
    Image.fromarray(np.ascontiguousarray(pixels[::-1])).save(path)
