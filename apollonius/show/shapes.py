"""What is to be drawn of an arena, for whatever draws: round and straight shapes in metres, the lowest first."""

from dataclasses import dataclass

from apollonius.game.arena import Arena, Disc
from apollonius.show.palette import EVADER, INK, OBSTACLE


@dataclass(frozen=True)
class Round:
    """A disc, or a ring where it is not filled: centre and radius [m]."""

    x: float
    y: float
    radius: float
    colour: str
    filled: bool = True


@dataclass(frozen=True)
class Straight:
    """A shape with straight edges: corners x, y [m]; only its edge where it is not filled."""

    corners: tuple[tuple[float, float], ...]
    colour: str
    filled: bool = True


def shapes(arena: Arena) -> list[Round | Straight]:
    """Obstacles, territory and walls of an arena; the cells of a map, which are a picture already, apart."""
    x, y, x_max, y_max = (float(end) for end in (arena.x_min, arena.y_min, arena.x_max, arena.y_max))
    found: list[Round | Straight] = []
    for one in arena.obstacles:
        if isinstance(one, Disc):
            found.append(Round(float(one.x), float(one.y), float(one.radius), OBSTACLE))
        elif one.outline():
            found.append(Straight(tuple((float(x), float(y)) for x, y in one.outline()), OBSTACLE))
    if arena.territory:
        goal = arena.territory
        found.append(Round(float(goal.x), float(goal.y), float(goal.radius), EVADER, filled=False))
    return [*found, Straight(((x, y), (x_max, y), (x_max, y_max), (x, y_max)), INK, filled=False)]
