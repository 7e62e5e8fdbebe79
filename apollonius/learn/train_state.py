"""What a stage of training is and what changes in it: the plan, the learning sides, the games under way."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
from jaxtyping import Array, Int, PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool, Seated, solo
from apollonius.agents.trained import exploring
from apollonius.game.by_side import BySide
from apollonius.game.types import Role, Scalar
from apollonius.learn import archive
from apollonius.learn.algorithm import Learner, algorithm_of
from apollonius.learn.config import RunConfig
from apollonius.learn.learner_config import LearnerConfig
from apollonius.learn.opponents import OpponentConfig
from apollonius.learn.replay_buffer import ReplayBuffer
from apollonius.learn.stage_config import SelfPlayConfig, StageConfig
from apollonius.play.rollout import Games

_CHUNK_ENV_STEPS = 8192
"""Env steps between two looks from outside (progress, checkpoints, Ctrl-C), where iterations are small enough."""


@dataclass(frozen=True)
class Plan:
    """The fixed part of a stage: how to learn and for how long. Hashable, so it is static under `jit`."""

    learner: LearnerConfig
    stage: StageConfig

    @property
    def opponents(self) -> OpponentConfig:
        """Whom both sides meet where both learn."""
        return self.stage.opponents if isinstance(self.stage, SelfPlayConfig) else OpponentConfig()

    @property
    def iterations_per_chunk(self) -> int:
        """Rounds of play and updates in one compiled call."""
        return max(8, _CHUNK_ENV_STEPS // self.learner.env_steps_per_iteration)

    @property
    def env_steps_per_chunk(self) -> int:
        """Env steps in one compiled call."""
        return self.iterations_per_chunk * self.learner.env_steps_per_iteration

    @property
    def chunks_per_sitting(self) -> int:
        """Compiled calls between two changes of opponents."""
        return -(-self.opponents.renewal // self.env_steps_per_chunk)

    @property
    def sitting(self) -> int:
        """Steps of every game between two changes of opponents."""
        return self.chunks_per_sitting * self.env_steps_per_chunk // self.learner.games

    def renews_after(self, chunks: int) -> bool:
        """Whether opponents change after so many chunks of a stage."""
        return self.opponents.share > 0 and chunks > 0 and chunks % self.chunks_per_sitting == 0

    @property
    def chunks(self) -> int:
        """Compiled calls in the whole stage."""
        return -(-self.stage.env_steps // self.env_steps_per_chunk)


FIXED_TARGET, SELF_PLAY, DISTILLATION = STAGES = "fixed-target", "self-play", "distillation"


def plans_of(config: RunConfig) -> dict[str, Plan]:
    """Return the plans of a run's stages in their order, by name."""
    stages: dict[str, StageConfig] = dict(
        zip(STAGES, (config.fixed_target, config.self_play, config.distillation), strict=True)
    )
    asked = [FIXED_TARGET, SELF_PLAY] if config.stages == "both" else [config.stages]
    return {stage: Plan(config.learner, stages[stage]) for stage in asked}


class LearnerState(eqx.Module):
    """One learning side: its networks and its memory, of what it has played or of what it has been told."""

    learner: Learner
    buffer: ReplayBuffer[Any]


class TrainState(eqx.Module):
    """Everything that changes while a stage is trained.

    `learners` are the sides that learn. `key` is folded with the number of iterations, never replaced. `env_steps`
    counts steps of single games. `archives` hold the earlier versions of both sides, None where nobody meets them.
    """

    games: Games
    learners: dict[Role, LearnerState]
    key: PRNGKeyArray
    iterations: Int[Array, ""]
    env_steps: Int[Array, ""]
    episodes: Int[Array, ""]
    archives: BySide[archive.Archive] | None = None


def first_learner(plan: Plan, role: Role, key: PRNGKeyArray, network: Network | None = None) -> Learner:
    """Return one side's learner that goes on from a network, or from scratch. The key is consumed."""
    algorithm = algorithm_of(plan.learner)
    if network is None:
        return algorithm.init(plan.learner, key)
    return algorithm.start_from(plan.learner, network, key)


def players(
    plan: Plan,
    role: Role,
    learning: Mapping[Role, Network],
    fixed: Mapping[Role, Pool],
    archives: BySide[archive.Archive] | None,
    amount: Scalar,
) -> Pool | Seated:
    """Who plays one side: a given pool, or its learner, exploring by some amount (`agents.trained.exploring`), and, in
    the seats, its earlier versions.
    """
    if role in fixed:
        return fixed[role]
    if archives is None:
        return solo(exploring(learning[role], amount))
    return archive.seat(archives[role], plan.opponents, role, learning[role], amount, plan.learner.games)
