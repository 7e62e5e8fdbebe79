"""Everything a training run can be told, with what it means; saved as `config.toml` and read back strictly."""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Literal

from apollonius.agents.disturbance import Disturbance
from apollonius.errors import require, require_positive
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.learn.learner_config import DQNConfig, LearnerConfig, SACConfig
from apollonius.learn.opponents.opponent_config import OpponentConfig
from apollonius.learn.opponents.seats import seat_games
from apollonius.limits import GAMES, SEED
from apollonius.observe.registry import find_observation


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

    def learner_of(self, role: Role, learner: LearnerConfig) -> LearnerConfig:
        """How one side learns, where both learn like this."""
        return learner

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
    evader_observation: str | None = None
    """What the evader's network reads, if something else than the pursuer's: `opponent-aware` tells it what the pursuer
    does in the step to come."""

    def __post_init__(self) -> None:
        super().__post_init__()
        within = self.zero_sum_within
        require(within is None or 0 < within < inf, "zero_sum_within", within, "more than 0 and finite, or left out")
        if self.evader_observation is not None:
            find_observation(self.evader_observation)
        require(1 <= self.snapshots <= 100, "snapshots", self.snapshots, "from 1 to 100")

    def learner_of(self, role: Role, learner: LearnerConfig) -> LearnerConfig:
        """How one side learns: the evader's network may read something else."""
        own = self.evader_observation if role == Role.EVADER else None
        return learner if own is None else replace(learner, observation=own)

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
class RunConfig:
    """A whole training run."""

    seed: int = 0
    """Seed of everything random in the run."""
    stages: Literal["fixed-target", "self-play", "both"] = "both"
    """Algorithm 1, Algorithm 2 with both sides from scratch, or the curriculum of both."""
    game: Game = field(default_factory=lambda: make_game("paper"))
    """The game, number by number."""
    dqn: DQNConfig = field(default_factory=DQNConfig)
    """How each side learns, by deep Q-learning, unless `sac` is given."""
    sac: SACConfig | None = None
    """How each side learns by soft actor-critic, so that its actions are continuous; None where it does not."""
    fixed_target: StageConfig = field(default_factory=StageConfig)
    """Stage 1: the pursuer against evaders that do not learn."""
    self_play: SelfPlayConfig = field(default_factory=SelfPlayConfig)
    """Stage 2: both against each other."""
    evaders: tuple[str, ...] = ("still",)
    """Players that the pursuer of stage 1 learns to catch: `still`, as in Algorithm 1, or others, of whom each game
    meets one."""
    pursuer: str | None = None
    """Agent that the pursuer of a lone stage goes on from; None is from scratch."""
    evader: str | None = None
    """Agent that the evader of a lone self-play goes on from; None is from scratch, as in Algorithm 2."""
    devices: int = 1
    """Devices that share the training, of all processes together: as many updates of as many transitions as on one,
    with other random numbers."""

    def __post_init__(self) -> None:
        SEED.require("seed", self.seed)
        require_positive(self, "devices")
        told = find_observation(self.learner.observation).is_told
        require(not told, "observation", self.learner.observation, "what both can read; one side at most is told")
        past, games = self.self_play.opponents, self.learner.games
        seated = past.share == 0 or seat_games(past, games) > 0
        require(seated, "games", games, f"more, so that {past.scheme} has one for each of 2 x {past.seats} seats")
        longest = games * self.game.max_steps
        require(
            past.renewal >= longest or not past.rule.keeps_records, "renewal", past.renewal,
            f"at least games x max_steps = {longest:,}, so that games that {past.scheme} judges by can end",
        )  # fmt: skip
        require(
            self.pursuer is None or self.stages != "both", "pursuer", self.pursuer,
            "left out unless stages is one stage: the curriculum trains the pursuer from scratch",
        )  # fmt: skip
        require(
            self.evader is None or self.stages == "self-play", "evader", self.evader,
            "left out unless stages is 'self-play': no other stage has an evader that goes on from an agent",
        )  # fmt: skip
        require(
            self.evaders == ("still",) or self.stages == "fixed-target", "evaders", ", ".join(self.evaders),
            "left out unless stages is 'fixed-target': the pursuer of the curriculum begins with one that stays",
        )  # fmt: skip

    @property
    def first(self) -> BySide[str | None]:
        """The agents that the sides go on from."""
        return BySide(self.pursuer, self.evader)

    @property
    def learner(self) -> LearnerConfig:
        """How each side learns."""
        return self.sac or self.dqn


PRESETS: dict[str, RunConfig] = {
    "paper": RunConfig(),
    "standard": replace(
        RunConfig(),
        fixed_target=StageConfig(env_steps=6_000_000),
        self_play=SelfPlayConfig(env_steps=8_000_000),
    ),
    "quick": replace(
        RunConfig(),
        fixed_target=StageConfig(env_steps=4_000_000, evaluations=8, evaluation_games=500),
        self_play=SelfPlayConfig(env_steps=2_500_000, evaluations=8, evaluation_games=500),
    ),
}
"""`quick`: minutes on two cores. `standard`: some three times that. `paper`: about the paper's 200,000 + 300,000
episodes."""
