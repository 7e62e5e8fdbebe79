"""Everything a training run can be told, with what it means; saved as `config.toml` and read back strictly."""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Literal

from apollonius.agents.disturbance import Disturbance
from apollonius.errors import require, require_positive
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.learn.scheme import OpponentConfig


@dataclass(frozen=True)
class DQNConfig:
    """How one side learns (section II-B). Intervals are in environment steps: one step of one game."""

    observation: Literal["paper", "encoded"] = "encoded"
    """What the network reads: the 8 numbers of Eq. 7, or the encoded profile."""
    width: int = 256
    """Units of each hidden layer (Fig. 3)."""
    depth: int = 4
    """Number of hidden layers (Fig. 3)."""
    gamma: float = 0.99
    """Discount of a step (section IV)."""
    double: bool = True
    """Let the online network choose and the target network value the next action (double Q-learning)."""
    n_step: int = 16
    """Rewards summed before a value is bootstrapped, at the start of a stage: far-reaching, but of high variance."""
    final_n_step: int = 4
    """The same at the end of a stage, reached in a straight line: less noise, and the best action is taken for granted
    rather than the one that was explored (annealed as in Schwarzer et al., "Bigger, Better, Faster", 2023)."""
    learning_rate: float = 5e-4
    """Adam's step size at the start of a stage."""
    final_learning_rate: float = 2e-5
    """Adam's step size at the end of a stage, reached in a straight line."""
    averaging: float = 3e-4
    """Part of the way that the averaged weights go towards the network at each update; 1 plays the network itself."""
    batch: int = 256
    """Transitions in an update."""
    env_steps_per_update: int = 512
    """Env steps between two updates of each learner."""
    target_period: int = 128_000
    """Env steps between two copies of the network to the target network (C in Algorithms 1 and 2)."""
    games: int = 512
    """Games played at a time."""
    replay_capacity: int = 524_288
    """Transitions kept."""
    learning_starts: int = 40_000
    """Env steps before the first update."""
    final_epsilon: float = 0.02
    """Share of random actions once exploration has settled."""
    exploration_fraction: float = 0.2
    """Part of a stage over which the share of random actions falls to its final value."""

    def __post_init__(self) -> None:
        require_positive(
            self, "width", "depth", "n_step", "final_n_step", "learning_rate", "batch", "env_steps_per_update"
        )
        require_positive(self, "target_period", "games", "replay_capacity")
        require(self.final_n_step <= self.n_step, "final_n_step", self.final_n_step, f"at most n_step = {self.n_step}")
        require(0 <= self.gamma <= 1, "gamma", self.gamma, "between 0 and 1")
        require(0 < self.averaging <= 1, "averaging", self.averaging, "more than 0 and at most 1")
        require(0 <= self.final_epsilon <= 1, "final_epsilon", self.final_epsilon, "between 0 and 1")
        require(0 <= self.exploration_fraction <= 1, "exploration_fraction", self.exploration_fraction, "from 0 to 1")
        rates = 0 < self.final_learning_rate <= self.learning_rate < 1
        require(rates, "final_learning_rate", self.final_learning_rate, "above 0 and at most learning_rate, below 1")
        shape = (self.games, self.env_steps_per_update)
        require(
            max(shape) % min(shape) == 0, "env_steps_per_update", self.env_steps_per_update,
            f"a multiple or a divisor of games = {self.games}",
        )  # fmt: skip
        require(
            self.rows >= 2 * (self.n_step + self.steps_per_iteration), "replay_capacity", self.replay_capacity,
            f"at least {2 * (self.n_step + self.steps_per_iteration) * self.games} for these games and n_step",
        )  # fmt: skip

    @property
    def steps_per_iteration(self) -> int:
        """Steps every game plays between two rounds of updates."""
        return max(1, self.env_steps_per_update // self.games)

    @property
    def updates_per_iteration(self) -> int:
        """Updates in a round."""
        return max(1, self.games // self.env_steps_per_update)

    @property
    def env_steps_per_iteration(self) -> int:
        """Env steps of all games between two rounds of updates."""
        return self.steps_per_iteration * self.games

    @property
    def rows(self) -> int:
        """Time steps the replay holds: the capacity, rounded down to whole iterations."""
        return self.replay_capacity // self.env_steps_per_iteration * self.steps_per_iteration


PROFILES: dict[str, DQNConfig] = {
    "fast": DQNConfig(),
    "paper": DQNConfig(
        observation="paper",
        double=False,
        n_step=1,
        final_n_step=1,
        learning_rate=1e-4,
        final_learning_rate=1e-4,
        batch=32,
        env_steps_per_update=1,
        averaging=1.0,
        target_period=1_000,
        games=1,
        learning_starts=10_000,
        final_epsilon=0.05,
    ),
}
"""`fast`: the default. `paper`: plain DQN as printed (Eq. 3, section IV, Algorithms 1 and 2)."""


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
        require(self.env_steps < 2**30, "env_steps", self.env_steps, "less than 2^30, what the counter can hold")
        for name in ("progress", "failure"):
            require(0 <= getattr(self, name) < inf, name, getattr(self, name), "at least 0 and finite")
        for name in ("pursuer_epsilon", "evader_epsilon"):
            require(0 <= getattr(self, name) <= 1, name, getattr(self, name), "between 0 and 1")

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

    def __post_init__(self) -> None:
        super().__post_init__()
        require(1 <= self.snapshots <= 100, "snapshots", self.snapshots, "from 1 to 100")

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
    """How each side learns."""
    fixed_target: StageConfig = field(default_factory=StageConfig)
    """Stage 1: the pursuer against evaders that do not learn."""
    self_play: SelfPlayConfig = field(default_factory=SelfPlayConfig)
    """Stage 2: both against each other."""
    evaders: tuple[str, ...] = ("still",)
    """Players that the pursuer of stage 1 learns to catch: `still`, as in Algorithm 1, or others, of whom each game
    meets one."""
    pursuer: str | None = None
    """Agent that the pursuer of a lone stage goes on from; None is from scratch."""

    def __post_init__(self) -> None:
        require(0 <= self.seed < 2**32, "seed", self.seed, "between 0 and 2^32 - 1")
        past, games = self.self_play.opponents, self.dqn.games
        seated = past.share == 0 or int(past.share * games) >= 2 * past.seats
        require(seated, "games", games, f"more, so that {past.scheme} has one for each of 2 x {past.seats} seats")
        require(
            self.pursuer is None or self.stages != "both", "pursuer", self.pursuer,
            "left out unless stages is one stage: the curriculum trains the pursuer from scratch",
        )  # fmt: skip
        require(
            self.evaders == ("still",) or self.stages == "fixed-target", "evaders", ", ".join(self.evaders),
            "left out unless stages is 'fixed-target': the pursuer of the curriculum begins with one that stays",
        )  # fmt: skip


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
