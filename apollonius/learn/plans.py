"""The stages of a run by name: the plan of each, and the agents that they go on from."""

from apollonius.agents.network import Network
from apollonius.agents.trained import load_network
from apollonius.game.types import Role
from apollonius.learn.algorithm import fitted
from apollonius.learn.config import RunConfig
from apollonius.learn.stage_config import StageConfig
from apollonius.learn.train_state import Plan

FIXED_TARGET, SELF_PLAY, DISTILLATION = STAGES = "fixed-target", "self-play", "distillation"


def plans_of(config: RunConfig) -> dict[str, Plan]:
    """Return the stages of a run in their order, by name."""
    stages: dict[str, StageConfig] = {
        FIXED_TARGET: config.fixed_target,
        SELF_PLAY: config.self_play,
        DISTILLATION: config.distillation,
    }
    asked = [FIXED_TARGET, SELF_PLAY] if config.stages == "both" else [config.stages]
    return {stage: Plan(config.learner, stages[stage]) for stage in asked}


def load_first(config: RunConfig, role: Role) -> Network | None:
    """The network that a side goes on from, if the config names one.

    Raises:
        InvalidInput: when there is no such agent, or its network is not of the kind that the config trains.
    """
    name = config.first[role]
    if name is None:
        return None
    return fitted(load_network(name, role), config.learner, role.name.lower(), name)
