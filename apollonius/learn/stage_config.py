"""What each stage of a training can be told: the two of the curriculum, and distillation."""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Literal

from apollonius.agents.disturbance import Disturbance
from apollonius.catalogue import TABLE
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.errors import require, require_positive
from apollonius.io.limits import GAMES
from apollonius.learn.opponents import OpponentConfig


@dataclass(frozen=True)
class StageConfig:
    """How long a stage of the curriculum lasts and how often it is looked at. The defaults are those of stage 1."""

    env_steps: int = 19_000_000
    """Length of the stage."""
    pursuer_epsilon: float = 1.0
    """Share of random actions of a learning pursuer when the stage begins."""
    evader_epsilon: float = 1.0
    """Share of random actions of a learning evader when the stage begins."""
    progress: float = 3.0
    """Weight c of Eq. 8 and 9 [1/m] while training, in place of the game's own."""
    failure: float = 10.0
    """Price of a robot's own failure (Eq. 8, 9) while training, in place of the game's own."""
    evaluations: int = 40
    """Greedy evaluations in the course of the stage, evenly spaced."""
    evaluation_games: int = 1000
    """Games in each of them, always from the same starts."""
    disturbance: Disturbance = field(default_factory=Disturbance)
    """How the robots of both sides depart from those of the rules while training; by default not at all."""

    def __post_init__(self) -> None:
        require_positive(self, "env_steps", "evaluations", "evaluation_games")
        GAMES.require("evaluation_games", self.evaluation_games)
        require(self.env_steps < 2**30, "env_steps", self.env_steps, "less than 2^30, what the counter can hold")
        for name in ("progress", "failure"):
            require(0 <= getattr(self, name) < inf, name, getattr(self, name), "at least 0 and finite")
        for name in ("pursuer_epsilon", "evader_epsilon"):
            require(0 <= getattr(self, name) <= 1, name, getattr(self, name), "between 0 and 1")

    @property
    def epsilon(self) -> BySide[float]:
        """Share of random actions of either side when the stage begins, if it learns."""
        return BySide(self.pursuer_epsilon, self.evader_epsilon)

    def rewarded(self, game: Game) -> Game:
        """The game with this stage's own weights; only rewards differ, so the judge need not know."""
        return replace(game, reward=replace(game.reward, progress=self.progress, failure=self.failure))


@dataclass(frozen=True)
class SelfPlayConfig(StageConfig):
    """Stage 2 as it works best: the pursuer explores little, for it has learned already, and progress weighs little.

    With c = 3 an evader that gains three metres on its way into a wall is paid more than it loses there.
    """

    env_steps: int = 90_000_000
    pursuer_epsilon: float = 0.2
    progress: float = 1.0
    snapshots: int = 4
    """Times at which both agents are kept, evenly spaced over the stage; the last is its end."""
    opponents: OpponentConfig = field(default_factory=OpponentConfig)
    """Whom both sides meet."""
    zero_sum_within: float | None = None
    """Distance [m] beyond which the evader, too, is paid for coming closer (`apollonius.game.reward`), in place of the
    game's own; None leaves that, which is nowhere in the paper's game."""

    def __post_init__(self) -> None:
        super().__post_init__()
        within = self.zero_sum_within
        require(within is None or 0 < within < inf, "zero_sum_within", within, "more than 0 and finite, or left out")
        require(1 <= self.snapshots <= 100, "snapshots", self.snapshots, "from 1 to 100")

    def rewarded(self, game: Game) -> Game:
        """The game with this stage's own weights and its own bound of the zero-sum part."""
        weighed = super().rewarded(game)
        if self.zero_sum_within is None:
            return weighed
        return replace(weighed, reward=replace(weighed.reward, zero_sum_within=self.zero_sum_within))

    @property
    def snapshot_percents(self) -> tuple[int, ...]:
        """Percentages of the stage at which both agents are kept."""
        return tuple(round(100 * number / self.snapshots) for number in range(1, self.snapshots + 1))


@dataclass(frozen=True)
class DistillationConfig(StageConfig):
    """One side learns what a teacher knows, from the states that its own games come to."""

    env_steps: int = 50_000_000
    pursuer_epsilon: float = 0.04
    """Share of random actions of a learning pursuer, each held for a round; the same to the end."""
    evader_epsilon: float = 0.04
    """The same of a learning evader."""
    evaluations: int = 10
    evaluation_games: int = 300
    role: Literal["pursuer", "evader"] = "evader"
    """The side that learns."""
    teacher: str = TABLE
    """Who says what each action is worth: `table`, the player by the game solved for that side, or an agent trained by
    DQN."""
    opponents: tuple[str, ...] = (TABLE, "random", "P_prioritised", "P_pool", "intercept")
    """Whom it meets, each in an equal part of the games: `table` is the other side's."""
    near_sighted: int = 192
    """Games against an attacker that knows the student and looks one hold of ten steps ahead."""
    far_sighted: int = 64
    """Games against one that looks two holds ahead, at four times the cost."""
    grid: tuple[int, ...] | None = None
    """Nodes along x, y, v and heading on which the game is solved; None for those of `apollonius solve game`."""
    room: float = 0.05
    """Where actions leave less room than this [m], the teacher's say gives way to how much they leave; 0 leaves that
    out."""
    updates: int = 8
    """Updates in a round."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "updates")
        require(len(self.opponents) >= 1, "opponents", "none", "one at least")
        require(0 <= self.room < inf, "room", self.room, "at least 0 m and finite")
        for name in ("near_sighted", "far_sighted"):
            require(getattr(self, name) >= 0, name, getattr(self, name), "at least 0")
        require(
            self.disturbance == Disturbance(), "disturbance", self.disturbance, "left out: robots are the rules' own"
        )
        require(self.grid is None or len(self.grid) == 4, "grid", self.grid, "four numbers of nodes, or left out")

    @property
    def side(self) -> Role:
        """The side that learns."""
        return Role[self.role.upper()]
