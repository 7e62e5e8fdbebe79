"""Proximal policy optimisation in numbers."""

from dataclasses import dataclass

from apollonius.agents.network import QNetwork
from apollonius.io.errors import require, require_positive, require_within
from apollonius.io.limits import TRANSITIONS
from apollonius.learn.algorithm import LearnerConfig


@dataclass(frozen=True)
class PPOConfig(LearnerConfig):
    """Proximal policy optimisation (Schulman et al., 2017), for the nine discrete actions."""

    network = QNetwork
    observation: str = "egocentric"
    gamma: float = 0.998
    learning_rate: float = 2e-4
    final_learning_rate: float = 1e-5
    batch: int = 4096
    games: int = 256
    steps: int = 128
    """Steps that every game plays in a round, after which all transitions are learned from."""
    epochs: int = 2
    """Times that a round learns from each transition."""
    clip: float = 0.2
    """Change of an action's probability, as a share, beyond which an update gains nothing."""
    trace: float = 0.95
    """Decay of a step in the estimate of advantages (lambda: Schulman et al., 2016)."""
    entropy: float = 1e-3
    """Weight of the entropy of actions."""
    hold: float = 1.0
    """Steps for which the random number that chooses an action is held, on average."""
    temperature: float = 3e-3
    """Difference between two actions of the first network [lost games] that makes one e times as
    likely: for one whose values lie closer together, a lower one.
    """
    critic_learning_rate: float = 5e-4
    """Adam's step size for the critic, at the start of a stage."""
    critic_first: int = 15
    """Rounds in which the critic alone learns: it begins from random weights."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_within(self, 1, 256, "hold")
        require_within(self, 1e-9, 10**9, "temperature")
        require_positive(self, "steps", "epochs", "clip", "critic_learning_rate")
        require_within(self, 0, 1, "clip", "trace", "entropy", "critic_learning_rate")
        require_within(self, 0, 2**31, "critic_first")
        TRANSITIONS.require("games x steps", self.env_steps_per_iteration)
        whole = self.env_steps_per_iteration % self.batch == 0
        require(
            whole,
            "batch",
            self.batch,
            f"a divisor of games x steps = {self.env_steps_per_iteration:,}",
        )

    @property
    def loss_value(self) -> float:
        """The value of a lost game in the logits."""
        return 1 / self.temperature

    @property
    def steps_per_iteration(self) -> int:
        return self.steps

    @property
    def iterations_per_chunk(self) -> int:
        return 1
