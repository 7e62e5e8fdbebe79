"""What became of the robots of a match between teams."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Array, Int

from apollonius.errors import require
from apollonius.game.by_side import BySide
from apollonius.game.types import RobotStatus


@dataclass(frozen=True)
class RobotCounts:
    """Robots of all games together, by their status at the end."""

    pursuers: dict[str, int]
    evaders: dict[str, int]

    def __post_init__(self) -> None:
        known = {status.name.lower() for status in RobotStatus}
        for side in (self.pursuers, self.evaders):
            possible = known - {"hit_mate"} <= set(side) <= known and min(side.values()) >= 0
            require(possible, "robots", side, f"counts of {', '.join(sorted(known))}")

    @property
    def captured(self) -> int:
        """Evaders that were captured."""
        return self.evaders["captured"]

    @property
    def lost(self) -> BySide[int]:
        """Robots of either side that put themselves out: by an obstacle, a wall or a mate."""
        failures = [status.name.lower() for status in RobotStatus if status > RobotStatus.CAPTURED]
        return BySide(self.pursuers, self.evaders).map(lambda side: sum(side.get(name, 0) for name in failures))


def count_robots(statuses: BySide[tuple[Int[Array, " games"], ...]]) -> RobotCounts:
    """Count the robots of games that have ended; of collisions of mates nothing is said where there were none."""

    def by_name(side: tuple[Int[Array, " games"], ...]) -> dict[str, int]:
        counts = np.bincount(np.concatenate([np.asarray(status) for status in side]), minlength=len(RobotStatus))
        named = {status.name.lower(): int(counts[status]) for status in RobotStatus}
        return {name: count for name, count in named.items() if name != "hit_mate" or count}

    return RobotCounts(*map(by_name, statuses))
