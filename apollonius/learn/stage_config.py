"""The stages of a training in numbers: the two of the curriculum, those of one side, and the plan
of a stage.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

from apollonius.catalogue import TABLE
from apollonius.game.game import MAX_STEPS, Game
from apollonius.game.presets import randomised
from apollonius.game.scenario import Spread
from apollonius.game.types import BySide, Role
from apollonius.io.errors import require, require_positive, require_within
from apollonius.io.limits import GAMES
from apollonius.learn.algorithm import LearnerConfig
from apollonius.learn.opponents import OpponentConfig


@dataclass(frozen=True)
class StageConfig:
    """Length, exploration, rewards and evaluations of a stage; by default of stage 1."""

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
    """Games in each evaluation, always from the same starts."""
    time_limit: int | None = None
    """Time limit of games of training [steps]; None for that of the game. Evaluations keep the
    game's.
    """
    limit_terminates: bool = False
    """True for games of training that end with the time limit: no value is bootstrapped from their
    last state.
    """
    randomise: tuple[Spread, ...] = ()
    """Numbers of the robots, their sensors and drives that each game draws while training."""

    def __post_init__(self) -> None:
        require_positive(self, "evaluations", "evaluation_games")
        GAMES.require("evaluation_games", self.evaluation_games)
        require_within(self, 1, 2**30 - 1, "env_steps")  # as the counter can hold
        require_within(self, 0, 10**9, "progress", "failure")
        require_within(self, 0, 1, "pursuer_epsilon", "evader_epsilon")
        if self.time_limit is not None:
            require_within(self, 1, MAX_STEPS, "time_limit")

    @property
    def epsilon(self) -> BySide[float]:
        """Share of random actions of either side when the stage begins, if it learns."""
        return BySide(self.pursuer_epsilon, self.evader_epsilon)

    def trained_in(self, game: Game) -> Game:
        """Return the game of this stage's training: with its reward weights and time limit, and the
        robots it draws.
        """
        reward = replace(game.reward, progress=self.progress, failure=self.failure)
        max_steps = game.max_steps if self.time_limit is None else self.time_limit
        trained = replace(game, reward=reward, max_steps=max_steps)
        return randomised(trained, self.randomise) if self.randomise else trained


@dataclass(frozen=True)
class SelfPlayConfig(StageConfig):
    """Stage 2. Its pursuer has learned already and explores little; progress weighs little.

    With c = 3 an evader that gains three metres on its way into a wall is paid more than it loses
    there.
    """

    env_steps: int = 90_000_000
    pursuer_epsilon: float = 0.2
    progress: float = 1.0
    snapshots: int = 4
    """Times at which both agents are saved, evenly spaced over the stage; the last is its end."""
    opponents: OpponentConfig = field(default_factory=OpponentConfig)
    """The opponents of both sides."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_within(self, 1, 100, "snapshots")


@dataclass(frozen=True)
class Task:
    """A further game of a response, with as many opponents as its stage, or with the same."""

    game: Game
    opponents: tuple[str, ...] = ()


@dataclass(frozen=True)
class OneSideConfig(StageConfig):
    """A stage in which one side learns, against opponents that do not."""

    evaluations: int = 10
    evaluation_games: int = 300
    role: Literal["pursuer", "evader"] = "evader"
    """The side that learns."""
    opponents: tuple[str, ...] = ("pursuer",)
    """Its opponents, each in an equal part of the games."""
    clearance_margin: float = 0.0
    """Clearance [m] that an action should leave after braking
    (`apollonius.agents.wrappers.clearance_penalty`); 0 for none.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require(len(self.opponents) >= 1, "opponents", "none", "one at least")
        require_within(self, 0, 10**9, "clearance_margin")

    @property
    def side(self) -> Role:
        return Role[self.role.upper()]

    def line_ups(self, game: Game) -> list[tuple[Game, dict[Role, tuple[str, ...]]]]:
        """List the games that a run in this game is trained in, each with the names of its players
        by side.
        """
        return [(game, {self.side.other: self.opponents})]


@dataclass(frozen=True)
class ResponseConfig(OneSideConfig):
    """One side learns a best response by proximal policy optimisation, in one or several games."""

    env_steps: int = 16_000_000
    progress: float = 0.0
    failure: float = 15.0
    tasks: tuple[Task, ...] = ()
    """Further games, which take turns with the run's own."""
    restart_fraction: float = 0.0
    """Share of games that begin in a state from which a game was lost within a round. Where few
    games are lost, most games teach nothing (Florensa et al., "Reverse curriculum generation for
    reinforcement learning", 2017, begin near the goal).
    """
    initial_weight_share: float = 0.0
    """Share of its first network in the weights of the agent, which then forgets less (Wortsman et
    al., "Robust fine-tuning of zero-shot models", 2022).
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require_within(self, 0, 1, "restart_fraction", "initial_weight_share")
        alike = all(len(task.opponents) in (0, len(self.opponents)) for task in self.tasks)
        require(
            alike,
            "tasks: opponents",
            "given",
            f"{len(self.opponents)} names, as those of the stage, or left out",
        )

    def line_ups(self, game: Game) -> list[tuple[Game, dict[Role, tuple[str, ...]]]]:
        tasks = Task(game), *self.tasks
        return [(task.game, {self.side.other: task.opponents or self.opponents}) for task in tasks]


@dataclass(frozen=True)
class DistillationConfig(OneSideConfig):
    """One side learns a teacher's action values, in the states of its own games."""

    env_steps: int = 50_000_000
    pursuer_epsilon: float = 0.04
    """Share of random actions of a learning pursuer, each held for a round; constant."""
    evader_epsilon: float = 0.04
    """Share of random actions of a learning evader, each held for a round; constant."""
    teacher: str = TABLE
    """Source of the action values: `table`, the player by the game solved for that side, or an
    agent trained by DQN.
    """
    opponents: tuple[str, ...] = (TABLE, "random", "pursuer", "P_curriculum", "intercept")
    """Its opponents, each in an equal part of the games that attackers leave: `table` is the other
    side's.
    """
    near_sighted: int = 192
    """Games against an attacker that knows the student and looks one hold of ten steps ahead."""
    far_sighted: int = 64
    """Games against one that looks two holds ahead, at four times the cost."""
    grid: tuple[int, ...] | None = None
    """Nodes along x, y, v and heading on which the game is solved; None for those of `apollonius
    solve game`.
    """
    clearance: float = 0.05
    """Clearance [m] below which labels weigh it against the teacher's values; 0 ignores clearance.
    """
    updates: int = 8
    """Updates in a round."""
    informed: float = 3.0
    """Time since a side with sensors saw an opponent [s] up to which it learns what its teacher,
    who sees it, does.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "updates")
        require_within(self, 0, 10**9, "clearance", "near_sighted", "far_sighted", "informed")
        bound = "left out: tables know the rules' own robots only"
        require(not (self.randomise and self.solves), "randomise", "some numbers", bound)
        require(
            self.grid is None or len(self.grid) == 4,
            "grid",
            self.grid,
            "four numbers of nodes, or left out",
        )

    def line_ups(self, game: Game) -> list[tuple[Game, dict[Role, tuple[str, ...]]]]:
        return [
            (task_game, names | {self.side: (self.teacher,)})
            for task_game, names in super().line_ups(game)
        ]

    @property
    def solves(self) -> bool:
        """True if somebody needs the tables of solved games."""
        searches = self.near_sighted + self.far_sighted + self.clearance > 0
        return searches or TABLE in (self.teacher, *self.opponents)


@dataclass(frozen=True)
class Plan:
    """The fixed part of a stage: how to learn and for how long. Hashable, so it is static under
    `jit`.
    """

    learner: LearnerConfig
    stage: StageConfig

    @property
    def opponents(self) -> OpponentConfig:
        """The opponents of both sides where both learn."""
        return self.stage.opponents if isinstance(self.stage, SelfPlayConfig) else OpponentConfig()

    @property
    def env_steps_per_chunk(self) -> int:
        """Env steps in one compiled call."""
        return self.learner.iterations_per_chunk * self.learner.env_steps_per_iteration

    @property
    def chunks(self) -> int:
        """Compiled calls in the whole stage."""
        return -(-self.stage.env_steps // self.env_steps_per_chunk)

    def evaluates(self, before: int, after: int) -> bool:
        """Check whether one of the stage's evaluations is in the chunks (before, after]."""
        times = self.stage.evaluations
        return after * times // self.chunks > before * times // self.chunks

    def share(self, env_steps: int) -> float:
        """Return the share of the stage's updates that is made after some env steps."""
        total = self.chunks * self.env_steps_per_chunk
        idle = self.learner.steps_before_learning
        idle = idle if idle < total else 0
        return max(0, env_steps - idle) / (total - idle)

    @property
    def chunks_per_assignment(self) -> int:
        """Compiled calls between two draws of opponents."""
        return -(-self.opponents.renewal // self.env_steps_per_chunk)

    @property
    def steps_per_assignment(self) -> int:
        """Steps of every game between two draws of opponents."""
        return self.chunks_per_assignment * self.env_steps_per_chunk // self.learner.games

    def resamples_after(self, chunks: int) -> bool:
        """Check whether opponents are drawn again after this many chunks of a stage."""
        return self.opponents.share > 0 and chunks > 0 and chunks % self.chunks_per_assignment == 0
